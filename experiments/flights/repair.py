"""``hvf repair``: the motion nearest to a clip whose flights are ballistic."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import maximum_filter1d, uniform_filter1d
from scipy.optimize import root
from scipy.spatial.transform import Rotation

from controllers.certificates.flight.repair import RepairPlan, RepairTask, repair
from experiments.flights.ballistics import ClipBallistics, clip_ballistics
from geometry import quaternions
from geometry.arrays import Array, Mask
from geometry.physics import GRAVITY
from models.mocap.dynamics.contacts import contacts
from models.mocap.dynamics.momentum import Momentum, momentum
from models.mocap.dynamics.moved_legs import displaced_with_planted_feet, hip_to_ankle
from models.mocap.library import check_target, load_clip, writing
from models.mocap.motion.clip import Clip
from models.mocap.readers.own_bvh import write_bvh
from sim.body.clip_motion import clip_motion

N_ITERATIONS = 4  # momentum by finite differences also depends on the rotations of neighbouring frames


def with_constant_momentum(clip: Clip, flights: list[tuple[int, int]]) -> Clip:
    """The clip with constant angular momentum in flights (first frame, last frame), and unchanged centres of mass.

    A flight for which there is no solution is left as it is.
    """
    poses = clip.poses.copy()
    for _ in range(N_ITERATIONS):
        dynamics = momentum(Clip(poses, clip.fps, clip.name))
        for start, end in flights:
            rotations = _flight_rotations(dynamics, start, end, 1.0 / clip.fps)
            if rotations is not None:
                span, q = slice(start, end + 1), rotations.as_quat(scalar_first=True)
                com = dynamics.com[span]
                poses[span, :3] = com + quaternions.rotated(q, poses[span, :3] - com)
                poses[span, 3:7] = quaternions.product(q, poses[span, 3:7])
    return Clip(poses, clip.fps, clip.name)


def _flight_rotations(dynamics: Momentum, start: int, end: int, step: float) -> Rotation | None:
    """R of each frame of a flight; None if no momentum gives R = 1 at the last frame."""
    # Momentum and inertia at the midpoints between frames.
    angular = 0.5 * (dynamics.angular[start:end] + dynamics.angular[start + 1 : end + 1])
    angular[0], angular[-1] = dynamics.angular[start + 1], dynamics.angular[end - 1]
    inertia = 0.5 * (dynamics.inertia[start:end] + dynamics.inertia[start + 1 : end + 1])

    def rotations_for(mean: Array) -> list[Rotation]:
        R = [Rotation.identity()]
        for frame_angular, frame_inertia in zip(angular, inertia, strict=True):
            missing = R[-1].inv().apply(mean) - frame_angular
            R.append(R[-1] * Rotation.from_rotvec(np.linalg.solve(frame_inertia, missing) * step))
        return R

    def landing_rotation(mean: Array) -> Array:
        return rotations_for(mean)[-1].as_rotvec()

    found = root(landing_rotation, angular.mean(axis=0), tol=1e-10)
    return Rotation.concatenate(rotations_for(np.asarray(found.x))) if found.success else None


_CHANGE_MARGIN = 1.0  # time before the first refuted flight and after the last one that may be changed [s]
_PENETRATION_TOLERANCE = 0.01  # floor penetration of captures that is tolerated [m]
_LIFT_FILTER_HALF_WIDTH = 0.1  # half width of the filter that smooths a lift in time [s]
_RELEASE_TIME = 0.1  # time in which a foot that leaves the floor takes on the displacement of the body [s]


class Repaired(NamedTuple):
    """A clip before and after its repair.

    Attributes
    ----------
    clip : Clip
        The repaired clip; the given one if nothing had to be repaired.
    before, after : ClipBallistics
        Ballistics of the given and of the repaired clip.
    plan : RepairPlan or None
        Changes of timing and position; None if no flight was changed.
    """

    clip: Clip
    before: ClipBallistics
    after: ClipBallistics
    plan: RepairPlan | None

    def lines(self) -> tuple[str, ...]:
        """Report of the repair, a line each."""
        verdicts = [b.certificate.verdicts["ballistic"] for b in (self.before, self.after)]
        if self.plan is None and self.before is self.after:
            return (f"nothing to repair: {verdicts[0].verdict}; {verdicts[0].reason}",)
        lines = (
            f"before: {verdicts[0].verdict}; {verdicts[0].reason}",
            f"after: {verdicts[1].verdict}; {verdicts[1].reason}",
        )
        if self.plan is None:
            return (*lines, "lifted out of the floor; no flight had to be changed")
        longest = 100.0 * float(np.linalg.norm(self.plan.shift, axis=1).max())
        return (
            *lines,
            f"lasts {self.clip.duration:.2f} s instead of {self.before.seconds:.2f} s; "
            f"the body moves by up to {longest:.1f} cm; {self.plan.iterations} iterations",
        )


def repair_file(source: Path, target: Path, overwrite: bool = False) -> Repaired:
    """Repair the flights of the motion in a file and write it as BVH on the figure.

    Raises
    ------
    MotionFileError
        If the source cannot be read.
    RepairError
        If there is no feasible motion near it.
    ModelError
        If the target is not a .bvh, cannot be written, or exists and is not to be overwritten.
    """
    check_target(target, overwrite)
    repaired = repair_clip(load_clip(source))
    with writing(target):
        write_bvh(repaired.clip, target)
    return repaired


def repair_clip(clip: Clip) -> Repaired:
    """The nearest motion above the floor with the same contacts whose flights conserve momentum under gravity.

    A clip without refuted flights that is nowhere below the floor is returned unchanged.

    Raises
    ------
    RepairError
        If there is no feasible motion near it.
    """
    before, lifted = clip_ballistics(clip), over_the_floor(clip)
    n, closed = clip.n_frames, clip.closes()
    current, clip = before if lifted is clip else clip_ballistics(lifted), lifted
    spans = [(f.fit.start, f.fit.end) for f in current.flights if f.verdict != "unknown" and f.fit.end < n]
    refuted = [f.fit for f in current.flights if f.verdict == "refuted" and f.fit.end < n]
    if not refuted:
        return Repaired(clip, before, current, None)
    margin = round(_CHANGE_MARGIN * clip.fps)
    first = max(0, min(fit.start for fit in refuted) - margin)
    last = min(n - 1, max(fit.end for fit in refuted) + margin)
    window_flights = [(a, b) for a, b in spans if b > first and a < last]
    first, last = min([first, *(a for a, _ in window_flights)]), max([last, *(b for _, b in window_flights)])
    window = slice(first, last + 1)
    dynamics, floor = momentum(clip), contacts(clip)
    lines, leg = hip_to_ankle(clip.poses)
    plan = repair(
        RepairTask(
            fps=clip.fps, com=dynamics.com[window], angular=dynamics.angular[window], clearance=floor.clearance[window],
            flights=[(a - first, b - first) for a, b in window_flights], legs=lines[window],
            standing=floor.loaded[window], leg_length=leg, held=(closed or first > 0, closed or last < n - 1),
        )
    )  # fmt: skip
    repaired = over_the_floor(_apply_plan(clip, plan, first, window_flights, floor.loaded))
    return Repaired(repaired, before, clip_ballistics(repaired), plan)


def _apply_plan(clip: Clip, plan: RepairPlan, first: int, flights: list[tuple[int, int]], standing: Mask) -> Clip:
    """The clip with the plan's timing and body displacement, and with planted feet held, at the clip's frame rate."""
    n, step = clip.n_frames, 1.0 / clip.fps
    times: Array = np.arange(n, dtype=np.float64) * step
    shift = np.zeros((n, 3))
    last = first + len(plan.times) - 1
    times[first : last + 1] = times[first] + plan.times
    times[last + 1 :] += times[last] - last * step
    shift[first : last + 1] = plan.shift
    frames = np.arange(round(times[-1] * clip.fps) + 1) * step
    # Due to rounding, the last frame may lie half a step beyond the end.
    frames = np.minimum(frames, times[-1])
    poses = clip_motion(clip, np.asarray(PchipInterpolator(times, np.arange(n) * step)(frames))).poses
    shifts = np.asarray(PchipInterpolator(times, shift)(frames))
    planted = np.stack([np.interp(frames, times, _planted_weight(times, foot)) for foot in standing.T], axis=1)
    for _ in range(3):
        com = momentum(Clip(displaced_with_planted_feet(poses, shifts, planted), clip.fps, clip.name)).com
        for (start, end), (p, v) in zip(flights, plan.falls, strict=True):
            t = frames - times[start]
            fall = p + v * t[:, None] - np.outer(GRAVITY / 2.0 * t**2, (0.0, 0.0, 1.0))
            flying = np.flatnonzero((frames >= times[start]) & (frames <= times[end]))
            correction = np.zeros((len(frames), 3))
            correction[flying] = (fall - com)[flying]
            for edge, side in ((flying[0], slice(None, flying[0])), (flying[-1], slice(flying[-1] + 1, None))):
                correction[side] = correction[edge] * _fade_weight(np.abs(frames[side] - frames[edge]))[:, None]
            shifts = shifts + correction
    moved = Clip(displaced_with_planted_feet(poses, shifts, planted), clip.fps, clip.name)
    spans = [np.flatnonzero((frames >= times[start]) & (frames <= times[end])) for start, end in flights]
    return with_constant_momentum(moved, [(int(flying[0]), int(flying[-1])) for flying in spans if len(flying) > 2])


def over_the_floor(clip: Clip) -> Clip:
    """The clip lifted smoothly in time by at least the depth of its lowest point below the floor.

    A clip whose penetration is nowhere larger than `_PENETRATION_TOLERANCE` is left unchanged.
    """
    below = np.maximum(0.0, -contacts(clip).clearance)
    if below.max() <= _PENETRATION_TOLERANCE:
        return clip
    if clip.closes():
        # Three laps, so that the filters are periodic.
        below = np.concatenate([below[:-1], below[:-1], below])
    width = max(1, round(_LIFT_FILTER_HALF_WIDTH * clip.fps))
    # The maximum over the reach of both mean filters, so that the smoothed lift is nowhere below what is needed.
    needed = maximum_filter1d(below, 4 * width + 1, mode="nearest")
    lift = uniform_filter1d(uniform_filter1d(needed, 2 * width + 1, mode="nearest"), 2 * width + 1, mode="nearest")
    if clip.closes():
        lift = lift[clip.n_frames - 1 : 2 * clip.n_frames - 1]
    poses = clip.poses.copy()
    poses[:, 2] += lift
    return Clip(poses, clip.fps, clip.name)


def _planted_weight(times: Array, standing: Mask) -> Array:
    """Weight of a planted foot: 1 while it stands, fading to 0 before and after, shape (n,)."""
    if not standing.any():
        return np.zeros(len(times))
    return _fade_weight(np.abs(times[:, None] - times[standing]).min(axis=1))


def _fade_weight(age: Array) -> Array:
    """C¹ weight by time from a stance or flight [s]: 1 at 0, 0 from `_RELEASE_TIME` on."""
    x = np.clip(age / _RELEASE_TIME, 0.0, 1.0)
    return (1.0 - x) ** 2 * (1.0 + 2.0 * x)
