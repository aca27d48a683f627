"""The force limiter: magnitude, direction, slew rate, heat and the fault latch."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controllers.errors import ParameterError
from controllers.safety.faults import FORCE_NOT_FINITE
from controllers.safety.limiter import LIMITER_FAULT, ForceLimiter, limit_force

FAST = ForceLimiter(period=1e-3, slew=1e9)


def _limit(limiter, memory, force):
    out = np.empty(3)
    limit_force(limiter.limits(), memory, np.concatenate([force, np.zeros(3)]), out)
    return out


def test_small_force_is_unchanged():
    np.testing.assert_array_equal(_limit(FAST, FAST.fresh_memory(), [0.3, -0.4, 0.5]), [0.3, -0.4, 0.5])


@settings(max_examples=100)
@given(st.tuples(*[st.floats(-1e200, 1e200)] * 3))
def test_force_is_limited_to_the_peak_in_its_direction(force):
    out = _limit(FAST, FAST.fresh_memory(), force)
    assert np.linalg.norm(out) <= 8.5 * (1 + 1e-12)
    scale = max(np.abs(force))
    if scale > 0.0:
        a, b = np.array(force) / scale, out / np.abs(out).max()
        np.testing.assert_allclose(a, b, atol=1e-9)


def test_non_finite_moment_is_a_fault():
    memory, out = FAST.fresh_memory(), np.ones(3)
    limit_force(FAST.limits(), memory, np.array([0.3, 0.0, 0.0, 0.0, np.nan, 0.0]), out)
    assert memory[LIMITER_FAULT] == FORCE_NOT_FINITE
    np.testing.assert_array_equal(out, 0.0)


def test_sustained_force_falls_to_the_continuous_force_and_recovers():
    memory, limiter = FAST.fresh_memory(), ForceLimiter(period=0.1, slew=1e9)
    forces = [np.linalg.norm(_limit(limiter, memory, [0.0, 20.0, 0.0])) for _ in range(2000)]
    assert forces[0] == pytest.approx(8.5)
    assert (np.diff(forces) <= 1e-9).all()
    assert forces[-1] == pytest.approx(1.5, rel=1e-3)
    rested = [_limit(limiter, memory, [0.0, 0.0, 0.0]) for _ in range(2000)]
    assert np.abs(rested).max() == 0.0
    assert np.linalg.norm(_limit(limiter, memory, [0.0, 20.0, 0.0])) == pytest.approx(8.5, rel=1e-3)


def test_mean_square_stays_below_the_continuous_force():
    rng, memory, limiter = np.random.default_rng(0), FAST.fresh_memory(), ForceLimiter(period=0.01, slew=1e9)
    squares = [float(np.sum(_limit(limiter, memory, rng.normal(size=3) * 30.0) ** 2)) for _ in range(20000)]
    assert np.mean(squares[5000:]) <= 1.5**2 * 1.001


def test_force_changes_by_at_most_the_slew_per_tick():
    limiter = ForceLimiter(period=1e-3, slew=1000.0)
    memory, last, rng = limiter.fresh_memory(), np.zeros(3), np.random.default_rng(1)
    for _ in range(200):
        force = _limit(limiter, memory, rng.normal(size=3) * 5.0)
        assert np.linalg.norm(force - last) <= 1.0 + 1e-9
        last = force


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_non_finite_force_is_latched_as_a_fault(bad):
    memory = FAST.fresh_memory()
    _limit(FAST, memory, [1.0, 0.0, 0.0])
    assert not _limit(FAST, memory, [0.0, bad, 0.0]).any()
    assert memory[LIMITER_FAULT] == FORCE_NOT_FINITE
    assert not _limit(FAST, memory, [1.0, 0.0, 0.0]).any()
    assert _limit(FAST, FAST.fresh_memory(), [1.0, 0.0, 0.0]).any()


@pytest.mark.parametrize("values", [{"period": 0.0}, {"peak": np.nan}, {"slew": -1.0}, {"continuous": 9.0}])
def test_invalid_limits_raise_parameter_error(values):
    with pytest.raises(ParameterError, match=str(next(iter(values.values())))):
        ForceLimiter(**{"period": 1e-3} | values)
