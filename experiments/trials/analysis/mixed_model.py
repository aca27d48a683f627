"""Linear mixed model of a contrast: how much a level changes a measure, with users as random effects.

For the trials of a level and of the reference,

    y_ij = β₀ + β x_ij + γ[c_ij] + δ[c_ij] x_ij + u_i + v_i x_ij + e_ij,
    u_i ~ N(0, τ²),   v_i ~ N(0, ω²),   e_ij ~ N(0, σ²),

with x = ½ at the level and −½ at the reference; c is the condition of the other factors, with Σ_c γ = Σ_c δ = 0, so
that β is the mean over these conditions also if factors interact. The random slope v_i is used for within-subject
factors only; without it the repetitions of a user would count as independent users (D. J. Barr et al., "Random effects
structure for confirmatory hypothesis testing: Keep it maximal", *Journal of Memory and Language* 68, 2013). Intercepts
and slopes are independent: a correlation estimated from a few users is mostly ±1, which changes p by a third.
Fitted by REML (statsmodels). β over its standard error is compared with Student's t, whose degrees of freedom are the
number of users less one, or less the number of groups (between-within: M. D. Schluchter & J. T. Elashoff, 1990). In a
balanced design this is the paired t test of the users' means, or a more conservative test if users differ in the
effect by less than the scatter of their repetitions implies: the variance of slopes is then estimated as zero.
"""

import warnings
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

CONFIDENCE_LEVEL = 0.95
_OPTIMISERS = ["bfgs", "lbfgs", "powell"]  # tried in turn; Powell needs no gradient where a variance is zero


class Fit(NamedTuple):
    """Fit of the model to a contrast; NaN if the model could not be fitted or the fit did not converge.

    Attributes
    ----------
    estimate, low, high : float
        β with its 95 % confidence interval.
    p : float
        Two-sided p of β = 0.
    doubtful : bool
        Whether the fit did not converge.
    """

    estimate: float
    low: float
    high: float
    p: float
    doubtful: bool


NO_FIT = Fit(float("nan"), float("nan"), float("nan"), float("nan"), False)


def fit_mixed_model(rows: Any, measure: str, factor: str, levels: tuple[str, str], others: Sequence[str], freedom: int,
           within: bool) -> Fit:  # fmt: skip
    """Fit the model.

    Parameters
    ----------
    rows : pandas.DataFrame
        Trials that have the measure.
    measure, factor : str
        Columns of the measure and of the factor.
    levels : tuple of str
        The level and the reference.
    others : sequence of str
        The other factors.
    freedom : int
        Degrees of freedom.
    within : bool
        Whether the factor is within-subject.
    """
    import statsmodels.formula.api as smf
    from scipy.stats import t

    data = rows[rows[factor].isin(levels)]
    data = data.assign(_c=data[list(others)].astype(str).agg(" × ".join, axis=1) if others else "")
    data = data[data.groupby("_c")[factor].transform("nunique") == len(levels)]
    scale = float(data[measure].std())
    if freedom < 1 or not scale > 0.0:
        return NO_FIT
    centre = float(data[measure].mean())
    # The factors' own columns are dropped: a factor named "C" would hide patsy's function C in the formula.
    data = data[["user", "_c"]].assign(_y=(data[measure] - centre) / scale, _x=(data[factor] == levels[0]) - 0.5)
    fixed = "_y ~ _x * C(_c, Sum)" if data["_c"].nunique() > 1 else "_y ~ _x"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a variance of zero, expected for identical people
            slopes = {"slopes": "0 + _x"} if within else None
            model = smf.mixedlm(fixed, data, groups="user", re_formula="~1", vc_formula=slopes)
            result = model.fit(reml=True, method=_OPTIMISERS)
            estimate, standard_error = scale * float(result.params["_x"]), scale * float(result.bse["_x"])
    except (np.linalg.LinAlgError, ValueError):
        return NO_FIT
    if not (np.isfinite(standard_error) and standard_error > 0.0):
        return NO_FIT
    if not result.converged:
        return NO_FIT._replace(doubtful=True)
    half_width = float(t.ppf(0.5 + 0.5 * CONFIDENCE_LEVEL, freedom)) * standard_error
    p = 2.0 * float(t.sf(abs(estimate) / standard_error, freedom))
    return Fit(estimate, estimate - half_width, estimate + half_width, p, False)
