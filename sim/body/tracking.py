"""A clip tracked by the physical figure alone, without Phantom: tracking errors, residual, slide of the feet, falls."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numba import typeof, types

from controllers.kernel_call import call_as_given
from controllers.lent import by_pointer
from geometry.arrays import Array, Mask, rms
from models.floor import add_floor
from models.humanoid.skeleton import DEFAULT_MASS, DEFAULT_STATURE, figure_model, figure_spec, standing_com
from models.mocap.motion.clip import CLOSURE_TOLERANCE, Clip, pose_errors
from models.mocap.motion.foot_skate import ContactSlide, Rolling
from models.mocap.motion.kinematics import contact_rotations
from sim.body.clip_motion import ClipMotion, clip_motion
from sim.body.drive import drive_unit
from sim.body.falls import UP
from sim.body.figure import CONTACTS, Figure, FigureGains, FigureState
from sim.body.figure_state import REPORT_DOWN, REPORT_FLIES, REPORT_RESIDUAL, REPORT_SIZE
from sim.body.residual import MIN_GROUND_FORCE, Residual, ResidualMeasure
from sim.compilation.compiled import entry_point
from sim.compilation.native import mj_step
from sim.compilation.units import Unit
from sim.errors import SimError

_PREFIX = "figure/"


@dataclass(frozen=True)
class TrackingConfig:
    """Time steps, body and gains of a tracking simulation.

    Parameters
    ----------
    physics_step : float
        Time step of the simulation [s].
    control_steps : int
        Physics steps between two updates of the control.
    stature, mass : float
        Stature [m] and mass [kg] of the figure.
    gains : FigureGains
        Gains of its control.

    Raises
    ------
    SimError
        If the physics step is not within 0 to 5 ms, or the number of control steps not within 1 to 100.
    """

    physics_step: float = 5e-4
    control_steps: int = 4
    stature: float = DEFAULT_STATURE
    mass: float = DEFAULT_MASS
    gains: FigureGains = FigureGains()  # noqa: RUF009 - immutable

    def __post_init__(self) -> None:
        if not 0.0 < self.physics_step <= 5e-3:
            raise SimError(f"physics step is {self.physics_step} s; expected 0 < step ≤ 0.005 s")
        if not 1 <= self.control_steps <= 100:
            raise SimError(f"control every {self.control_steps} physics steps; expected 1 to 100")


class TrackedMotion(NamedTuple):
    """The log of a tracking simulation, one row per control update.

    Attributes
    ----------
    reference : ClipMotion
        The reference motion.
    poses : Array
        Poses of the figure, shape (n, 75).
    reports : Array
        See `sim.body.figure_state.REPORT_SUPPORT` and the indices beside it, shape (n, 10).
    contacts : Array
        Lowest points of the figure's contact spheres in the world, shape (n, 10, 3).
    ground : Array
        Ground reaction force on the figure [N], mean over a control period, shape (n, 3).
    weight, radius, com_height : float
        Weight of the figure [N], radius of its contact spheres [m], height of its centre of mass when it stands [m].
    warnings : int
        Number of MuJoCo's warnings.
    ends : float
        Time from which a clip that is not repeated only holds its last pose [s]; infinite if it is repeated.
    """

    reference: ClipMotion
    poses: Array
    reports: Array
    contacts: Array
    ground: Array
    weight: float
    radius: float
    com_height: float
    warnings: int
    ends: float


@dataclass(frozen=True)
class TrackingReport:
    """Measures of how the physical figure tracked a clip.

    Attributes
    ----------
    seconds, flight_seconds : float
        Duration of the motion, and time that the reference was in flight [s].
    falls : tuple of float
        Times at which the figure fell [s].
    up_seconds : float
        Time that the figure neither lay nor was set back [s]. All that follows is measured over that time; the residual
        of a clip that is not repeated is measured only until its end, as holding the last pose would dilute it.
    joint_error : float
        RMS over joints and time of the angle between a joint and its reference [deg].
    root_error, root_error_max : float
        RMS and largest distance of the root from its reference [m].
    residual_in_flight : float
        Largest component of the residual while the reference flies [N, N m]; zero by construction.
    stance, without_ground_force : Residual
        Residual while the reference is not in flight, and while the ground does not support the figure.
    grounded : float
        Share of the reference's time out of flight in which the ground supports the figure.
    slide : float
        Largest slide of a contact point over the floor, without rolling (`models.mocap.motion.foot_skate`) [m].
    warnings : int
        Number of MuJoCo's warnings.
    """

    seconds: float
    flight_seconds: float
    falls: tuple[float, ...]
    up_seconds: float
    joint_error: float
    root_error: float
    root_error_max: float
    residual_in_flight: float
    stance: Residual
    without_ground_force: Residual
    grounded: float
    slide: float
    warnings: int

    def __str__(self) -> str:
        """One line for people."""
        fell = ", ".join(f"{at:.1f}" for at in self.falls)
        stance, lost = self.stance, self.without_ground_force
        return (
            (f"fell at {fell} s; of {self.up_seconds:.1f} of {self.seconds:.1f} s: " if self.falls else "")
            + f"joints {self.joint_error:.2f}° RMS, root {100 * self.root_error:.1f} cm RMS "
            f"(largest {100 * self.root_error_max:.1f}), {self.flight_seconds:.2f} s of flight, feet on the ground "
            f"{100 * self.grounded:.0f} % of stance; residual in stance, RMS and peak: {stance.brief()} "
            f"({stance.verdict()})"
            + (f"; without ground force, {lost.seconds:.2f} s: {lost.brief()}" if lost.seconds > 0.0 else "")
        )


class _Log(NamedTuple):
    """Output of `_simulate`: the fields of the same names in `TrackedMotion`."""

    poses: Array
    reports: Array
    contacts: Array
    ground: Array


@entry_point
def _simulate(
    drive: int, s: FigureState, control_steps: int, reference: ClipMotion, contact_force: Array, log: _Log
) -> None:
    for k in range(reference.poses.shape[0]):
        log.poses[k] = s.qpos
        call_as_given(drive, (by_pointer(s), reference.poses[k], reference.velocities[k], reference.accelerations[k]))
        for c in range(s.points.shape[0]):
            log.contacts[k, c] = s.contact_pos[s.contact[c]]
            log.contacts[k, c, 2] -= s.radius
        log.reports[k] = s.report
        for _ in range(control_steps):
            mj_step(s.model, s.data)
            log.ground[k] += contact_force / control_steps


def floor_world(config: TrackingConfig) -> mujoco.MjModel:
    """The model of the figure alone on a floor; names have the prefix ``figure/``."""
    spec = mujoco.MjSpec()
    spec.option.timestep = config.physics_step
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    add_floor(spec)
    spec.attach(figure_spec(config.stature, config.mass), prefix=_PREFIX, frame=spec.worldbody.add_frame())
    return spec.compile()


def tracked_motion(
    clip: Clip, seconds: float, config: TrackingConfig, ready: Callable[[tuple[Unit, ...]], None] = lambda units: None
) -> TrackedMotion:
    """Let the physical figure track a clip, starting in the clip's first pose and with its velocity.

    `ready` is called with the units of compiled code, before they are needed.

    Raises
    ------
    SimError
        If `seconds` is not within 0 to an hour.
    """
    if not 0.0 < seconds <= 3600.0:
        raise SimError(f"{seconds} s of tracking; expected more than 0 and at most an hour")
    model = floor_world(config)
    data, period = mujoco.MjData(model), config.physics_step * config.control_steps
    figure = Figure(model, data, figure_model(config.stature, config.mass), _PREFIX, config.gains, period)
    n = max(1, round(seconds / period))
    reference = clip_motion(clip, period * np.arange(n, dtype=np.float64))
    data.qpos[:], data.qvel[:] = reference.poses[0], reference.velocities[0]
    mujoco.mj_forward(model, data)
    log = _Log(np.empty((n, model.nq)), np.empty((n, REPORT_SIZE)), np.empty((n, len(CONTACTS), 3)), np.zeros((n, 3)))
    # The kernel is compiled for contiguous rows, and a call by address does not check the types of its arguments.
    motion = ClipMotion(*map(np.ascontiguousarray, reference))
    arguments: tuple[Any, ...] = (figure.state, config.control_steps, motion, data.qfrc_constraint[:3], log)
    drive = drive_unit(figure.state)
    ready((drive, Unit.of(_simulate, types.int64, *(typeof(argument) for argument in arguments))))
    _simulate(drive.address(), *arguments)
    warnings = int(sum(warning.number for warning in data.warning))
    return TrackedMotion(
        reference, *log, figure.state.weight, figure.state.radius, standing_com(config.stature, config.mass), warnings,
        math.inf if clip.closes(CLOSURE_TOLERANCE) else clip.duration,
    )  # fmt: skip


def track(
    clip: Clip,
    seconds: float,
    config: TrackingConfig | None = None,
    ready: Callable[[tuple[Unit, ...]], None] = lambda units: None,
) -> TrackingReport:
    """Let the physical figure track a clip and return the measures; see `tracked_motion`."""
    return report(tracked_motion(clip, seconds, config or TrackingConfig(), ready))


def report(motion: TrackedMotion) -> TrackingReport:
    """The measures of a tracked motion."""
    times = motion.reference.times
    period = float(times[1] - times[0]) if len(times) > 1 else 0.0
    up = motion.reports[:, REPORT_DOWN] == UP
    falls = times[~up & np.concatenate(([True], up[:-1]))]
    in_flight, is_supported = motion.reports[:, REPORT_FLIES] == 1.0, motion.ground[:, 2] > MIN_GROUND_FORCE
    wrench = motion.reports[:, REPORT_RESIDUAL : REPORT_RESIDUAL + 6]
    joints, root = pose_errors(motion.poses[up], motion.reference.poses[up])

    def residual(rows: Mask) -> Residual:
        measure = ResidualMeasure(motion.weight, motion.com_height, period)
        measure.add(wrench[up & rows & (times <= motion.ends)])
        return measure.summary()

    on_ground, slide = up & ~in_flight, ContactSlide()
    rolled = Rolling(motion.radius).add(contact_rotations(motion.poses, CONTACTS))
    slide.add(motion.contacts - rolled, np.less(motion.contacts[:, :, 2], 0.0) & up[:, None])
    return TrackingReport(
        seconds=period * len(times), flight_seconds=period * float(np.sum(in_flight)), falls=tuple(falls.tolist()),
        up_seconds=period * float(np.sum(up)), joint_error=float(np.rad2deg(rms(joints))), root_error=rms(root),
        root_error_max=float(root.max(initial=0.0)),
        residual_in_flight=float(np.abs(wrench[up & in_flight]).max(initial=0.0)), stance=residual(~in_flight),
        without_ground_force=residual(~is_supported),
        grounded=float(np.mean(is_supported[on_ground])) if on_ground.any() else 1.0,
        slide=slide.largest, warnings=motion.warnings,
    )  # fmt: skip
