"""The descent within bounds, on problems whose minimum is known or found by SciPy."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear, minimize

from controllers.haptic_map.lifting.bounded_descent import Expansion, minimise


def test_bounded_linear_least_squares_match_scipy() -> None:
    rng = np.random.default_rng(0)
    for _ in range(5):
        matrix, wanted = rng.normal(size=(40, 20)), rng.normal(size=40)

        def squares(x, matrix=matrix, wanted=wanted):
            error = matrix @ x - wanted
            return Expansion(0.5 * float(error @ error), matrix.T @ error, matrix.T @ matrix)

        low, high = np.full(20, -0.1), np.full(20, 0.1)
        x, value = minimise(squares, np.zeros(20), low, high)
        expected = lsq_linear(matrix, wanted, (low, high), tol=1e-14)
        assert value == pytest.approx(expected.cost, rel=1e-9)
        np.testing.assert_allclose(x, expected.x, atol=1e-5)
        assert ((x == low) | (x == high)).any()


@pytest.mark.parametrize("upper", [2.0, 0.5])
def test_curved_valley_is_followed_to_its_bounded_minimum(upper: float) -> None:
    """Rosenbrock's function with the curvature of Gauss and Newton; its minimum is at 1, 1."""

    def valley(x):
        residuals = np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]])
        jacobian = np.array([[-20.0 * x[0], 10.0], [-1.0, 0.0]])
        return Expansion(0.5 * float(residuals @ residuals), jacobian.T @ residuals, jacobian.T @ jacobian)

    low, high = np.array([-2.0, -2.0]), np.array([upper, 2.0])
    x, value = minimise(valley, np.array([-1.2, 1.0]), low, high)
    expected = minimize(
        lambda x: valley(x).value, [-1.2, 1.0], jac=lambda x: valley(x).gradient, method="L-BFGS-B",
        bounds=list(zip(low, high, strict=True)), options={"ftol": 1e-15, "gtol": 1e-12, "maxiter": 10000},
    )  # fmt: skip
    assert value == pytest.approx(expected.fun, rel=1e-8, abs=1e-12)
    np.testing.assert_allclose(x, [min(upper, 1.0), min(upper, 1.0) ** 2], atol=1e-5)
