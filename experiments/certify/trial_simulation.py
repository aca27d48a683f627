"""Trials of a river's sampled loop in MuJoCo, to validate stability certificates.

The linkage is simulated alone, in the world's axes. Sensing, law and actuation are the servo's functions, in its order.
Unlike the servo, a trial can have torques delayed by whole periods, encoders without quantisation, no Coulomb friction,
or another integrator.
"""

from dataclasses import dataclass, replace
from types import FunctionType
from typing import NamedTuple

import mujoco
import numpy as np
from numba import njit

from controllers.certificates.loop.hand import HandImpedance
from controllers.certificates.loop.laws import FOLLOW_LAW
from controllers.certificates.loop.linear_loop import linearise
from controllers.certificates.loop.sampled_loop import SampledLoop
from controllers.certificates.loop.sampling import Sampling
from controllers.curves.trajectory import Trajectory
from controllers.fields.algebra.law import Program
from controllers.fields.algebra.program import Compiled, evaluate
from controllers.fields.algebra.walker_feed import Walkers, feed_walkers
from controllers.fields.follow import Follow
from controllers.state import HAND_POSITION
from experiments.certify.certified_device import phantom_device
from geometry.arrays import Array
from models.phantom.kinematics import linkage_angles
from models.phantom.spec import LINKAGE_JOINTS, phantom_spec
from models.world.scene import PHANTOM, R_WP
from sim.compilation.compiled import entry_point
from sim.errors import SimError
from sim.users.hand.arm import Arm
from sim.world.phantom_port import PhantomPort, actuate, phantom_port, sense, sensed_before
from sim.world.plant import Hand, Plant, advance, make_hand
from sim.world.world import phantom_angles

LAP_DURATION = 1e6  # [s] duration of a lap, so slow that a trial stays at one configuration
INITIAL_DISTANCE = 1e-6  # [m] distance from the curve at which a trial starts
_MAX_DISTANCE = 0.05  # [m] distance from its start at which a trial ends


@njit
def _exact_reading(theta: tuple[float, float, float]) -> tuple[float, float, float]:
    return theta


# The servo's sensing without quantisation: the same source, with `encoder_reading` bound to another function.
_sense_exactly = njit(
    FunctionType(sense.py_func.__code__, sense.py_func.__globals__ | {"encoder_reading": _exact_reading})
)


class Executed(NamedTuple):
    """A field in execution: its program, its memory, and the walkers that its laws read."""

    program: Compiled
    memory: Array
    walkers: Walkers


@entry_point
def run_delayed(
    plant: Plant, port: PhantomPort, hand: Hand, field: Executed, late: Array, rounded: bool, path: Array
) -> None:
    """The servo's loop with one device, without limiter and figure, with torques delayed by whole periods.

    Parameters
    ----------
    plant, port, hand
        As in the servo.
    field : Executed
        The field and its state.
    late : Array
        Delayed torques, the next to act first, shape (m, 3) [N m]; m is the delay in periods.
    rounded : bool
        Whether encoders quantise.
    path : Array
        Output: the measured position of the hand at each tick, shape (n, 3) [m]; NaN once it is more than 5 cm off.
    """
    path[:] = np.nan
    wrench, applied = np.zeros(6), np.zeros((plant.substeps, 3))
    for k in range(path.shape[0]):
        t = k * plant.period
        if rounded:
            sense(port, t, 0.0)
        else:
            _sense_exactly(port, t, 0.0)
        feed_walkers(field.walkers, field.program.params, field.memory, port.hand)
        evaluate(field.program.units, field.program.ops, field.program.params, field.memory, port.hand, wrench)
        actuate(port, wrench[:3])
        for i in range(3):
            if late.shape[0] > 0:
                slot = k % late.shape[0]
                port.ctrl[port.motor[i]] = late[slot, i]
                late[slot, i] = port.torque[i]
            path[k, i] = port.hand[HAND_POSITION + i]
        if np.sum((path[k] - path[0]) ** 2) > _MAX_DISTANCE**2:
            break
        advance(plant, port, hand, t, False, applied)


@dataclass(frozen=True)
class LoopTrial:
    """A randomly drawn trial.

    Attributes
    ----------
    curve : Trajectory
        A circle in the workspace, traversed so slowly that its point is practically at rest.
    phase : float
        Phase on it [s].
    b_d : float
        Damping [N s/m].
    sampling : Sampling
        The clock; its delay is a whole number of periods.
    hand : HandImpedance
        The hand on the stylus.
    direction : Array
        Direction of the initial displacement, across the curve, shape (3,).
    """

    curve: Trajectory
    phase: float
    b_d: float
    sampling: Sampling
    hand: HandImpedance
    direction: Array

    def loop(self) -> SampledLoop:
        """The linearised loop at the trial's place."""
        linear = linearise(phantom_device(), FOLLOW_LAW, self.curve, np.array([self.phase]), self.hand)
        return SampledLoop(linear, self.sampling)

    def program(self, k_r: float) -> Program:
        """The field that is simulated: FOLLOW with k_r [N/m]."""
        return Follow(self.curve, k_r, self.b_d, np.inf).program()

    def user(self, k_r: float) -> Arm:
        """The simulated hand, which is held at the trial's place if it has stiffness or damping."""
        held = self.hand.damping > 0.0 or self.hand.stiffness > 0.0
        path = self.curve.point(self.phase)[None] if held else np.zeros((0, 3))
        return Arm(self.hand.stiffness, self.hand.damping, path)


def draw_trial(rng: np.random.Generator) -> LoopTrial:
    """A random trial: curve, phase, clock, hand, and a damping of 5 to 70 % of the largest stable one."""
    while True:
        radius, centre = rng.uniform(0.02, 0.06), rng.uniform([-0.06, -0.08, -0.06], [0.06, 0.08, 0.1])
        axes = np.linalg.qr(rng.normal(size=(3, 3)))[0][:, :2]
        angle = np.linspace(0.0, 2.0 * np.pi, 97)
        points = centre + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1) @ axes.T
        points[-1] = points[0]
        curve = Trajectory(LAP_DURATION * angle / (2.0 * np.pi), points, periodic=True)
        period = float(0.25e-3 * 16.0 ** rng.uniform())
        sampling = Sampling(period, float(rng.integers(4)) * period, float(rng.uniform(80.0, 250.0)))
        hand = HandImpedance()
        if rng.uniform() < 0.7:
            stiffness = float(rng.uniform(50.0, 500.0)) if rng.uniform() < 0.5 else 0.0
            hand = HandImpedance(float(rng.uniform(0.0, 0.3)), float(rng.uniform(0.5, 8.0)), stiffness)
        try:
            for point in curve.point(np.linspace(0.0, LAP_DURATION, 24)):
                phantom_angles(point)
        except SimError:  # out of the workspace: draw another one
            continue
        phase = float(rng.uniform(0.0, LAP_DURATION))
        tangent = curve.velocity(phase) / np.linalg.norm(curve.velocity(phase))
        sideways = rng.normal(size=3)
        sideways -= tangent * (tangent @ sideways)
        trial = LoopTrial(curve, phase, 0.0, sampling, hand, sideways / np.linalg.norm(sideways))
        return replace(trial, b_d=float(rng.uniform(0.05, 0.7)) * _max_stable_damping(trial.loop()))


def _max_stable_damping(loop: SampledLoop) -> float:
    """Largest stable b_d [N s/m] at a stiffness of 1 N/m, of 60 values."""
    gains = np.geomspace(0.05, 500.0, 60)
    stable = [bool(loop.radius(1.0, b)[0] < 1.0) for b in gains]
    first = int(np.argmin(stable)) if not all(stable) else len(gains) - 1
    return float(gains[max(0, first - 1)])


def trial_model(hand: HandImpedance, step: float, coulomb: bool, integrator: mujoco.mjtIntegrator) -> mujoco.MjModel:
    """The Phantom alone in the world's axes, with the hand's mass, gravity-compensated, at its tip."""
    spec = mujoco.MjSpec()
    spec.option.timestep = step
    spec.option.integrator = integrator
    spec.option.tolerance = 1e-14
    device = phantom_spec()
    stylus = device.body("stylus")
    stylus.mass, stylus.gravcomp = stylus.mass + hand.mass, 1.0
    if not coulomb:
        for joint in device.joints:
            joint.frictionloss = 0.0
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, R_WP.ravel())
    spec.attach(device, prefix=PHANTOM, frame=spec.worldbody.add_frame(quat=quaternion.tolist()))
    return spec.compile()


@dataclass(frozen=True)
class Conditions:
    """Effects modelled beyond the linear loop, and the time step.

    Attributes
    ----------
    substeps : int
        Physics steps per servo period.
    integrator : mujoco.mjtIntegrator
        Runge–Kutta by default. The world's own is of first order: it leads by half a step, which stabilises.
    rounded : bool
        Whether encoders quantise.
    coulomb : bool
        Whether Coulomb friction acts.
    start : float
        Initial distance from the curve [m].
    """

    substeps: int = 32
    integrator: mujoco.mjtIntegrator = mujoco.mjtIntegrator.mjINT_RK4
    rounded: bool = False
    coulomb: bool = False
    start: float = INITIAL_DISTANCE


FULL_CONDITIONS = Conditions(8, mujoco.mjtIntegrator.mjINT_IMPLICITFAST, rounded=True, coulomb=True)
"""The conditions of a run: the world's own integrator, quantised encoders and Coulomb friction."""


def simulate(trial: LoopTrial, k_r: float, ticks: int, conditions: Conditions, state: Array | None = None) -> Array:
    """Displacement across the curve from the trial's place at each tick [m], shape (n, 3); see `hand_path`."""
    tangent = trial.curve.velocity(trial.phase) / np.linalg.norm(trial.curve.velocity(trial.phase))
    displacement = hand_path(trial, k_r, ticks, conditions, state) - trial.curve.point(trial.phase)
    return displacement - np.outer(displacement @ tangent, tangent)


def hand_path(
    trial: LoopTrial,
    k_r: float,
    ticks: int,
    conditions: Conditions,
    state: Array | None = None,
    user: Arm | None = None,
) -> Array:
    """Position of the hand in H at each tick [m], shape (n, 3), n ≤ ticks, after a release beside the curve.

    Parameters
    ----------
    trial, conditions
        The trial and its conditions.
    k_r : float
        Stiffness of FOLLOW [N/m].
    ticks : int
        Largest number of ticks; fewer are returned if the hand gets 5 cm off.
    state : Array, optional
        Initial state ξ of the linear loop; by default at rest, `conditions.start` off in the trial's direction.
    user : Arm, optional
        The hand; by default the trial's own.
    """
    sampling, period = trial.sampling, trial.sampling.period
    model = trial_model(trial.hand, period / conditions.substeps, conditions.coulomb, conditions.integrator)
    data = mujoco.MjData(model)
    centre = trial.curve.point(trial.phase)
    port = phantom_port(model, data, period, sampling.cutoff)
    late = np.zeros((sampling.whole_delay, 3))
    if state is None:
        theta, rate = np.array(phantom_angles(centre + conditions.start * trial.direction)), np.zeros(3)
    else:
        rest_angles = np.array(phantom_angles(centre))
        theta, rate = rest_angles + state[:3], state[3:6]
        sensed_before(port, rest_angles + state[6:9], state[9:12])
        late += state[12:].reshape(-1, 3)[::-1]
    late += np.array(phantom_device().gravity(theta if state is None else theta - state[:3]))
    names = [PHANTOM + name for name in LINKAGE_JOINTS]
    angles, rates = linkage_angles.py_func(theta), linkage_angles.py_func(rate)
    for name, angle, speed in zip(names, angles, rates, strict=True):
        data.joint(name).qpos[0], data.joint(name).qvel[0] = angle, speed
    mujoco.mj_forward(model, data)
    plant = Plant(
        model=model._address, data=data._address, qpos=data.qpos, ctrl=data.ctrl, applied=data.qfrc_applied,
        ground=np.zeros(3), arm_v=port.arm_v, substeps=conditions.substeps, period=period,
    )  # fmt: skip
    hand, program = make_hand(user or trial.user(k_r)), trial.program(k_r)
    path = np.zeros((ticks, 3))
    field = Executed(program.compiled(), program.fresh_memory(), program.fresh_walkers())
    run_delayed(plant, port, hand, field, late, conditions.rounded, path)
    return path[np.isfinite(path[:, 0])]
