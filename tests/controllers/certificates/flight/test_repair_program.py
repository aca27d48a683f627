"""The nonlinear program that repairs flights, on jumps whose fall is not at g."""

import numpy as np
import pytest

from controllers.certificates.flight.repair import RepairError, RepairTask, repair
from controllers.errors import ParameterError

FPS = 60.0
FLIGHT = (30, 54)


def task(gravity, **changes):
    n, (a, b) = 90, FLIGHT
    t = np.clip(np.arange(n) - a, 0, b - a) / FPS
    com = np.column_stack([0.5 * t, 0.0 * t, 0.9 + gravity / 2 * t * ((b - a) / FPS - t)])
    flying = (np.arange(n) > a) & (np.arange(n) < b)
    arguments = {
        "fps": FPS, "com": com, "angular": np.tile([0.0, -10.0, 0.0], (n, 1)),
        "clearance": np.where(flying, com[:, 2] - 0.9, 0.0), "flights": [FLIGHT],
        "legs": np.tile([[0.0, 0.1, -0.8], [0.0, -0.1, -0.8]], (n, 1, 1)),
        "standing": np.repeat(~flying[:, None], 2, axis=1), "leg_length": 0.86, "held": (True, True),
    }  # fmt: skip
    return RepairTask(**arguments | changes)


@pytest.mark.parametrize("gravity", [4.0, 9.81, 20.0, 60.0])
def test_repaired_flights_fall_at_g_and_contacts_stay_within_leg_length(gravity):
    before = task(gravity)
    plan = repair(before)
    a, b = FLIGHT
    t = (plan.times[a : b + 1] - plan.times[a])[:, None]
    (p, v), com = plan.falls[0], before.com + plan.shift
    assert com[a : b + 1] == pytest.approx(p + v * t - [0, 0, 4.905] * t**2, abs=1e-6)
    assert np.linalg.norm(before.legs - plan.shift[:, None], axis=2)[before.standing].max() <= 0.86
    assert np.all(np.diff(plan.times) > 0.0)
    assert plan.shift[[0, -1]] == pytest.approx(np.zeros((2, 3)), abs=1e-8)
    assert (com - before.com)[a + 1 : b, 2].min() >= -before.clearance[a + 1 : b].max() - 1e-6
    steps = np.diff(plan.times)
    rise = np.diff(np.diff(com[:, 2]) / steps) / ((steps[1:] + steps[:-1]) / 2)
    assert rise.min() >= -9.81 - 1e-4


def test_natural_fall_is_almost_unchanged():
    plan = repair(task(9.81))
    assert np.linalg.norm(plan.shift, axis=1).max() < 0.02
    assert plan.times[-1] == pytest.approx(89 / FPS, rel=0.05)


def test_fast_fall_is_repaired_by_duration_rather_than_height():
    plan = repair(task(60.0))
    flight = plan.times[FLIGHT[1]] - plan.times[FLIGHT[0]]
    assert flight == pytest.approx(24 / FPS * np.sqrt(60.0 / 9.81), rel=0.15)
    assert np.linalg.norm(plan.shift, axis=1).max() < 0.2


def test_infeasible_repair_raises_repair_error():
    # Three frames: both ends are held, and the middle one would have to be below the floor.
    com = np.array([[0.0, 0.0, 0.9], [0.0, 0.0, 1.5], [0.0, 0.0, 0.9]])
    arrays = {"angular": np.zeros((3, 3)), "clearance": np.zeros(3), "standing": np.zeros((3, 2), dtype=bool)}
    with pytest.raises(RepairError, match="flights"):
        repair(task(9.81, com=com, flights=[(0, 2)], legs=np.zeros((3, 2, 3)), **arrays))


def test_invalid_tasks_raise_parameter_error():
    with pytest.raises(ParameterError, match="flight"):
        task(9.81, flights=[(30, 90)])
    with pytest.raises(ParameterError, match="standing"):
        task(9.81, standing=np.zeros((90, 3), dtype=bool))


def test_casadi_numpy_mode_of_the_caller_is_restored_and_does_not_matter() -> None:
    import casadi

    mode_before = casadi.GlobalOptions.getNumpyMode()
    try:
        for mode in (0, 1):
            casadi.GlobalOptions.setNumpyMode(mode)
            test_natural_fall_is_almost_unchanged()
            assert casadi.GlobalOptions.getNumpyMode() == mode
    finally:
        casadi.GlobalOptions.setNumpyMode(mode_before)
