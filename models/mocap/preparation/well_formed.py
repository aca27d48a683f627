"""How well-formed a clip is: what its users rely on, measured and reported.

The bounds are those of DESIGN 4.12; `WellFormed.faults` names what is not within them.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from models.arrays import Array
from models.humanoid.skeleton import BODIES, CONTACT_RADIUS
from models.mocap import quaternions
from models.mocap.clip import Clip, global_rotations, pose_difference
from models.mocap.dynamics.contacts import contacts
from models.mocap.dynamics.momentum import momentum
from models.mocap.preparation.feasible import contact_residual
from models.mocap.preparation.poses import around, resampled, smoothed, sole_points
from models.mocap.preparation.stances import stances
from models.mocap.ranges import beyond_ranges

LOWEST, HIGHEST = -0.003, 0.005  # of soles in stance [m]
FLATTEST = np.deg2rad(2.0)
SKATE = 0.005  # [m]
RESIDUAL, FLYING = 0.05, 0.12  # body weights RMS, of gaits and gestures, and of what leaves the floor
GAP, SEAM = 1e-3, 0.3  # of a closed clip's ends [rad, m], and of their velocities [rad/s, m/s]
REST = 0.3  # of an open clip's ends [rad/s] RMS
LIMIT = np.deg2rad(1.0)  # beyond a joint's range: what an Euler angle and a rotation vector differ by near limits
FLIGHT = 1.5  # RMS of the centre of mass' acceleration beside gravity in flight [m/s²]
_STANDS_OUT = 8.0  # times the median acceleration of half a second around: steps of walkers reach 4
_JERKY = 200.0  # [rad/s²] RMS over the joints, below which nothing stands out: a kick has 60
_AT_REST = 0.2  # [m/s], above which a part of a sole rolls on or off and is not at the floor
_ON_FLOOR = 0.015  # [m]: what is higher does not rub
_SHORT_FLIGHT = 0.08  # [s]
_GRAVITY = 9.81


@dataclass(frozen=True)
class WellFormed:
    """Measures of a clip.

    Attributes
    ----------
    seconds : float
        How long it lasts [s].
    lowest, highest : float
        Of the soles' contact points in stance over the floor, 1st and 99th percentile [m].
    tilt : float
        Of soles whose heel and toes are at rest, 95th percentile [rad].
    skate : float
        Furthest that a contact point moves over the floor in one stance, 95th percentile over stances [m].
    outliers : int
        Frames whose acceleration stands out.
    closed : bool
        Whether it goes on from its last pose with its first one.
    seam : float
        Difference of the ends' velocities where it is closed, else the larger of them [rad/s] RMS over the joints.
    flights : int
        How often nothing touches the floor for more than 0.08 s.
    falling : float
        RMS of the centre of mass' acceleration beside gravity in flights [m/s²].
    excess : float
        Furthest that a joint is beyond its range [rad].
    residual : float
        RMS of the force that contact cannot give, by inverse dynamics of the clip [body weights].
    """

    seconds: float
    lowest: float
    highest: float
    tilt: float
    skate: float
    outliers: int
    closed: bool
    seam: float
    flights: int
    falling: float
    excess: float
    residual: float

    def faults(self) -> tuple[str, ...]:
        """What is not within bounds, a line each."""
        found: list[str] = []
        if self.lowest < LOWEST or self.highest > HIGHEST:
            found.append(f"soles stand at {100 * self.lowest:.1f} to {100 * self.highest:.1f} cm; −0.3 to 0.5")
        if self.tilt > FLATTEST:
            found.append(f"soles are tilted by {np.rad2deg(self.tilt):.1f}°; 2° at most")
        if self.skate > SKATE:
            found.append(f"feet skate by {100 * self.skate:.1f} cm in a stance; 0.5 at most")
        if self.outliers:
            found.append(f"{self.outliers} frames stand out by their acceleration; none")
        if self.closed and self.seam > SEAM:
            found.append(f"velocities at the seam differ by {self.seam:.2f} rad/s; {SEAM} at most")
        if not self.closed and self.seam > REST:
            found.append(f"an end moves with {self.seam:.2f} rad/s; rest at both, {REST} at most")
        if self.falling > FLIGHT:
            found.append(f"flights fall with {self.falling:.1f} m/s² beside gravity; {FLIGHT} at most")
        if self.excess > LIMIT:
            found.append(f"a joint is {np.rad2deg(self.excess):.0f}° beyond its range; 1° at most")
        if self.residual > (bound := FLYING if self.flights else RESIDUAL):
            found.append(f"contact lacks {100 * self.residual:.0f} % of weight RMS; {100 * bound:.0f} % at most")
        return tuple(found)

    def lines(self) -> tuple[str, ...]:
        """The measures, a line each."""
        return (
            f"soles in stance {1000 * self.lowest:.0f} to {1000 * self.highest:.0f} mm, tilted by "
            f"{np.rad2deg(self.tilt):.1f}°, skate {1000 * self.skate:.0f} mm",
            f"{'closed' if self.closed else 'open'}, {self.seconds:.2f} s, velocities at the "
            f"{'seam differ by' if self.closed else 'ends'} {self.seam:.2f} rad/s",
            f"{self.outliers} frames stand out; joints {np.rad2deg(max(self.excess, 0.0)):.1f}° beyond their range",
            f"{self.flights} flights, {self.falling:.1f} m/s² beside gravity; contact lacks "
            f"{100 * self.residual:.1f} % of weight",
        )


def well_formed(clip: Clip) -> WellFormed:
    """Measure a clip."""
    clip = resampled(clip, 120.0) if clip.n_frames > 2 else clip
    closed = clip.closes(GAP)
    schedule = stances(clip, smoothed(clip, 8.0))
    points = sole_points(clip.poses)
    heights = points[:, :, 2] - CONTACT_RADIUS
    speeds = np.linalg.norm(np.gradient(points, axis=0), axis=2) * clip.fps if clip.n_frames > 1 else 0.0 * heights
    standing = schedule.standing & (speeds < _AT_REST)
    low, high = np.quantile(heights[standing], (0.01, 0.99)) if standing.any() else (0.0, 0.0)
    skate = _skate(points, schedule.standing & (heights < _ON_FLOOR))
    flights, falling = _flights(clip)
    return WellFormed(
        clip.duration, float(low), float(high), _tilt(clip, standing), skate, outliers(clip), closed,
        _seam(clip, closed), flights, falling,
        float(beyond_ranges(clip.poses).max()),
        contact_residual(clip, schedule) if clip.n_frames > 8 else 0.0,
    )  # fmt: skip


def outliers(clip: Clip) -> int:
    """How many frames stand out by their joints' acceleration from the half second around them."""
    if clip.n_frames < 8:
        return 0
    poses = around(clip, 2)[0] if clip.closes(GAP) else clip.poses
    steps = pose_difference(poses[:-1], poses[1:])[:, 3:]
    accelerations = np.sqrt(np.mean((np.diff(steps, axis=0) * clip.fps**2) ** 2, axis=1))
    width = max(3, round(clip.fps / 4.0))
    usual = np.array([np.median(accelerations[max(0, k - width) : k + width]) for k in range(len(accelerations))])
    return int(np.sum((accelerations > _STANDS_OUT * usual) & (accelerations > _JERKY)))


def _tilt(clip: Clip, resting: npt.NDArray[np.bool_]) -> float:
    angles: list[Array] = []
    turned = global_rotations(clip.poses)
    for foot, side in enumerate(("left", "right")):
        flat = resting[:, 4 * foot : 4 * foot + 4].all(axis=1)
        up = quaternions.rotated(turned[flat, BODIES.index(f"{side}_foot")], np.array([0.0, 0.0, 1.0]))
        angles.append(np.arccos(np.clip(up[:, 2], -1.0, 1.0)))
    every = np.concatenate(angles)
    return float(np.quantile(every, 0.95)) if len(every) else 0.0


def _skate(points: Array, standing: npt.NDArray[np.bool_]) -> float:
    """Travel of every contact point from the middle of each of its stances."""
    travels: list[float] = []
    for sphere in range(points.shape[1]):
        mask = standing[:, sphere].astype(int)
        edges = np.flatnonzero(np.diff(np.concatenate(([0], mask, [0]))))
        for start, end in zip(edges[::2], edges[1::2], strict=True):
            stand = points[start:end, sphere, :2]
            travels.append(float(np.linalg.norm(stand - np.median(stand, axis=0), axis=1).max()))
    return float(np.quantile(travels, 0.95)) if travels else 0.0


def _seam(clip: Clip, closed: bool) -> float:
    if clip.n_frames < 3:
        return 0.0
    steps = pose_difference(clip.poses[:-1], clip.poses[1:])[:, 6:] * clip.fps
    first, last = steps[0], steps[-1]
    if closed:
        return float(np.sqrt(np.mean((first - last) ** 2)))
    return float(max(np.sqrt(np.mean(first**2)), np.sqrt(np.mean(last**2))))


def _flights(clip: Clip) -> tuple[int, float]:
    if clip.n_frames < 5:
        return 0, 0.0
    flying = ~contacts(clip).supported
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flying.astype(int), [0]))))
    spans = [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a > _SHORT_FLIGHT * clip.fps]
    if not spans:
        return 0, 0.0
    com = momentum(clip).com
    squares: list[float] = []
    for start, end in spans:
        times = np.arange(end - start) / clip.fps
        if len(times) < 4:
            continue
        # A parabola's leading coefficient is half the acceleration, without the noise of second differences.
        acceleration = 2.0 * np.polyfit(times, com[start:end], 2)[0]
        squares.append(float(np.sum((acceleration + np.array([0.0, 0.0, _GRAVITY])) ** 2)))
    return len(spans), float(np.sqrt(np.mean(squares))) if squares else 0.0
