"""The force command: what the tank cuts changes no faster than the limiter allows, and its work is booked."""

import numpy as np
import pytest

from controllers.safety.command import command_force
from controllers.safety.energy_tank import TANK_ENERGY, EnergyTank
from controllers.safety.limiter import ForceLimiter
from sim.world.encoders import plausibility


def test_force_cut_by_the_tank_obeys_the_slew_limit_and_its_work_is_booked() -> None:
    """8 N, cut by a tank without energy, fall by the slew per tick, and the work of these ticks is booked."""
    limiter, tank = ForceLimiter(1e-3), EnergyTank(1e-3, power=1e-9, capacity=1.0)
    memory, store, faults = limiter.fresh_memory(), tank.fresh_memory(), plausibility(1e-3).fresh()
    hand, wrench, force, forces = np.zeros(15), np.array([8.0, 0, 0, 0, 0, 0]), np.zeros(3), []
    for k in range(40):
        hand[0], hand[1], hand[8] = 1e-3 * k, 0.5e-3 * k, 0.5
        if k == 20:
            store[TANK_ENERGY] = 0.0
        command_force(limiter.limits(), memory, tank.params(), store, faults, hand, wrench, force)
        forces.append(force.copy())
        if k == 21:
            np.testing.assert_allclose(store[TANK_ENERGY], -(forces[19][0] + forces[20][0]) * 0.5e-3, rtol=1e-6)
    forces = np.array(forces)
    assert forces[19][0] == pytest.approx(8.0)
    assert forces[22][0] == pytest.approx(0.0, abs=1e-3)
    steps = np.linalg.norm(np.diff(forces, axis=0, prepend=np.zeros((1, 3))), axis=1)
    assert steps.max() == pytest.approx(5.0)
