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

from experiments.trials.analysis.effect_sizes import has_spread
from geometry.arrays import Array


def interactions_of(
    cells_of: Mapping[str, Any], factors: Mapping[str, Sequence[str]], between: Sequence[str]
) -> dict[str, float]:
    """Smallest corrected p of the two-factor interactions of each measure; measures without a test are left out.

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

    p_values: list[tuple[str, float]] = []
    for measure, cells in cells_of.items():
        varied = [name for name in cells.index.names if name != "user"]
        for one, other in itertools.combinations(varied, 2):
            if one in between and other in between:
                continue
            inner, outer = (other, one) if one in between else (one, other)
            for level, outer_level in itertools.product(factors[inner][1:], factors[outer][1:]):
                p = _p_value(
                    cells, (inner, level, factors[inner][0]), (outer, outer_level, factors[outer][0]), outer in between
                )
                p_values += [(measure, p)] if np.isfinite(p) else []
    if not p_values:
        return {}
    corrected = np.asarray(multipletests([p for _, p in p_values], method="holm")[1], dtype=np.float64)
    smallest: dict[str, float] = {}
    for (measure, _), p in zip(p_values, corrected, strict=True):
        smallest[measure] = min(float(p), smallest.get(measure, 1.0))
    return smallest


def _p_value(cells: Any, inner: tuple[str, str, str], outer: tuple[str, str, str], between: bool) -> float:
    from scipy.stats import ttest_1samp, ttest_ind

    factor, level, reference = inner
    table = cells.unstack(factor)
    if level not in table or reference not in table:
        return float("nan")
    differences = (table[level] - table[reference]).dropna().groupby(level=[outer[0], "user"]).mean().unstack(outer[0])
    if outer[1] not in differences or outer[2] not in differences:
        return float("nan")
    samples: tuple[Array, ...]
    if between:
        samples = tuple(differences[name].dropna().to_numpy() for name in outer[1:])
    else:
        samples = ((differences[outer[1]] - differences[outer[2]]).dropna().to_numpy(),)
    if any(len(sample) < 3 for sample in samples) or not any(map(has_spread, samples)):
        return float("nan")
    test: Any = ttest_ind(*samples, equal_var=False) if between else ttest_1samp(samples[0], 0.0)
    return float(test.pvalue)
