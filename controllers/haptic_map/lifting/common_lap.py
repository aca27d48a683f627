"""Time alignment of clips to a common lap: an angle for each frame, so that similar moments have the same angle.

Each clip is shifted, and warped if that gains enough, to match the most similar clips, by dynamic time warping over the
lead of its phase. Poses, velocities and the feet that bear load are compared, so that contacts coincide. The mismatch
saturates at a scale: a lap in which two motions nearly agree at one moment is better than a mediocre match all round.
"""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from controllers.blending.alignment import MAX_LEAD
from controllers.haptic_map.lifting.motion_features import Features, Motion, squared_distances
from controllers.motion.time_warping import least_cost_lead, smooth_lead
from geometry.arrays import Array
from geometry.easing import smooth_steps

N_SAMPLES = 385  # samples of a motion's features over its duration
_STEPS = 96  # steps of the lap in the dynamic programme
_LEADS_PER_STEP = 4  # leads per step: the pace changes by quarters of the clip's own
_MAX_LEAD = int(MAX_LEAD * _STEPS * _LEADS_PER_STEP)
_LEAD_CHANGES = (-2, -1, 0, 1, 2)  # possible changes of the lead in a step: paces 0.5 to 1.5
# Largest change of the pace after smoothing. With half of it jump and backflip have their transition at 313° instead of
# 146° and the condition number of h_* is up to 201 instead of 81; with twice up to 70, but in-betweens sink 4 mm into
# the floor instead of 2.
_MAX_PACE_CHANGE = 0.4
# Cost of a change of pace by a quarter, as a fraction of the mean mismatch; it grows with the square of the change.
# With half of it the condition number of h_* is up to 86 instead of 81; with twice it is up to 181, and jump and
# backflip have their transition at 330° instead of 146°.
_PACE_CHANGE_COST = 0.02
# a warp is used only if it reduces the mismatch to below this ratio; with 1 the map is the same
_MAX_MISMATCH_RATIO = 0.95
_MAX_NEIGHBOURS = 6  # largest number of similar clips to which a clip is aligned
# Number of the best shifts that are tried with a warp: with 3 and 12 transitions move by at most 3°.
_SHIFT_COUNT = 6
# [s] time that converts velocities to lengths. With half of it the transition of walk and run is at 225° instead of
# 311°, and that of jump and backflip at 7° instead of 146°; with twice they are at 311 and 139°.
_VELOCITY_TIME = 0.1
# [m] distance that a difference in one foot's support counts as. With half of it the transition of jump and backflip is
# at 354° instead of 146° and the condition number of h_* is up to 153 instead of 81; with twice up to 124, and
# in-betweens sink 8 mm into the floor instead of 2.
_SUPPORT_DISTANCE = 0.1
_GAP_RANGE = (0.1, 0.3)  # least and largest fraction of the lap in which an open clip returns


class Phase(NamedTuple):
    """Timing of a clip in the lap: s = (θ/2π − start)/(1 − gap) + lead(θ), from 0 to 1 along the clip.

    Attributes
    ----------
    start : float
        Share of the lap before the clip's first frame.
    gap : float
        Share of the lap in which an open clip returns to its start; 0 for a closed one.
    lead : CubicSpline
        As a function of the share of the lap since `start`, periodic.
    """

    start: float
    gap: float
    lead: CubicSpline

    def share(self, lap: Array) -> Array:
        """Share s of the clip's time at shares of the lap; beyond 1 in the gap of an open clip."""
        since = np.mod(lap - self.start, 1.0)
        return since / (1.0 - self.gap) + self.lead(since)

    def angles(self, frames: int) -> Array:
        """Angle θ of each frame [rad], shape (frames,), strictly increasing: the inverse of `share`."""
        wanted = np.linspace(0.0, 1.0, frames)
        since = wanted * (1.0 - self.gap)
        for _ in range(60):
            error = since / (1.0 - self.gap) + self.lead(since) - wanted
            since = since - error / (1.0 / (1.0 - self.gap) + self.lead(since, 1))
        # The ends are set exactly.
        since[0], since[-1] = 0.0, 1.0 - self.gap
        return 2.0 * np.pi * (self.start + since)


def _unwarped_phase(start: float, gap: float) -> Phase:
    knots = np.linspace(0.0, 1.0, 9)
    return Phase(start, gap, CubicSpline(knots, np.zeros(9), bc_type="periodic"))


def _return_gap(motion: Motion, own: Features) -> float:
    """Share of the lap in which an open clip returns: 1.5 times as long as at the motion's own mean speed, bounded."""
    if motion.closed:
        return 0.0
    speed = float(np.linalg.norm(own.velocity[:, 3:], axis=1).mean())
    distance = float(np.linalg.norm(own.pose[-1] - own.pose[0]))
    seconds = 1.5 * distance / max(speed, 1e-3)
    return float(np.clip(seconds / (seconds + motion.duration), *_GAP_RANGE))


def _mismatch_table(own: Array, others: list[tuple[Array, Phase]], scale: float) -> Array:
    """Table of the mismatch of a clip's samples (columns) with other clips at steps of the lap (rows); zero in gaps."""
    lap = np.arange(_STEPS) / _STEPS
    table = np.zeros((_STEPS, N_SAMPLES))
    for points, phase in others:
        s = phase.share(lap)
        samples = points[np.round(np.minimum(s, 1.0) * (N_SAMPLES - 1)).astype(np.int64)]
        square = squared_distances(samples, own)
        table += np.where(s[:, None] <= 1.0, square / (square + scale**2), 0.0)
    return table / len(others)


def _table_entries(costs: Array, lap: Array, s: Array) -> Array:
    """Entries of the `_mismatch_table` at fractions of the lap and of the clip's time; 0 beyond the clip."""
    rows = np.round(lap * _STEPS).astype(np.int64) % _STEPS
    columns = np.round(np.clip(s, 0.0, 1.0) * (N_SAMPLES - 1)).astype(np.int64)
    return np.where(s <= 1.0, costs[rows, columns], 0.0)


def _warped_phase(costs: Array, start: float, gap: float) -> Phase:
    """Phase with the lead of least cost, zero at start and end, by dynamic programming."""
    lap = np.arange(_STEPS) / _STEPS
    leads = np.arange(-_MAX_LEAD, _MAX_LEAD + 1) / (_STEPS * _LEADS_PER_STEP)
    s = lap[:, None] / (1.0 - gap) + leads
    # A closed clip continues with its next lap; an open one is clamped to its ends.
    s = np.mod(s, 1.0) if gap == 0.0 else np.where(lap[:, None] < 1.0 - gap, np.clip(s, 0.0, 1.0), 2.0)
    table = _table_entries(costs, (start + lap)[:, None] + 0.0 * leads, s)
    penalties = _PACE_CHANGE_COST * table.mean() * np.square(_LEAD_CHANGES).astype(np.float64)
    lead = least_cost_lead(table, _LEAD_CHANGES, penalties) / (_STEPS * _LEADS_PER_STEP)
    return Phase(start, gap, _smooth_lead(lead, gap))


def _smooth_lead(lead: Array, gap: float) -> CubicSpline:
    """C² lead that is zero at the ends, no steeper than allowed."""
    knots = np.arange(_STEPS + 1) / _STEPS
    smooth = smooth_lead(lead, 24.0)
    smooth = np.append(smooth, smooth[0])
    if gap > 0.0:
        # Within the gap the lead is zero, and at its edges pace and acceleration are the clip's own.
        smooth = smooth * smooth_steps(np.minimum(knots, 1.0 - gap - knots) / 0.1)
    smooth = smooth - smooth[0]
    steepest = float(np.abs(np.diff(smooth)).max()) * _STEPS * (1.0 - gap)
    return CubicSpline(knots, smooth * min(1.0, _MAX_PACE_CHANGE / max(steepest, 1e-12)), bc_type="periodic")


def _mean_mismatch(costs: Array, phase: Phase) -> float:
    lap = np.arange(_STEPS) / _STEPS
    s = phase.share(lap)
    return float(_table_entries(costs, lap, np.mod(s, 1.0) if phase.gap == 0.0 else s).mean())


def _best_phase(costs: Array, gap: float) -> Phase:
    """Phase with the best shift of a clip and, if it gains enough, the best warp."""
    # The gap of every open clip contains the angle 0, where the lap ends.
    starts = np.arange(_STEPS) / _STEPS if gap == 0.0 else gap * np.linspace(0.1, 0.9, 9)
    unwarped = [_unwarped_phase(float(start), gap) for start in starts]
    mismatches = [_mean_mismatch(costs, phase) for phase in unwarped]
    if max(mismatches) - min(mismatches) <= 1e-9 + 0.01 * float(np.mean(mismatches)):
        # If the mismatch hardly depends on the shift, a closed motion keeps its own phase and an open one is centred.
        return unwarped[0] if gap == 0.0 else unwarped[len(unwarped) // 2]
    best, least = unwarped[int(np.argmin(mismatches))], min(mismatches)
    for k in np.argsort(mismatches, kind="stable")[:_SHIFT_COUNT]:
        warped = _warped_phase(costs, unwarped[k].start, gap)
        mismatch = _mean_mismatch(costs, warped)
        if mismatch < min(least, _MAX_MISMATCH_RATIO * min(mismatches)):
            best, least = warped, mismatch
    return best


def common_lap(motions: list[Motion], own: list[Features]) -> list[Phase]:
    """Timing of each clip in the lap.

    The clip most similar to all others keeps its own phase (if it is closed). The others are placed one after the
    other, the nearest first, and then once more, against the nearest among all clips.

    Parameters
    ----------
    motions : list of Motion
    own : list of Features
        Features of the motions at `N_SAMPLES` steps.
    """
    points = [
        np.concatenate([each.pose, _VELOCITY_TIME * each.velocity, _SUPPORT_DISTANCE * each.support], axis=1)
        for each in own
    ]
    gaps = [_return_gap(motion, each) for motion, each in zip(motions, own, strict=True)]
    coarse = [each[::16] for each in points]
    n = len(motions)
    distances = np.zeros((n, n))
    for i in range(n):
        for j in range(i):
            square = squared_distances(coarse[i], coarse[j])
            distances[i, j] = distances[j, i] = np.sqrt(square.min(axis=0)).mean() + np.sqrt(square.min(axis=1)).mean()
    everything = np.concatenate(coarse)
    scale = 0.5 * float(np.sqrt(2.0 * everything.var(axis=0).sum())) + 1e-6
    first = int(distances.sum(axis=1).argmin())
    phases: dict[int, Phase] = {first: _unwarped_phase(0.5 * gaps[first], gaps[first])}

    def place(i: int) -> None:
        near = sorted((j for j in phases if j != i), key=lambda j: (distances[i, j], j))[:_MAX_NEIGHBOURS]
        phases[i] = _best_phase(_mismatch_table(points[i], [(points[j], phases[j]) for j in near], scale), gaps[i])

    while len(phases) < n:
        place(min((i for i in range(n) if i not in phases), key=lambda i: (min(distances[i, j] for j in phases), i)))
    for i in range(n):
        if n > 1 and i != first:
            place(i)
    return [phases[i] for i in range(n)]
