"""Effects of a study's factors on its measures: mixed models, bootstrap intervals, effect sizes, Holm's correction.

The first level of a factor is the reference. Each other level is compared with it on every measure by the difference
of users' means with its BCa bootstrap interval over users (scipy), by a linear mixed model
(`experiments.trials.analysis.mixed_model`), and by an effect size: Cohen's d_z of paired differences for within-subject
factors, Hedges' g for between-subject factors. The p values of all contrasts of all measures are corrected together by
Holm's method.

A user's mean is the mean over the conditions that have trials at both levels, so that a failed trial does not give a
condition more weight at one level than at the other.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from experiments.trials.analysis.effect_sizes import cohen_dz, has_spread, hedges_g
from experiments.trials.analysis.interactions import interactions_of
from experiments.trials.analysis.mixed_model import CONFIDENCE_LEVEL, NO_FIT, Fit, fit_mixed_model
from geometry.arrays import Array

N_RESAMPLES = 4999
"""Number of bootstrap resamples; (4999 + 1) × 2.5 % is whole, so that the ends of a percentile interval are resamples
(Davison & Hinkley 1997, Bootstrap methods and their application)."""


@dataclass(frozen=True)
class Contrast:
    """A level of a factor compared with the factor's first level, on one measure.

    Attributes
    ----------
    measure, factor, level, reference : str
        Names of the measure, of the factor, and of its two levels that are compared.
    users : int
        Number of users in the comparison.
    mean, reference_mean : float
        Means of users' means.
    difference : float
        Difference of these means.
    low, high : float
        Bootstrap interval of the difference.
    least, most : float
        Smallest and largest difference among the conditions of the other factors.
    model, model_low, model_high, p, p_holm : float
        The mixed model's estimate and interval, its p (Student's t), and p corrected by Holm's method; NaN without fit.
    effect : float
        Effect size, d_z or g.
    agree : int
        Number of users whose own difference has the sign of the mean; 0 for a between-subject factor.
    """

    measure: str
    factor: str
    level: str
    reference: str
    users: int
    mean: float
    reference_mean: float
    difference: float
    low: float
    high: float
    least: float
    most: float
    model: float
    model_low: float
    model_high: float
    p: float
    p_holm: float
    effect: float
    agree: int

    @property
    def shown(self) -> bool:
        """Whether a difference is shown, by the interval and, if the model has one, by the corrected p."""
        apart = np.isfinite(self.low) and np.isfinite(self.high) and not self.low <= 0.0 <= self.high
        return bool(apart and not self.p_holm >= 1.0 - CONFIDENCE_LEVEL)


@dataclass(frozen=True)
class Statistics:
    """All contrasts, with remarks on how they were found.

    Attributes
    ----------
    contrasts : tuple of Contrast
        Contrasts, ordered by measure, factor and level.
    interactions : dict of str to float
        By measure, the smallest corrected p of an interaction; see `experiments.trials.analysis.interactions`.
    remarks : tuple of str
        Remarks, for example on models that did not converge.
    """

    contrasts: tuple[Contrast, ...]
    interactions: dict[str, float]
    remarks: tuple[str, ...]

    def of(self, measure: str, factor: str) -> tuple[Contrast, ...]:
        """Contrasts of a factor on a measure."""
        return tuple(c for c in self.contrasts if c.measure == measure and c.factor == factor)


def statistics(
    frame: Any, factors: Mapping[str, Sequence[str]], between: Sequence[str], measures: Sequence[str], seed: int
) -> Statistics:
    """Compare the levels of every factor on every measure.

    Parameters
    ----------
    frame : pandas.DataFrame
        Table made by `experiments.trials.analysis.trial_table.trial_table`; failed trials are left out.
    factors : mapping of str to sequence of str
        Names of levels by factor, the reference first.
    between : sequence of str
        Between-subject factors.
    measures : sequence of str
        Columns.
    seed : int
        Seed of the bootstrap.
    """
    contrasts: list[Contrast] = []
    cells_of: dict[str, Any] = {}
    remarks: dict[str, list[str]] = {}
    for measure in measures:
        rows = frame[frame["state"].eq("done") & frame[measure].notna()]
        if len(rows) < 2 or not np.ptp(rows[measure].to_numpy()) > 0.0:
            continue
        varied = [name for name in factors if rows[name].nunique() > 1]
        cells_of[measure] = cells = rows.groupby([*varied, "user"])[measure].mean()
        for factor in varied:
            for level in factors[factor][1:]:
                labels = (measure, factor, level, factors[factor][0])
                rng = np.random.default_rng([seed, len(contrasts)])
                contrast = _contrast(cells, labels, factor in between, rng)
                if contrast is not None:
                    contrasts.append(_with_model(contrast, rows, varied, between, remarks))
    remark_lines = tuple(f"{', '.join(names).replace('_', ' ')}: {remark}" for remark, names in remarks.items())
    interactions = interactions_of(cells_of, factors, between)
    return Statistics(_with_corrected_p(contrasts), interactions, remark_lines)


_NO_MODEL_REMARK = "users differ too little to fit a mixed model; only the bootstrap interval is given"
_NOT_CONVERGED_REMARK = "the mixed model did not converge; only the bootstrap interval is given"


def _with_model(
    c: Contrast, rows: Any, varied: Sequence[str], between: Sequence[str], remarks: dict[str, list[str]]
) -> Contrast:
    """The contrast with the results of the mixed model added."""
    groups = rows.groupby([name for name in varied if name in between]).ngroups if c.factor in between else 1
    others = [name for name in varied if name != c.factor]
    fit: Fit = fit_mixed_model(
        rows, c.measure, c.factor, (c.level, c.reference), others, c.users - groups, c.factor not in between
    )
    remark = _NOT_CONVERGED_REMARK if fit.doubtful else _NO_MODEL_REMARK if not np.isfinite(fit.p) else ""
    if remark:
        remarks.setdefault(remark, []).append(f"{c.measure} with {c.level}")
    return replace(c, model=fit.estimate, model_low=fit.low, model_high=fit.high, p=fit.p)


def _contrast(cells: Any, names: tuple[str, str, str, str], between: bool, rng: np.random.Generator) -> Contrast | None:
    """Difference, interval and effect size, from users' means in every condition; None if a level has no users."""
    measure, factor, level, reference = names
    table = cells.unstack(factor)
    if level not in table or reference not in table:
        return None
    if between:
        one, other = (table[name].dropna().groupby(level="user").mean() for name in (level, reference))
        samples: tuple[Array, ...] = (one.to_numpy(), other.to_numpy())
        effect, agree, users = hedges_g(*samples), 0, len(one) + len(other)
    else:
        pairs = table[[level, reference]].dropna().groupby(level="user").mean()
        one, other = pairs[level], pairs[reference]
        samples = ((one - other).to_numpy(),)
        effect, users = cohen_dz(samples[0]), len(one)
        agree = int(np.sum(np.sign(samples[0]) == np.sign(np.mean(samples[0])))) if users else 0
    if not (len(one) and len(other)):
        return None
    return Contrast(
        measure, factor, level, reference, users, float(one.mean()), float(other.mean()), float(_difference(*samples)),
        *bootstrap_interval(samples, rng), *_difference_range(table, level, reference), *NO_FIT[:4], p_holm=np.nan,
        effect=effect, agree=agree,
    )  # fmt: skip


def _difference_range(table: Any, level: str, reference: str) -> tuple[float, float]:
    others = [name for name in table.index.names if name != "user"]
    means = table.groupby(level=others).mean() if others else table
    differences = means[level] - means[reference] if others else means[level].mean() - means[reference].mean()
    return float(np.min(differences)), float(np.max(differences))


def bootstrap_interval(samples: tuple[Array, ...], rng: np.random.Generator) -> tuple[float, float]:
    """BCa bootstrap interval of a mean, or of the difference of two; NaN for few samples, all alike, or infinite."""
    from scipy.stats import bootstrap

    finite = all(len(sample) > 2 and np.all(np.isfinite(sample)) for sample in samples)
    if not (finite and any(map(has_spread, samples))):
        return float("nan"), float("nan")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a degenerate sample has the interval NaN, and is shown so
        ends = bootstrap(
            samples, _difference, n_resamples=N_RESAMPLES, confidence_level=CONFIDENCE_LEVEL, rng=rng, method="BCa"
        )
    return float(ends.confidence_interval.low), float(ends.confidence_interval.high)


def _difference(*samples: Array, axis: int = -1) -> Array:
    """Difference of the means of two samples, or mean of one sample of paired differences."""
    means = [np.mean(sample, axis=axis) for sample in samples]
    return means[0] if len(means) == 1 else means[0] - means[1]


def _with_corrected_p(found: Sequence[Contrast]) -> tuple[Contrast, ...]:
    from statsmodels.stats.multitest import multipletests

    tested = [k for k, contrast in enumerate(found) if np.isfinite(contrast.p)]
    contrasts = list(found)
    if tested:
        corrected = multipletests([found[k].p for k in tested], method="holm")[1]
        for k, p in zip(tested, np.asarray(corrected, dtype=np.float64), strict=True):
            contrasts[k] = replace(found[k], p_holm=float(p))
    return tuple(contrasts)
