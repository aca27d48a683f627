"""Quality measures of a clip: soles, foot skate, continuity, joint ranges and dynamics, with their bounds.

The bounds are those of `bounds`; `WellFormed.faults` names the measures that exceed them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geometry import quaternions
from geometry.arrays import Array, Mask, rms
from geometry.physics import GRAVITY
from models.humanoid.skeleton import BODIES, CONTACT_RADIUS, FOOT_CONTACTS, JOINTS
from models.mocap.dynamics.momentum import momentum
from models.mocap.motion.clip import CLOSURE_TOLERANCE, Clip, pose_difference
from models.mocap.motion.kinematics import global_rotations
from models.mocap.motion.ranges import beyond_ranges
from models.mocap.preparation.bounds import (
    MAX_END_SPEED,
    MAX_FLIGHT_ACCELERATION_ERROR,
    MAX_LIMIT_EXCESS,
    MAX_RESIDUAL,
    MAX_RESIDUAL_IN_FLIGHTS,
    MAX_SEAM_VELOCITY_JUMP,
    MAX_SKATE,
    MAX_SOLE_DEPTH,
    MAX_SOLE_HEIGHT,
    MAX_SOLE_TILT,
    MIN_SOLE_HEIGHT,
    exceeding_text,
)
from models.mocap.preparation.contact_loads import ContactForces, contact_forces
from models.mocap.preparation.poses import extend_periodically, resampled, smoothed
from models.mocap.preparation.skate import MAX_REST_SPEED, loaded_slide, moving_points, skates
from models.mocap.preparation.stances import stances

# Half or twice either value finds the same outliers in the nine embedded clips and 17 captures.
_OUTLIER_RATIO = 8.0  # of an outlier's acceleration to the median of the half second around: steps of walkers reach 4
_MIN_OUTLIER_ACCELERATION = 200.0  # least RMS acceleration of an outlier over the joints [rad/s²]: a kick has 60


@dataclass(frozen=True)
class WellFormed:
    """Measures of a clip.

    Attributes
    ----------
    seconds : float
        Duration [s].
    lowest, highest : float
        Heights of the soles' contact points in stance, 1st and 99th percentile [m].
    depth : float
        Largest depth of the soles below the floor, in stance or not [m].
    tilt : float
        Tilt of soles whose heel and toes are at rest, 95th percentile [rad].
    skate : float
        Foot skate (`models.mocap.preparation.skate`), hands included, 95th percentile over stances, or that of feet
        which slide under load where it is larger [m].
    slid : float
        The same, largest over all stances [m].
    outliers : int
        Number of frames with outlying acceleration.
    closed : bool
        Whether the first pose follows the last one.
    seam : float
        RMS over the joints of the difference of the ends' velocities if closed, else of the larger velocity [rad/s].
    flights : int
        Number of flights.
    flight_error : float
        RMS difference of the centre of mass' acceleration from gravity in flights [m/s²].
    excess : float
        Largest excess of a joint over its range [rad].
    bent : str
        The joint with this excess.
    residual : float
        RMS of the force that contact cannot provide, by inverse dynamics of the clip [body weights].
    strain : float
        Largest torque of a joint by inverse dynamics, as a fraction of its limit.
    joint : str
        The joint with this torque.
    """

    seconds: float
    lowest: float
    highest: float
    depth: float
    tilt: float
    skate: float
    slid: float
    outliers: int
    closed: bool
    seam: float
    flights: int
    flight_error: float
    excess: float
    bent: str
    residual: float
    strain: float
    joint: str

    def faults(self) -> tuple[str, ...]:
        """Measures that exceed their bounds, a line each: forces first, then what can be seen, then limits."""
        most = MAX_RESIDUAL_IN_FLIGHTS if self.flights else MAX_RESIDUAL
        off = max(MIN_SOLE_HEIGHT - self.lowest, self.highest - MAX_SOLE_HEIGHT)
        excess = np.rad2deg(self.excess)
        stand = f"{1000 * self.lowest:.1f} to {1000 * self.highest:.1f} mm"
        rows = (
            (100 * self.residual, 100 * most, "contact leaves a residual of {} % of weight RMS; {:g} % at most"),
            (self.flight_error, MAX_FLIGHT_ACCELERATION_ERROR, "flights differ from gravity by {} m/s²; {:g} at most"),
            (1000 * self.skate, 1000 * MAX_SKATE, "feet skate by {} mm in a stance; {:g} at most"),
            (1000 * self.depth, 1000 * MAX_SOLE_DEPTH, "a sole goes {} mm below the floor; {:g} at most"),
            (off, 0.0, f"soles stand at {stand}; {1000 * MIN_SOLE_HEIGHT:.0f} to {1000 * MAX_SOLE_HEIGHT:.0f}"),
            (np.rad2deg(self.tilt), np.rad2deg(MAX_SOLE_TILT), "soles are tilted by {}°; {:g}° at most"),
            (self.outliers, 0, f"{self.outliers} frames are outliers in acceleration; 0 at most"),
            (self.seam, MAX_SEAM_VELOCITY_JUMP, "velocities at the seam differ by {} rad/s; {:g} at most")
            if self.closed else (self.seam, MAX_END_SPEED, "an end moves with {} rad/s; rest at both, {:g} at most"),
            (excess, np.rad2deg(MAX_LIMIT_EXCESS), f"{self.bent} is {{}}° beyond its range; {{:g}}° at most"),
            (100 * self.strain, 100, f"{self.joint} needs {{}} % of its torque limit; {{:g}} % at most"),
        )  # fmt: skip
        found = [text.format(exceeding_text(value, bound), bound) for value, bound, text in rows if value > bound]
        return tuple(found)

    def lines(self) -> tuple[str, ...]:
        """The measures, a line each."""
        return (
            f"soles in stance {1000 * self.lowest:.0f} to {1000 * self.highest:.0f} mm, at most "
            f"{1000 * self.depth:.0f} mm below the floor at any time, tilted by "
            f"{np.rad2deg(self.tilt):.1f}°, skate {1000 * self.skate:.0f} mm "
            f"({1000 * self.slid:.0f} in the worst stance)",
            f"{'closed' if self.closed else 'open'}, {self.seconds:.2f} s, velocities at the "
            f"{'seam differ by' if self.closed else 'ends'} {self.seam:.2f} rad/s",
            f"{self.outliers} outlier frames; joints {np.rad2deg(max(self.excess, 0.0)):.1f}° beyond their range",
            f"{self.flights} flight{'' if self.flights == 1 else 's'}, {self.flight_error:.1f} m/s² from gravity; "
            "contact leaves a residual of "
            f"{100 * self.residual:.1f} % of weight; {self.joint} needs {100 * self.strain:.0f} % of its torque limit",
        )


def well_formed(clip: Clip, flights: Sequence[tuple[float, float]]) -> WellFormed:
    """Measure a clip.

    Parameters
    ----------
    clip : Clip
        A motion on the floor.
    flights : sequence of (float, float)
        Time of the last contact before each flight and of the first one after it [s]; the latter is in the next lap if
        a closed clip is in flight at its seam.
    """
    clip = resampled(clip, 120.0) if clip.n_frames > 2 else clip
    closed = clip.closes(CLOSURE_TOLERANCE)
    schedule = stances(clip, smoothed(clip))
    points, speeds = moving_points(clip, schedule)
    heights = points[:, :, 2] - CONTACT_RADIUS
    standing = schedule.standing & (speeds < MAX_REST_SPEED)
    soles = standing[:, : len(FOOT_CONTACTS)]
    low, high = np.quantile(heights[:, : len(FOOT_CONTACTS)][soles], (0.01, 0.99)) if soles.any() else (0.0, 0.0)
    depth = max(0.0, -float(heights[:, : len(FOOT_CONTACTS)].min()))
    forces = (
        contact_forces(clip, schedule)
        if clip.n_frames > 8
        else ContactForces(0.0, np.zeros_like(heights), 0.0, JOINTS[0])
    )
    excess = beyond_ranges(clip.poses).max(axis=0)
    found, slide = skates(clip, schedule, forces.loads), loaded_slide(clip, schedule, forces.loads)
    return WellFormed(
        clip.duration, float(low), float(high), depth, _sole_tilt(clip, soles),
        max(float(np.quantile(found, 0.95)), slide), max(float(found.max()), slide), outliers(clip), closed,
        _seam_velocity(clip, closed), len(flights), _gravity_deviation(clip, flights),
        float(excess.max()), JOINTS[int(excess.argmax())],
        forces.residual, forces.strain, forces.joint,
    )  # fmt: skip


def outliers(clip: Clip) -> int:
    """Number of frames with a joint acceleration far above the median of the half second around them."""
    if clip.n_frames < 8:
        return 0
    poses = extend_periodically(clip, 2)[0] if clip.closes(CLOSURE_TOLERANCE) else clip.poses
    steps = pose_difference(poses[:-1], poses[1:])[:, 3:]
    accelerations = np.sqrt(np.mean((np.diff(steps, axis=0) * clip.fps**2) ** 2, axis=1))
    width = max(3, round(clip.fps / 4.0))
    medians = np.array([np.median(accelerations[max(0, k - width) : k + width]) for k in range(len(accelerations))])
    return int(np.sum((accelerations > _OUTLIER_RATIO * medians) & (accelerations > _MIN_OUTLIER_ACCELERATION)))


def _sole_tilt(clip: Clip, resting: Mask) -> float:
    angles: list[Array] = []
    rotations = global_rotations(clip.poses)
    for foot, side in enumerate(("left", "right")):
        flat = resting[:, 4 * foot : 4 * foot + 4].all(axis=1)
        up = quaternions.rotated(rotations[flat, BODIES.index(f"{side}_foot")], np.array([0.0, 0.0, 1.0]))
        angles.append(np.arccos(np.clip(up[:, 2], -1.0, 1.0)))
    all_angles = np.concatenate(angles)
    return float(np.quantile(all_angles, 0.95)) if len(all_angles) else 0.0


def _seam_velocity(clip: Clip, closed: bool) -> float:
    if not closed or clip.n_frames < 3:
        return clip.end_speed()
    first, last = pose_difference(clip.poses[[0, -2]], clip.poses[[1, -1]])[:, 6:] * clip.fps
    return rms(first - last)


def _gravity_deviation(clip: Clip, flights: Sequence[tuple[float, float]]) -> float:
    if not flights:
        return 0.0
    com = momentum(clip.with_next_lap() if flights[-1][1] > clip.duration else clip).com
    squares: list[float] = []
    for start, end in flights:
        flight = com[round(start * clip.fps) + 1 : round(end * clip.fps)]
        if len(flight) < 4:
            continue
        # A parabola's leading coefficient is half the acceleration, without the noise of second differences.
        acceleration = 2.0 * np.polyfit(np.arange(len(flight)) / clip.fps, flight, 2)[0]
        squares.append(float(np.sum((acceleration + np.array([0.0, 0.0, GRAVITY])) ** 2)))
    return float(np.sqrt(np.mean(squares))) if squares else 0.0
