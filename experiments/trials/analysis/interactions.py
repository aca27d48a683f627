"""Interactions of two factors: whether the effect of a level depends on the level of another factor.

For a level a of one factor and a level b of another, with the references a₀ and b₀, each user i has a difference of
differences of means,

    d_i = (y_i[a, b] − y_i[a₀, b]) − (y_i[a, b₀] − y_i[a₀, b₀]).

Student's t test compares it with zero. If one of the factors is between users, Welch's t test compares the differences
of the two groups (scipy). All p values are corrected together by Holm's method.
"""

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from controllers.state import Array
from experiments.trials.analysis.effect_sizes import spreads


def interactions_of(
    cells_of: Mapping[str, Any], factors: Mapping[str, Sequence[str]], between: Sequence[str]
) -> dict[str, float]:
    """Least corrected p of the two-factor interactions of each measure; measures without a test are left out.

    Parameters
    ----------
    cells_of : mapping of str to pandas.Series
        By measure, users' means in every condition, indexed by the factors that vary and the user.
    factors : mapping of str to sequence of str
        Names of levels by factor, the reference first.
    between : sequence of str
        Between-subject factors.
    """
    from statsmodels.stats.multitest import multipletests

    found: list[tuple[str, float]] = []
    for measure, cells in cells_of.items():
        varied = [name for name in cells.index.names if name != "user"]
        for one, other in itertools.combinations(varied, 2):
            if one in between and other in between:
                continue
            own, across = (other, one) if one in between else (one, other)
            for level, at in itertools.product(factors[own][1:], factors[across][1:]):
                p = _p(cells, (own, level, factors[own][0]), (across, at, factors[across][0]), across in between)
                found += [(measure, p)] if np.isfinite(p) else []
    if not found:
        return {}
    corrected = np.asarray(multipletests([p for _, p in found], method="holm")[1], dtype=np.float64)
    least: dict[str, float] = {}
    for (measure, _), p in zip(found, corrected, strict=True):
        least[measure] = min(float(p), least.get(measure, 1.0))
    return least


def _p(cells: Any, own: tuple[str, str, str], across: tuple[str, str, str], between: bool) -> float:
    from scipy.stats import ttest_1samp, ttest_ind

    factor, level, reference = own
    table = cells.unstack(factor)
    if level not in table or reference not in table:
        return float("nan")
    differences = (
        (table[level] - table[reference]).dropna().groupby(level=[across[0], "user"]).mean().unstack(across[0])
    )
    if across[1] not in differences or across[2] not in differences:
        return float("nan")
    samples: tuple[Array, ...]
    if between:
        samples = tuple(differences[name].dropna().to_numpy() for name in across[1:])
    else:
        samples = ((differences[across[1]] - differences[across[2]]).dropna().to_numpy(),)
    if any(len(sample) < 3 for sample in samples) or not any(map(spreads, samples)):
        return float("nan")
    test: Any = ttest_ind(*samples, equal_var=False) if between else ttest_1samp(samples[0], 0.0)
    return float(test.pvalue)
