r"""Grounded form of a gait: a running gait without its flight phases, for paces that are too slow for them.

The duration of a flight phase is given by gravity, whatever the pace; so a gait with flights cannot be played slowly.
Here each flight phase is divided between the foot that pushes off and the one that lands: the former stays in stance
longer, the latter lands sooner, both at their places in the clip. A leg is played at a warped phase ψ(s) instead of s,

.. math:: \psi(b - \sigma_+ g_-) = b, \qquad \psi(a + \sigma_- g_+) = a

for a stance from b to a with flights of durations g₋ before and g₊ after it: stance is longer, and swing faster. The
root is lowered, smoothly over the lap, until both legs reach the ground.
"""

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.ndimage import convolve1d, minimum_filter1d

from controllers.curves.splines import periodic_interpolation
from controllers.legs.limb_ends import SOFTMIN_WIDTH, lowest_point
from controllers.legs.limbs import N_END_CHANNELS, Limb
from controllers.legs.reaching import extension, shortfall, solve_reach
from controllers.motion.channels import signed_like
from geometry.arrays import Array, Mask
from geometry.spans import cyclic_spans

# σ₋, σ₊: the excess of their sum over 1 gives a double support of a tenth of the flight. If the flight is divided 0.6
# to 0.4 instead of equally, the pelvis is lowered by 7 cm more (docs/validation/led-figures.md).
_FLIGHT_SHARES = 0.5, 0.6
_STEP_SHARES = 1.0, 1.0  # of `stepping`: a double support takes the place of each flight, and is as long
# [m] height up to which a swinging foot of shortened steps keeps its clearance: lower than 6 mm it would bear load
_KEPT_CLEARANCE = 0.01
# [m] largest lowering of the root; a longer leap cannot become a step: prepared runs need up to 0.24, a run whose leaps
# are 1 m longer 0.32
_MAX_LOWERING = 0.35


def grounded(
    rows: Array, signs: Array, stride: float, limbs: Sequence[Limb], standing: Mask, sway: Array,
    shares: tuple[float, float] = _FLIGHT_SHARES,
) -> Array | None:  # fmt: skip
    """Rows of a led clip (`led`) without its flight phases; None if it has none, hops on one foot, or leaps too far.

    Parameters
    ----------
    rows : Array, shape (n, nq + 4 limbs)
        Channels at equal steps of the lap: remainder, then each limb's end.
    signs : Array, shape (nq + 4 limbs,)
        −1 where a channel returns with the opposite sign after a lap.
    stride : float
        Length of a lap [m], along x.
    limbs : sequence of Limb
    standing : array of bool, shape (n, limbs)
        Which limbs are in stance.
    sway : Array, shape (m, 2)
        Displacement of the root over the floor [m], at m equal steps of the lap.
    shares : (float, float)
        σ₋, σ₊.
    """
    flights = cyclic_spans(~np.any(standing, axis=1))
    warps = [_phase_warp(standing, j, flights, shares) for j in range(len(limbs))]
    if not flights or any(warp is None for warp in warps):
        return None
    n, result = len(rows), rows.copy()
    twice = np.concatenate([rows, signs * rows, rows[:1]])
    spline = CubicSpline(np.arange(2 * n + 1), twice, bc_type="periodic")
    first = rows.shape[1] - N_END_CHANNELS * len(limbs)
    for j, (limb, warp) in enumerate(zip(limbs, warps, strict=True)):
        assert warp is not None
        joints = [np.arange(3 + 4 * joint, 7 + 4 * joint) for joint in limb.joints]
        columns = np.concatenate([*joints, np.arange(first + N_END_CHANNELS * j, first + N_END_CHANNELS * (j + 1))])
        result[:, columns] = spline(np.mod(warp, 2 * n))[:, columns]
        for joint in joints:
            result[:, joint] /= np.linalg.norm(result[:, joint], axis=1, keepdims=True)
            # The same sign as in the clip, so that both forms can be blended.
            result[:, joint] = signed_like(result[:, joint], rows[:, joint])
        result[:, first + N_END_CHANNELS * j + 3] += (warp - np.arange(n)) / n
    result[:, :2] += periodic_interpolation(sway, 2.0 * np.pi * np.arange(n) / n)
    short = np.zeros(n)
    for j, limb in enumerate(limbs):
        at = first + N_END_CHANNELS * j
        # The leg may be as straight as it gets in the clip.
        short = np.maximum(short, shortfall(result, stride, limb, at, extension(rows, stride, limb, at)))
    width = max(3, round(n / len(flights)))
    window = np.hanning(width + 2)[1:-1]
    ceiling = minimum_filter1d(rows[:, 2] - short, width, mode="wrap")
    result[:, 2] = convolve1d(ceiling, window / window.sum(), mode="wrap")
    if np.max(rows[:, 2] - result[:, 2]) > _MAX_LOWERING:
        return None
    return result


def stepping(
    rows: Array, signs: Array, stride: float, limbs: Sequence[Limb], standing: Mask, sway: Array, longest: float
) -> tuple[Array, float] | None:
    """Rows of a clip with flight phases that steps instead, and the length of a lap [m]; None as `grounded`.

    Steps longer than `longest` [m] are shortened to it: the root's advance and, above `_KEPT_CLEARANCE`, the height of
    swinging feet in proportion, or a foot that kicks up behind would fold the leg under a root that is lower.
    """
    if not standing.any(axis=0).all():
        return None
    steps = min(stride, longest * len(cyclic_spans(~np.any(standing, axis=1))))
    ratio, first, result = steps / stride, rows.shape[1] - N_END_CHANNELS * len(limbs), rows.copy()
    result[:, 0] *= ratio
    for j, limb in enumerate(limbs):
        column, height = 3 + 4 * limb.joints[2], first + N_END_CHANNELS * j + 2
        soles = rows[:, height] + lowest_point(rows[:, column : column + 4], limb, SOFTMIN_WIDTH)
        raised = np.maximum(soles - np.median(soles[standing[:, j]]), 0.0)
        result[:, height] -= (1.0 - ratio) * (raised + _KEPT_CLEARANCE * np.expm1(-raised / _KEPT_CLEARANCE))
    low = grounded(result, signs, steps, limbs, standing, sway, _STEP_SHARES)
    return None if low is None else (solve_reach(low, steps, limbs), steps)


def max_swing_speed_ratio(standing: Mask) -> float:
    """Largest ψ' of stepping limbs with the stances `standing` (n, limbs): their swing speed over the clip's."""
    flights, n = cyclic_spans(~np.any(standing, axis=1)), len(standing)
    warps = [_phase_warp(standing, j, flights, _STEP_SHARES) for j in range(standing.shape[1])]
    return max(float(np.diff(warp, append=warp[0] + n).max()) for warp in warps if warp is not None)


def _phase_warp(standing: Mask, j: int, flights: list[tuple[int, int]], shares: tuple[float, float]) -> Array | None:
    """ψ n of limb j at the samples of the lap; None if it is never in stance, or would land before it lifts off."""
    n, own = len(standing), cyclic_spans(standing[:, j])
    if not own:
        return None
    before = {end % n: end - start for start, end in flights}
    after = {start: end - start for start, end in flights}
    phases, clip_phases = list[float](), list[float]()
    for start, end in own:
        phases += [start - shares[1] * before.get(start, 0), end + shares[0] * after.get(end % n, 0)]
        clip_phases += [float(start), float(end)]
    if np.any(np.diff([*phases, phases[0] + n]) <= 0.0):
        return None
    laps = np.arange(-2, 3) * n
    return PchipInterpolator(np.add.outer(laps, phases).ravel(), np.add.outer(laps, clip_phases).ravel())(np.arange(n))
