"""Time alignment of clips to a common lap: an angle for each frame, so that similar moments have the same angle.

Each clip is shifted, and warped if that is worth it, to match the most similar clips, by dynamic time warping over the
lead of its phase. Poses, velocities and the feet that bear load are compared, so that contacts coincide. The mismatch
saturates at a scale: laps in which two motions nearly agree at one moment are better than mediocre ones all round.
"""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from controllers.blending.alignment import LARGEST_LEAD
from controllers.easing import smooth_steps
from controllers.haptic_map.lifting.motion_features import Features, Motion, squared_distances
from controllers.state import Array

SAMPLES = 385  # samples of a motion's features over its duration
_STEPS = 96  # steps of the lap in the dynamic programme
_FINE = 4  # leads per step: paces change by quarters of the clip's own
_BAND = int(LARGEST_LEAD * _STEPS * _FINE)
_CHANGES = np.arange(-2, 3)  # changes of the lead in a step: paces 0.5 to 1.5
# Largest change of the pace after smoothing. With half of it jump and backflip meet at 313° instead of 146° and the
# condition number of h_* is up to 201 instead of 81; with twice 70, but in-betweens sink 4 mm instead of 2.
_STEEPEST = 0.4
# Cost of a change of pace by a quarter, as a share of the mean mismatch; grows with its square. With half of it the
# condition number of h_* is up to 86 instead of 81; with twice jump and backflip meet at 330° instead of 146°, and it
# is up to 181.
_COST = 0.02
_WORTH = 0.95  # a warp is made only if it reduces the mismatch below this share: 1 gives the same map
_NEIGHBOURS = 6  # number of most similar clips to which a clip is aligned
# Number of the best shifts that are tried with a warp: with 3 and 12 motions meet within 3° of where they do.
_SHIFTS = 6
# [s] converts velocities to lengths: the distance covered in this time. With half of it the transition of walk and
# run is at 225° instead of 311°, and that of jump and backflip at 7° instead of 146°; with twice at 311 and 139°.
_REACTION = 0.1
# [m] distance that stands for the difference between a foot that bears load and one that does not. With half of it
# jump and backflip meet at 354° instead of 146° and the condition number of h_* is up to 153 instead of 81; with
# twice 124, and in-betweens sink 8 mm instead of 2.
_FOOT = 0.1
_GAP = (0.1, 0.3)  # least and largest share of the lap in which an open clip returns


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
            missed = since / (1.0 - self.gap) + self.lead(since) - wanted
            since = since - missed / (1.0 / (1.0 - self.gap) + self.lead(since, 1))
        # The ends are set exactly.
        since[0], since[-1] = 0.0, 1.0 - self.gap
        return 2.0 * np.pi * (self.start + since)


def _unwarped(start: float, gap: float) -> Phase:
    knots = np.linspace(0.0, 1.0, 9)
    return Phase(start, gap, CubicSpline(knots, np.zeros(9), bc_type="periodic"))


def _return_gap(motion: Motion, own: Features) -> float:
    """Share of the lap in which an open clip returns: 1.5 times as long as at the motion's own mean speed, bounded."""
    if motion.closed:
        return 0.0
    speed = float(np.linalg.norm(own.velocity[:, 3:], axis=1).mean())
    way = float(np.linalg.norm(own.pose[-1] - own.pose[0]))
    seconds = 1.5 * way / max(speed, 1e-3)
    return float(np.clip(seconds / (seconds + motion.duration), *_GAP))


def _costs(own: Array, others: list[tuple[Array, Phase]], scale: float) -> Array:
    """Mismatch of a clip's samples (columns) with other clips at steps of the lap (rows); zero in their gaps."""
    lap = np.arange(_STEPS) / _STEPS
    table = np.zeros((_STEPS, SAMPLES))
    for points, phase in others:
        s = phase.share(lap)
        there = points[np.round(np.minimum(s, 1.0) * (SAMPLES - 1)).astype(np.int64)]
        square = squared_distances(there, own)
        table += np.where(s[:, None] <= 1.0, square / (square + scale**2), 0.0)
    return table / len(others)


def _cost_at(costs: Array, lap: Array, s: Array) -> Array:
    """Entries of the table of `_costs` at shares of the lap and of the clip's time; 0 beyond the clip."""
    rows = np.round(lap * _STEPS).astype(np.int64) % _STEPS
    columns = np.round(np.clip(s, 0.0, 1.0) * (SAMPLES - 1)).astype(np.int64)
    return np.where(s <= 1.0, costs[rows, columns], 0.0)


def _warped(costs: Array, start: float, gap: float) -> Phase:
    """Phase with the lead of least cost that is zero at start and end, by dynamic programming."""
    lap = np.arange(_STEPS) / _STEPS
    leads = np.arange(-_BAND, _BAND + 1) / (_STEPS * _FINE)
    s = lap[:, None] / (1.0 - gap) + leads
    # A closed clip continues with its next lap; an open one is clamped to its ends.
    s = np.mod(s, 1.0) if gap == 0.0 else np.where(lap[:, None] < 1.0 - gap, np.clip(s, 0.0, 1.0), 2.0)
    table = _cost_at(costs, (start + lap)[:, None] + 0.0 * leads, s)
    total = np.full(len(leads), np.inf)
    total[_BAND] = 0.0
    steps = np.zeros((_STEPS, len(leads)), dtype=np.int64)
    price = _COST * table.mean() * _CHANGES.astype(float) ** 2
    reach = int(_CHANGES[-1])
    for k in range(_STEPS):
        padded = np.pad(total, reach, constant_values=np.inf)
        options = np.stack(
            [padded[reach - c : reach - c + len(leads)] + p for c, p in zip(_CHANGES, price, strict=True)]
        )
        steps[k] = _CHANGES[options.argmin(axis=0)]
        total = options.min(axis=0) + table[k]
    lead, at = np.zeros(_STEPS), _BAND
    for k in range(_STEPS - 1, -1, -1):
        lead[k] = leads[at]
        at -= int(steps[k, at])
    return Phase(start, gap, _smoothed(lead, gap))


def _smoothed(lead: Array, gap: float) -> CubicSpline:
    """C² lead that is zero at the ends, no steeper than allowed."""
    knots = np.arange(_STEPS + 1) / _STEPS
    frequency = np.fft.rfftfreq(_STEPS)
    smooth = np.fft.irfft(np.fft.rfft(lead) * np.exp(-0.5 * (2.0 * np.pi * frequency * _STEPS / 24.0) ** 2), _STEPS)
    smooth = np.append(smooth, smooth[0])
    if gap > 0.0:
        # Within the gap the lead is zero, and at its edges pace and acceleration are the clip's own.
        smooth = smooth * smooth_steps(np.minimum(knots, 1.0 - gap - knots) / 0.1)
    smooth = smooth - smooth[0]
    steepest = float(np.abs(np.diff(smooth)).max()) * _STEPS * (1.0 - gap)
    return CubicSpline(knots, smooth * min(1.0, _STEEPEST / max(steepest, 1e-12)), bc_type="periodic")


def _mismatch(costs: Array, phase: Phase) -> float:
    lap = np.arange(_STEPS) / _STEPS
    s = phase.share(lap)
    return float(_cost_at(costs, lap, np.mod(s, 1.0) if phase.gap == 0.0 else s).mean())


def _placed(costs: Array, gap: float) -> Phase:
    """Phase with the best shift of a clip and, if it is worth it, the best warp."""
    # The gap of every open clip contains the angle 0, where the lap ends.
    starts = np.arange(_STEPS) / _STEPS if gap == 0.0 else gap * np.linspace(0.1, 0.9, 9)
    straight = [_unwarped(float(start), gap) for start in starts]
    found = [_mismatch(costs, phase) for phase in straight]
    if max(found) - min(found) <= 1e-9 + 0.01 * float(np.mean(found)):
        # A motion whose mismatch hardly depends on the shift keeps its own phase; an open one is centred.
        return straight[0] if gap == 0.0 else straight[len(straight) // 2]
    best, least = straight[int(np.argmin(found))], min(found)
    for k in np.argsort(found, kind="stable")[:_SHIFTS]:
        warped = _warped(costs, straight[k].start, gap)
        left = _mismatch(costs, warped)
        if left < min(least, _WORTH * min(found)):
            best, least = warped, left
    return best


def common_lap(motions: list[Motion], own: list[Features]) -> list[Phase]:
    """Timing of each clip in the lap.

    The clip most similar to all others keeps its own phase (if it is closed); the others are placed one after the
    other, the nearest first, and then once more against their nearest of all.

    Parameters
    ----------
    motions : list of Motion
    own : list of Features
        Features of the motions at `SAMPLES` steps.
    """
    points = [np.concatenate([each.pose, _REACTION * each.velocity, _FOOT * each.support], axis=1) for each in own]
    gaps = [_return_gap(motion, each) for motion, each in zip(motions, own, strict=True)]
    coarse = [each[::16] for each in points]
    n = len(motions)
    apart = np.zeros((n, n))
    for i in range(n):
        for j in range(i):
            square = squared_distances(coarse[i], coarse[j])
            apart[i, j] = apart[j, i] = np.sqrt(square.min(axis=0)).mean() + np.sqrt(square.min(axis=1)).mean()
    everything = np.concatenate(coarse)
    scale = 0.5 * float(np.sqrt(2.0 * everything.var(axis=0).sum())) + 1e-6
    first = int(apart.sum(axis=1).argmin())
    phases: dict[int, Phase] = {first: _unwarped(0.5 * gaps[first], gaps[first])}

    def place(i: int) -> None:
        near = sorted((j for j in phases if j != i), key=lambda j: (apart[i, j], j))[:_NEIGHBOURS]
        phases[i] = _placed(_costs(points[i], [(points[j], phases[j]) for j in near], scale), gaps[i])

    while len(phases) < n:
        place(min((i for i in range(n) if i not in phases), key=lambda i: (min(apart[i, j] for j in phases), i)))
    for i in range(n):
        if n > 1 and i != first:
            place(i)
    return [phases[i] for i in range(n)]
