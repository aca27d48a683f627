"""What the factors of a study do to its measures: mixed models, bootstrap intervals, effect sizes, Holm's correction.

For every measure one linear mixed model with the factors as fixed effects and a random intercept by user,

    y_ij = β₀ + Σ_f β_f[level] + u_i + e_ij,   u_i ~ N(0, σ_u²),   e_ij ~ N(0, σ²)

(statsmodels, REML); the first level of a factor is what the others are held against. Beside it, without a model: the
difference of users' means with its BCa bootstrap interval over users (scipy), and the standardised difference: Cohen's
d_z of paired differences within users, Hedges' g between them. The p values of all contrasts of all measures together
are corrected by Holm's method.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from controllers.state import Array

LEVEL = 0.95
RESAMPLES = 4999
ALIKE = (
    1e-6  # spread over size of differences that are one number, written many times: nothing is known of their spread
)


@dataclass(frozen=True)
class Contrast:
    """A level of a factor against its first one, on one measure.

    Attributes
    ----------
    measure, factor, level, reference : str
        What is compared.
    users : int
        On how many users it rests.
    mean, reference_mean : float
        Means of users' means.
    difference : float
        Of these.
    low, high : float
        Its bootstrap interval.
    model, model_low, model_high, p, p_holm : float
        The mixed model's estimate and interval, its p (Wald), and that corrected; NaN where the model has none.
    effect : float
        d_z or g.
    agree : int
        Users whose own difference has the sign of the mean; of a factor between users 0.
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
    model: float
    model_low: float
    model_high: float
    p: float
    p_holm: float
    effect: float
    agree: int


@dataclass(frozen=True)
class Statistics:
    """All contrasts, and what is to be said of how they were found.

    Attributes
    ----------
    contrasts : tuple of Contrast
        By measure, factor and level.
    interactions : dict of str to float
        By measure, p of the likelihood ratio of the factors' interactions (maximum likelihood).
    remarks : tuple of str
        Where a model did not converge, and the like.
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
        Of `experiments.trials.analysis.tidy.table`; trials that failed are left out.
    factors : mapping of str to sequence of str
        Names of levels, the reference first.
    between : sequence of str
        Factors between users.
    measures : sequence of str
        Columns.
    seed : int
        Of the bootstrap.
    """
    found: list[Contrast] = []
    interactions: dict[str, float] = {}
    remarks: dict[str, list[str]] = {}
    for measure in measures:
        rows = frame[frame["state"].eq("done") & frame[measure].notna()]
        if len(rows) < 3 or not np.ptp(rows[measure].to_numpy()) > 0.0:
            continue
        varied = {name: levels for name, levels in factors.items() if rows[name].nunique() > 1}
        fits, interaction = _models(rows, measure, varied, remarks) if varied else ({}, None)
        if interaction is not None:
            interactions[measure] = interaction
        for factor, levels in varied.items():
            for level in levels[1:]:
                fit = fits.get((factor, level), (np.nan, np.nan, np.nan, np.nan))
                rng = np.random.default_rng([seed, len(found)])
                made = _contrast(rows, (measure, factor, level, levels[0]), factor in between, fit, rng)
                if made is not None:
                    found.append(made)
    told = tuple(f"{', '.join(names).replace('_', ' ')}: {remark}" for remark, names in remarks.items())
    return Statistics(_corrected(found), interactions, told)


_Fit = tuple[float, float, float, float]
_NO_MODEL = "users differ by nothing that a mixed model could be fitted to; the bootstrap intervals stand alone"
_DOUBTFUL = "the mixed model did not converge well, or finds no variance between users; believe the bootstrap intervals"


def _models(
    rows: Any, measure: str, factors: Mapping[str, Sequence[str]], remarks: dict[str, list[str]]
) -> tuple[dict[tuple[str, str], _Fit], float | None]:
    """Estimate, interval and p by factor and level, and p of the interactions."""
    import statsmodels.formula.api as smf
    from scipy.stats import chi2

    values = rows[measure].to_numpy()
    centre, scale = float(values.mean()), float(values.std())
    data = rows.assign(_y=(values - centre) / scale)
    terms = {name: f"C(Q({name!r}), Treatment({levels[0]!r}))" for name, levels in factors.items()}
    try:
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            model = smf.mixedlm("_y ~ " + " + ".join(terms.values()), data, groups="user").fit(reml=True)
            ends = model.conf_int(1.0 - LEVEL)
            interaction = _interaction(data, list(terms.values()), smf, chi2) if len(terms) > 1 else None
    except (np.linalg.LinAlgError, ValueError):
        remarks.setdefault(_NO_MODEL, []).append(measure)
        return {}, None
    if told:
        remarks.setdefault(_DOUBTFUL, []).append(measure)
    fits: dict[tuple[str, str], _Fit] = {}
    for factor, levels in factors.items():
        for level in levels[1:]:
            name = f"{terms[factor]}[T.{level}]"
            if name in model.params.index:
                low, high = (scale * float(end) for end in ends.loc[name])
                fits[factor, level] = (scale * float(model.params[name]), low, high, float(model.pvalues[name]))
    return fits, interaction


def _interaction(data: Any, terms: Sequence[str], smf: Any, chi2: Any) -> float:
    whole, main = (
        smf.mixedlm("_y ~ " + sign.join(terms), data, groups="user").fit(reml=False) for sign in (" * ", " + ")
    )
    freedom = len(whole.fe_params) - len(main.fe_params)
    return float(chi2.sf(max(0.0, 2.0 * (whole.llf - main.llf)), freedom))


def _contrast(
    rows: Any, of: tuple[str, str, str, str], between: bool, fit: _Fit, rng: np.random.Generator
) -> Contrast | None:
    from scipy.stats import bootstrap

    measure, factor, level, reference = of
    means = rows.groupby([factor, "user"])[measure].mean()
    if level not in means.index or reference not in means.index:
        return None
    one, other = means[level], means[reference]
    samples: tuple[Array, ...] = (one.to_numpy(), other.to_numpy()) if between else ((one - other).dropna().to_numpy(),)
    if between:
        effect, agree = hedges_g(*samples), 0
    else:
        effect, agree = cohen_dz(samples[0]), int(np.sum(np.sign(samples[0]) == np.sign(np.mean(samples[0]))))
    difference = float(_difference(*samples))
    low = high = np.nan
    if all(len(sample) > 2 for sample in samples) and any(map(_spreads, samples)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a degenerate sample, whose interval is then NaN and shown as such
            ends = bootstrap(samples, _difference, n_resamples=RESAMPLES, confidence_level=LEVEL, rng=rng, method="BCa")
        low, high = (float(end) for end in ends.confidence_interval)
    users = len(samples[0]) if not between else len(one) + len(other)
    return Contrast(
        measure, factor, level, reference, users, float(one.mean()), float(other.mean()), difference, low, high, *fit,
        p_holm=np.nan, effect=effect, agree=agree,
    )  # fmt: skip


def _difference(*samples: Array, axis: int = -1) -> Array:
    """Of the means of two samples, or the mean of one of paired differences."""
    means = [np.mean(sample, axis=axis) for sample in samples]
    return means[0] if len(means) == 1 else means[0] - means[1]


def _spreads(sample: Array) -> bool:
    return bool(np.ptp(sample) > ALIKE * np.max(np.abs(sample)))


def cohen_dz(differences: Array) -> float:
    """Mean over standard deviation of paired differences (J. Cohen, *Statistical Power Analysis*, 1988)."""
    spread = float(np.std(differences, ddof=1)) if len(differences) > 1 else 0.0
    mean = float(np.mean(differences)) if len(differences) else 0.0
    return mean / spread if spread > ALIKE * abs(mean) else float("nan")


def hedges_g(one: Array, other: Array) -> float:
    """Difference of means over the pooled standard deviation, corrected for small samples (L. V. Hedges, 1981)."""
    freedom = len(one) + len(other) - 2
    if freedom < 1:
        return float("nan")
    pooled = np.sqrt(((len(one) - 1) * np.var(one, ddof=1) + (len(other) - 1) * np.var(other, ddof=1)) / freedom)
    return (
        float((np.mean(one) - np.mean(other)) / pooled * (1.0 - 3.0 / (4.0 * freedom - 1.0))) if pooled > 0 else np.nan
    )


def _corrected(found: Sequence[Contrast]) -> tuple[Contrast, ...]:
    from dataclasses import replace

    from statsmodels.stats.multitest import multipletests

    tested = [k for k, contrast in enumerate(found) if np.isfinite(contrast.p)]
    made = list(found)
    if tested:
        corrected = multipletests([found[k].p for k in tested], method="holm")[1]
        for k, p in zip(tested, np.asarray(corrected, dtype=np.float64), strict=True):
            made[k] = replace(found[k], p_holm=float(p))
    return tuple(made)
