"""The energy tank bounds the energy that a field injects and does not affect dissipating forces."""

import numpy as np
import pytest

from controllers.errors import ParameterError
from controllers.safety.energy_tank import TANK_ENERGY, TANK_SCALE, EnergyTank, limit_power, river_power, spring_store

TANK = EnergyTank(1e-3, power=0.02, capacity=0.05)


def _push_a_mass(tank, law, seconds, mass=0.1):
    """Energy injected up to each tick, and speeds, of a mass under a force law guarded by the tank."""
    memory, params, period = tank.fresh_memory(), tank.params(), tank.period
    p, v, force = np.zeros(3), np.array([0.01, 0.0, 0.0]), np.zeros(3)
    injected, speeds = [0.0], []
    for _ in range(round(seconds / period)):
        force[:] = law(p, v)
        limit_power(params, memory, p, v, force)
        step = v * period + 0.5 * force / mass * period**2
        injected.append(injected[-1] + force @ step)
        p, v = p + step, v + force / mass * period
        speeds.append(np.linalg.norm(v))
    return np.array(injected), np.array(speeds)


@pytest.mark.parametrize("period", [2.5e-4, 1e-3, 4e-3])
def test_active_field_injects_at_most_its_budget(period):
    tank = EnergyTank(period, 0.02, 0.05)
    injected, _ = _push_a_mass(tank, lambda p, v: 5.0 * v, 3.0)
    time = period * np.arange(len(injected))
    assert injected[-1] > 0.5 * (0.05 + 0.02 * 3.0)
    # The change of speed over a period is accounted for one period late.
    assert np.all(injected <= 0.05 + 0.02 * time + 1e-3)
    unlimited = EnergyTank(period, 1e6, 1e6)
    assert _push_a_mass(unlimited, lambda p, v: 5.0 * v, 0.2)[0][-1] > 5.0


def test_dissipating_force_is_unchanged():
    memory = TANK.fresh_memory()
    memory[TANK_ENERGY] = 0.0
    for v in ([-0.3, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.5, 0.0]):
        force = np.array([2.0, 0.0, 0.0])
        limit_power(TANK.params(), memory, np.zeros(3), np.array(v), force)
        assert force.tolist() == [2.0, 0.0, 0.0]


def test_overdrawn_tank_scales_the_force_down_and_refills():
    """Whatever the sign of the power: at e = −P τ nothing passes, at −P τ/2 half of the force."""
    for energy, share in ((-1.0, 0.0), (-0.02 * 0.05, 0.0), (-0.01 * 0.05, 0.5), (-1e-12, 1.0)):
        memory = TANK.fresh_memory()
        memory[TANK_ENERGY] = energy
        force = np.array([2.0, 0.0, 0.0])
        limit_power(TANK.params(), memory, np.zeros(3), np.array([-0.3, 0.0, 0.0]), force)
        assert force[0] == pytest.approx(2.0 * share, abs=1e-8)
        assert memory[TANK_SCALE] == pytest.approx(share, abs=1e-8)
    memory = TANK.fresh_memory()
    memory[TANK_ENERGY] = -0.001
    for _ in range(26):
        limit_power(TANK.params(), memory, np.zeros(3), np.zeros(3), np.zeros(3))
    assert memory[TANK_ENERGY] == pytest.approx(-0.0005, rel=1e-9)


def test_vanishing_speed_leaves_the_force_unchanged():
    memory = TANK.fresh_memory()
    for speed in (1e-300, 1e-12, 1e-3):
        force = np.array([3.0, 0.0, 0.0])
        limit_power(TANK.params(), memory, np.zeros(3), np.array([speed, 0.0, 0.0]), force)
        assert force[0] == 3.0


def test_stored_energy_changes_by_flows_only():
    memory, p, v = TANK.fresh_memory(), np.zeros(3), np.array([0.1, 0.0, 0.0])
    force = np.array([0.5, 0.0, 0.0])
    limit_power(TANK.params(), memory, p, v, force)
    assert memory[TANK_ENERGY] == 0.05
    limit_power(TANK.params(), memory, p + 0.002, v, force)
    assert memory[TANK_ENERGY] == pytest.approx(0.05 - 0.5 * 0.002 + 0.02e-3, rel=1e-12)
    limit_power(TANK.params(), memory, p - 0.5, v, np.zeros(3))
    assert memory[TANK_ENERGY] == 0.05


def test_empty_tank_passes_its_power_continuously():
    memory = TANK.fresh_memory()
    memory[TANK_ENERGY] = 0.0
    powers = []
    for speed in np.linspace(0.009, 0.011, 5):
        force = np.array([2.0, 0.0, 0.0])
        limit_power(TANK.params(), memory.copy(), np.zeros(3), np.array([speed, 0.0, 0.0]), force)
        powers.append(force[0] * speed)
    np.testing.assert_allclose(powers, [0.018, 0.019, 0.02, 0.02, 0.02], rtol=1e-12)


@pytest.mark.parametrize(
    "numbers", [(0.0, 1.0, 1.0, 1.0), (1e-3, np.inf, 1.0, 1.0), (1e-3, 1.0, 1.0, 1e-3), (1e-3, 1.0, 1.0, 0.05, 2.0)]
)
def test_invalid_tanks_raise_parameter_error(numbers):
    with pytest.raises(ParameterError, match="tank"):
        EnergyTank(*numbers)


def test_spring_store_and_river_power_match_numerical_work():
    """∫ min(k s, F) ds by quadrature, and the maximum of b (φ̇ − v) v by a search."""
    distance = np.linspace(0.0, 0.2, 200_001)
    for stiffness, force in ((300.0, 8.5), (300.0, np.inf), (20.0, 8.5), (0.0, 8.5), (1e9, 8.5)):
        expected = np.trapezoid(np.minimum(stiffness * distance, force), distance)
        assert spring_store(stiffness, 0.2, force) == pytest.approx(expected, abs=1e-5 * expected + 1e-9)
    assert spring_store(np.inf, 0.2, 8.5) == 0.2 * 8.5
    speed = np.linspace(-0.2, 0.2, 4001)
    assert river_power(8.0, 0.075) == pytest.approx((8.0 * (0.075 - speed) * speed).max(), rel=1e-6)
