"""Dynamic time warping of a loop: the lead of its phase over a reference's, of least cost and smoothed."""

from collections.abc import Sequence

import numpy as np

from geometry.arrays import Array, IntArray


def least_cost_lead(cost: Array, changes: Sequence[int], penalties: Array) -> IntArray:
    r"""Lead at each step of the lap, by dynamic programming in a band.

    .. math:: \min_{\ell} \sum_k \bigl( C_{k,\,\ell_k} + p(\ell_k - \ell_{k-1}) \bigr), \qquad |\ell_k| \le m

    with ℓ = 0 before the first step and at the last one.

    Parameters
    ----------
    cost : Array, shape (n, 2m + 1)
        C, cost of each lead from −m to m at each step.
    changes : sequence of int
        Possible changes of the lead in a step; of equally good ones the first is taken.
    penalties : Array, shape (changes,)
        p, cost of each change.

    Returns
    -------
    IntArray, shape (n,)
    """
    n, leads = cost.shape
    middle, reach = leads // 2, max(changes)
    total = np.full(leads, np.inf)
    total[middle] = 0.0
    taken = np.zeros((n, leads), dtype=np.int64)
    for k in range(n):
        padded = np.pad(total, reach, constant_values=np.inf)
        options = np.stack([padded[reach - c : reach - c + leads] + p for c, p in zip(changes, penalties, strict=True)])
        taken[k] = np.asarray(changes)[options.argmin(axis=0)]
        total = options.min(axis=0) + cost[k]
    lead, at = np.zeros(n, dtype=np.int64), middle
    for k in range(n - 1, -1, -1):
        lead[k] = at - middle
        at -= int(taken[k, at])
    return lead


def smooth_lead(lead: Array, widths: float) -> Array:
    """Periodic lead, shape (n,), smoothed by a Gaussian whose standard deviation is a lap divided by `widths`."""
    n = len(lead)
    return np.fft.irfft(np.fft.rfft(lead) * np.exp(-0.5 * (2.0 * np.pi * np.fft.rfftfreq(n) * n / widths) ** 2), n)
