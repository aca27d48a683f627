"""Curves that make up for what the device costs: how much it is, and what speed they ask for."""

import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from experiments.setups.pace import friction_along, inertia_along, paced
from models.phantom.dynamics import coriolis_matrix, mass_matrix
from models.scene import PHANTOM
from sim.errors import SimError
from sim.world.world import World, phantom_angles

CURVE = Trajectory.circle(0.05, 2.2, (0.0, 0.0, 0.01))


def test_friction_takes_the_power_that_mujoco_s_joints_lose():
    model = World().model
    dofs = [int(model.joint(PHANTOM + name).dofadr[0]) for name in ("theta1", "theta2", "theta3")]
    phases, step = np.linspace(0.1, 2.0, 7), 1e-5
    for phase, force in zip(phases, friction_along(CURVE, phases), strict=True):
        ahead, behind = (np.array(phantom_angles(CURVE.point(phase + d))) for d in (step, -step))
        rates = (ahead - behind) / (2.0 * step)
        loss = np.abs(rates) @ model.dof_frictionloss[dofs] + rates**2 @ model.dof_damping[dofs]
        assert force == pytest.approx(loss / np.linalg.norm(CURVE.velocity(phase)), rel=1e-6)
        assert 0.03 < force < 0.15


def test_inertia_takes_the_force_of_the_linkage_s_equations_of_motion():
    phases, step = np.linspace(0.1, 2.0, 7), 1e-4
    waved = Trajectory.circle(0.05, 2.2, (0.0, 0.0, 0.01), wave=0.01)
    for phase, force in zip(phases, inertia_along(waved, phases), strict=True):
        behind, theta, ahead = (np.array(phantom_angles(waved.point(phase + d))) for d in (-step, 0.0, step))
        rates, acceleration = (ahead - behind) / (2.0 * step), (ahead - 2.0 * theta + behind) / step**2
        M, C = mass_matrix.py_func(tuple(theta)), coriolis_matrix.py_func(tuple(theta), tuple(rates))
        power = rates @ (np.array(M) @ acceleration + np.array(C) @ rates)
        assert force == pytest.approx(power / np.linalg.norm(waved.velocity(phase)), rel=2e-3, abs=2e-5)
    assert np.ptp(inertia_along(CURVE, phases)) > 0.02


def test_the_speed_that_is_asked_for_is_that_of_the_curve_and_what_the_device_costs():
    found = paced(CURVE, 8.0)
    assert found.periodic
    np.testing.assert_array_equal(found.positions, CURVE.positions)
    own = np.asarray(CURVE.times)
    middles = 0.5 * (own[1:] + own[:-1])
    asked = np.linalg.norm(np.diff(CURVE.point(own), axis=0), axis=1) / np.diff(np.asarray(found.times))
    speed = np.linalg.norm(CURVE.velocity(middles), axis=1)
    cost = friction_along(CURVE, middles) + inertia_along(CURVE, middles)
    np.testing.assert_allclose(asked, speed + cost / 8.0, rtol=2e-3)
    # The more a field drags, the less the device matters.
    assert found.duration < paced(CURVE, 80.0).duration < CURVE.duration


def test_an_open_curve_stays_open_and_begins_when_it_did():
    way = Trajectory([1.0, 1.5, 2.0, 3.0], [[0.02, 0.0, 0.0], [0.03, 0.01, 0.0], [0.04, 0.01, 0.01], [0.05, 0.0, 0.0]])
    found = paced(way, 8.0)
    assert not found.periodic
    assert found.start == 1.0


def test_a_curve_out_of_reach_is_told():
    with pytest.raises(SimError, match="does not reach"):
        paced(Trajectory.circle(0.9, 2.0), 8.0)
