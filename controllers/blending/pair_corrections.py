r"""Corrections of in-betweens of any number of clips: for every pair of neighbours, a polynomial in their weights.

.. math:: D(\theta, w) = \textstyle\sum_{i<j} w_i w_j \sum_k (w_i - w_j)^k\, C_{ijk}(\theta)

D has the channels of `inbetween`, interpolates the corrections of `footfalls` at some mixtures of each pair, and
vanishes where one clip has all the weight. C is periodic in θ, by cubic B-splines.
"""

from collections.abc import Sequence

import numpy as np
from numba import njit

from controllers.curves.splines import control_points, interpolate
from controllers.legs.footfalls import foot_corrections
from controllers.legs.limbs import Limb
from controllers.motion.inbetween import FOOT, ROOT
from controllers.work_array import work_array
from geometry.arrays import Array, IntArray

_TERMS = 3  # terms of the polynomial, and mixtures of each pair that are interpolated exactly
_ROUNDING = 1e-9  # [m]
_ROWS, _CLIPS, _PAIRS, _CHANNELS, _INDEX = range(5)


def neighbouring_pairs(sites: Array, share: float = 0.0) -> list[tuple[int, int]]:
    """Pairs of sites (rows, m, 2) that are Gabriel neighbours (Gabriel & Sokal 1969) in at least `share` of the rows.

    No other site lies in or on the circle whose diameter is the segment between the two. One row is enough if `share`
    is 0.
    """
    clips = sites.shape[1]
    found: list[tuple[int, int]] = []
    for j in range(clips):
        for i in range(j):
            middle, half = 0.5 * (sites[:, i] + sites[:, j]), 0.5 * np.linalg.norm(sites[:, i] - sites[:, j], axis=1)
            others = np.delete(sites, (i, j), axis=1)
            nearest = np.linalg.norm(others - middle[:, None], axis=2).min(axis=1, initial=np.inf)
            adjacent = nearest > half + _ROUNDING
            if adjacent.any() and adjacent.mean() >= share:
                found.append((i, j))
    return found


def packed_pairs(channels: Array, drifts: Array, limbs: Sequence[Limb], pairs: Sequence[tuple[int, int]]) -> Array:
    """Parameters of `pair_correction`.

    Parameters
    ----------
    channels : Array, shape (n, m, nq + 4 limbs)
        Channels of the clips at equal steps of the lap, limbs given by their ends (`limb_ends`).
    drifts : Array, shape (m, 3)
        Drifts ξ of the clips.
    limbs : sequence of Limb
        If empty, nothing is corrected.
    pairs : sequence of (int, int)
        Pairs of clips with corrected in-betweens, the lower number first.
    """
    rows, clips = channels.shape[:2]
    size = ROOT + FOOT * len(limbs)
    if not limbs or not pairs:
        return np.array([1.0, clips, 0.0, 0.0])
    index = np.full((clips, clips), -1.0)
    second = np.arange(1, _TERMS + 1) / (_TERMS + 1)
    weights = np.zeros((len(pairs), _TERMS, clips))
    for n, (i, j) in enumerate(pairs):
        index[i, j] = n
        weights[n, :, i], weights[n, :, j] = 1.0 - second, second
    corrections = foot_corrections(channels, drifts, limbs, weights.reshape(-1, clips))
    powers = (second * (1.0 - second))[:, None] * (1.0 - 2.0 * second)[:, None] ** np.arange(_TERMS)
    table = np.einsum("kt,nptc->npkc", np.linalg.inv(powers), corrections.reshape(rows, len(pairs), _TERMS, size))
    return np.concatenate([[rows, clips, len(pairs), size], index.ravel(), control_points(table, np.ones(1)).ravel()])


@njit
def pair_channels(numbers: Array) -> int:
    """Channels of `packed_pairs`; 0 if nothing is corrected."""
    return int(numbers[_CHANNELS])


@njit
def pair_correction(numbers: Array, angle: float, clips: IntArray, w: Array, changes: Array, d: Array) -> None:
    """Corrections D and their derivatives.

    Parameters
    ----------
    numbers : Array
        `packed_pairs`.
    angle : float
        θ in [0, 2π].
    clips : IntArray, shape (count,)
        Numbers of the nearby clips.
    w, changes : Array, shapes (count,), (3, count)
        Their weights, and the derivatives of the weights by θ and two other parameters.
    d : Array, shape (4, channels)
        Written: D [m, rad], and its derivatives by the three parameters.
    """
    rows, total, pairs, channels = (
        int(numbers[_ROWS]), int(numbers[_CLIPS]), int(numbers[_PAIRS]), int(numbers[_CHANNELS]),
    )  # fmt: skip
    scale = rows / (2.0 * np.pi)
    row = min(int(angle * scale), rows - 1)
    stride = pairs * _TERMS * channels
    table, rates = _INDEX + total * total + row * stride, work_array(3)
    term, term_slope = work_array(channels), work_array(channels)
    d[:] = 0.0
    for a in range(len(clips)):
        for b in range(len(clips)):
            pair = int(numbers[_INDEX + clips[a] * total + clips[b]])
            if pair < 0:
                continue
            product, difference, power, slope = w[a] * w[b], w[a] - w[b], 1.0, 0.0
            for k in range(_TERMS):
                for parameter in range(3):
                    rates[parameter] = (changes[parameter, a] * w[b] + w[a] * changes[parameter, b]) * power
                    rates[parameter] += product * slope * (changes[parameter, a] - changes[parameter, b])
                first = table + (pair * _TERMS + k) * channels
                interpolate(numbers[first:], stride, angle * scale - row, 1.0, term, term_slope)
                for c in range(channels):
                    d[0, c] += product * power * term[c]
                    d[1, c] += product * power * scale * term_slope[c]
                    for parameter in range(3):
                        d[1 + parameter, c] += rates[parameter] * term[c]
                slope = (k + 1) * power
                power *= difference
