"""Kernels compiled, in Python and symbolically by ``.py_func`` on CasADi; curves and rotations by SciPy."""

import casadi
import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from controllers.curves.trajectory import Trajectory, curve_point, curve_velocity
from controllers.fields.algebra.weights import window
from controllers.fields.bunny import gaussian
from controllers.fields.follow import follow_force
from controllers.fields.higher_order import mismatch
from controllers.safety.limiter import force_ceiling
from geometry import rotations
from geometry.easing import smooth_step

casadi.GlobalOptions.setNumpyMode(1)
RNG = np.random.default_rng(5)


def _symbolic(kernel, arity):
    symbols = [casadi.SX.sym(f"x{i}") for i in range(arity)]
    result = kernel.py_func(*symbols)
    return casadi.Function("law", symbols, list(result) if isinstance(result, tuple) else [result])


@pytest.mark.parametrize(
    ("kernel", "arity"),
    [
        (follow_force, 6),
        (window, 1),
        (gaussian, 2),
        (mismatch, 4),
        (smooth_step, 1),
        (force_ceiling, 3),
        (rotations.multiply, 8),
        (rotations.relative, 8),
        (rotations.rotate, 7),
        (rotations.exponential, 3),
        (rotations.logarithm, 4),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_compiled_kernel_matches_casadi_and_python(kernel, arity):
    symbolic = _symbolic(kernel, arity)
    for _ in range(30):
        arguments = RNG.uniform(0.1, 1.0, arity)
        expected = np.ravel([float(v) for v in np.atleast_1d(np.array(symbolic(*arguments), dtype=object)).ravel()])
        np.testing.assert_allclose(np.ravel(kernel(*arguments)), expected, rtol=1e-13)
        np.testing.assert_allclose(np.ravel(kernel(*arguments)), np.ravel(kernel.py_func(*arguments)), rtol=1e-15)


@pytest.mark.parametrize("periodic", [False, True])
def test_compiled_curve_matches_scipy_spline(periodic):
    points = RNG.normal(size=(9, 3))
    points[-1] = points[0] if periodic else points[-1]
    times = np.cumsum(RNG.uniform(0.1, 1.0, 9))
    curve = Trajectory(times, points, periodic=periodic)
    reference = CubicSpline(times, points, bc_type="periodic" if periodic else "natural")
    # At an offset in the array, to test that offsets are respected.
    blob = np.concatenate([np.full(5, np.nan), curve.packed()])
    for t in RNG.uniform(times[0], times[-1], 50):
        np.testing.assert_allclose(curve_point(blob, 5, t), reference(t), atol=1e-13)
        np.testing.assert_allclose(curve_velocity(blob, 5, t), reference(t, 1), atol=1e-11)
        np.testing.assert_allclose(curve.point(t), reference(t), atol=1e-13)
        if periodic:
            np.testing.assert_allclose(curve_point(blob, 5, t + 3 * curve.duration), reference(t), atol=1e-11)


def test_rotations_match_scipy():
    for _ in range(30):
        a, b = Rotation.random(random_state=RNG), Rotation.random(random_state=RNG)
        qa, qb = (np.roll(r.as_quat(), 1) for r in (a, b))
        product = np.array(rotations.multiply(*qa, *qb))
        assert abs(product @ np.roll((a * b).as_quat(), 1)) == pytest.approx(1.0, abs=1e-14)
        np.testing.assert_allclose(rotations.rotate(*qa, 1.0, -2.0, 3.0), a.apply([1.0, -2.0, 3.0]), atol=1e-14)
        np.testing.assert_allclose(rotations.logarithm(*qa), a.as_rotvec(), atol=1e-13)
        np.testing.assert_allclose(rotations.logarithm(*-qa), a.as_rotvec(), atol=1e-13)
        np.testing.assert_allclose(np.abs(rotations.exponential(*a.as_rotvec())), np.abs(qa), atol=1e-14)


@pytest.mark.parametrize("angle", [0.0, 1e-20, 1e-9, 3.1415926])
def test_exponential_and_logarithm_are_inverse_at_delicate_angles(angle):
    vector = angle * np.array([0.6, 0.0, -0.8])
    np.testing.assert_allclose(rotations.logarithm(*rotations.exponential(*vector)), vector, rtol=1e-9, atol=1e-16)
