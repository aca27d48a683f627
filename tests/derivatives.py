"""Central differences, against which tests check analytic derivatives."""

from collections.abc import Callable

import numpy as np


def central_differences(function: Callable, x: object, step: float, subtract: Callable = np.subtract) -> np.ndarray:
    """Derivative of a function at x, (f(x + step) − f(x − step)) / (2 step).

    Parameters
    ----------
    function : callable
        Of one argument like x, with an array of any shape as its value.
    x : float or array_like (n,)
        Where: of a number the derivative has the shape of the value, of a vector one column more, (..., n).
    step : float
        Step to either side, in the unit of x.
    subtract : callable
        Difference of two values: another one than ``np.subtract`` for values on a manifold.

    Returns
    -------
    np.ndarray
        The derivative, with the derivatives along the components of x on the last axis.
    """
    x = np.asarray(x, dtype=float)

    def along(direction: np.ndarray | float) -> np.ndarray:
        return subtract(function(x + step * direction), function(x - step * direction)) / (2.0 * step)

    return along(1.0) if x.ndim == 0 else np.stack([along(unit) for unit in np.eye(len(x))], axis=-1)


def extrapolated_differences(
    function: Callable, x: object, step: float, subtract: Callable = np.subtract
) -> np.ndarray:
    """Derivative as `central_differences` of step and 2 step, extrapolated: the error goes with step⁴ (Richardson)."""
    near, far = (central_differences(function, x, k * step, subtract) for k in (1, 2))
    return (4.0 * near - far) / 3.0
