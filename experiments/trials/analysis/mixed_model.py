"""The linear mixed model of a contrast: how much a level changes a measure, when users differ in that, too.

On the trials of a level and of the reference,

    y_ij = β₀ + β x_ij + γ[c_ij] + δ[c_ij] x_ij + u_i + v_i x_ij + e_ij,   (u_i, v_i) ~ N(0, Σ),   e_ij ~ N(0, σ²),

with x = 1 at the level and 0 at the reference; c is the condition of the other factors, with Σ_c γ = Σ_c δ = 0, so
that β is the mean over these conditions, whatever interacts; v_i is for factors within users only: without it a user's
repetitions would count as if they were other users (D. J. Barr et al., "Random effects structure for confirmatory
hypothesis testing: Keep it maximal", *Journal of Memory and Language* 68, 2013). Fitted by REML (statsmodels). β over
its standard error is held against Student's t with the users less one, or less their groups, as degrees of freedom
(between-within: M. D. Schluchter & J. T. Elashoff, 1990); in a balanced design that is the paired t test of the users'
means, or a wider one where the users' variance comes out as zero.
"""

import warnings
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

LEVEL = 0.95
_METHODS = ["bfgs", "lbfgs", "cg", "powell"]  # in turn; the last one needs no gradient at a variance of zero


class Fit(NamedTuple):
    """What the model says of a contrast; NaN where it could not be fitted, or the fit did not converge.

    Attributes
    ----------
    estimate, low, high : float
        β with its 95 % interval.
    p : float
        Of β = 0, two-sided.
    doubtful : bool
        Whether the fit did not converge.
    """

    estimate: float
    low: float
    high: float
    p: float
    doubtful: bool


NO_FIT = Fit(float("nan"), float("nan"), float("nan"), float("nan"), False)


def fitted(rows: Any, measure: str, factor: str, levels: tuple[str, str], others: Sequence[str], freedom: int,
           within: bool) -> Fit:  # fmt: skip
    """Fit the model.

    Parameters
    ----------
    rows : pandas.DataFrame
        Trials that have the measure.
    measure, factor : str
        Columns.
    levels : tuple of str
        The level, and the reference.
    others : sequence of str
        The other factors.
    freedom : int
        Degrees of freedom.
    within : bool
        Whether the users meet both levels.
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
    data = data.assign(_y=(data[measure] - centre) / scale, _x=(data[factor] == levels[0]).astype(float))
    fixed = "_y ~ _x * C(_c, Sum)" if data["_c"].nunique() > 1 else "_y ~ _x"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a variance at zero, where it belongs for people who are alike
            made = smf.mixedlm(fixed, data, groups="user", re_formula="~_x" if within else "~1")
            model = made.fit(reml=True, method=_METHODS)
            estimate, error = scale * float(model.params["_x"]), scale * float(model.bse["_x"])
    except (np.linalg.LinAlgError, ValueError):
        return NO_FIT
    if not (np.isfinite(error) and error > 0.0):
        return NO_FIT
    if not model.converged:
        return NO_FIT._replace(doubtful=True)
    reach = float(t.ppf(0.5 + 0.5 * LEVEL, freedom)) * error
    p = 2.0 * float(t.sf(abs(estimate) / error, freedom))
    return Fit(estimate, estimate - reach, estimate + reach, p, False)
