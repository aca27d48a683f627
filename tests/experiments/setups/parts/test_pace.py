"""Curves that compensate friction and inertia of the device: forces along the curve, and the resulting speed."""

import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from experiments.config.options import run_config
from experiments.setups.parts import pace
from experiments.setups.parts.pace import friction_along, inertia_along, paced
from experiments.setups.wiring import wire
from experiments.trials.trial.measures import TrialLog
from models.phantom.dynamics import mass_matrix
from models.world.scene import PHANTOM
from sim.errors import SimError
from sim.loop.loop import Loop
from sim.world.world import World, phantom_angles

CURVE = Trajectory.circle(0.05, 2.2, (0.0, 0.0, 0.01))


def test_friction_along_curve_matches_mujoco_joint_losses():
    model = World().model
    dofs = [int(model.joint(PHANTOM + name).dofadr[0]) for name in ("theta1", "theta2", "theta3")]
    phases, step = np.linspace(0.1, 2.0, 7), 1e-5
    for phase, force in zip(phases, friction_along(CURVE, phases), strict=True):
        ahead, behind = (np.array(phantom_angles(CURVE.point(phase + d))) for d in (step, -step))
        rates = (ahead - behind) / (2.0 * step)
        loss = np.abs(rates) @ model.dof_frictionloss[dofs] + rates**2 @ model.dof_damping[dofs]
        assert force == pytest.approx(loss / np.linalg.norm(CURVE.velocity(phase)), rel=1e-6)
        assert 0.03 < force < 0.15


def test_inertial_force_along_curve_matches_kinetic_energy():
    phases, step = np.linspace(0.1, 2.0, 7), 1e-4
    waved = Trajectory.circle(0.05, 2.2, (0.0, 0.0, 0.01), wave=0.01)

    def energy(phase):
        behind, theta, ahead = (np.array(phantom_angles(waved.point(phase + d))) for d in (-step, 0.0, step))
        rates = (ahead - behind) / (2.0 * step)
        return 0.5 * rates @ np.array(mass_matrix.py_func(tuple(theta))) @ rates

    for phase, force in zip(phases, inertia_along(waved, phases)[0], strict=True):
        power = (energy(phase + 1e-3) - energy(phase - 1e-3)) / 2e-3
        assert force == pytest.approx(power / np.linalg.norm(waved.velocity(phase)), rel=2e-3, abs=2e-5)
    assert np.ptp(inertia_along(CURVE, phases)[0]) > 0.02


def _turn_rate(lap: float) -> float:
    """Turn rate of a hand led by FOLLOW round a circle of 32 mm, relative to the lap's, after 3 s."""
    session = wire(run_config(radius=0.032, reach=0.01, lap=lap, seconds=5.0, figure="none"))
    log = TrialLog(session.servo, session.world)
    Loop(session.servo, session.world, log).run(5.0)
    (x, y, _), t = log.ticks["p"][3000:].T, log.ticks["t"][3000:]
    angle = np.unwrap(np.arctan2(y, x))
    return float((angle[-1] - angle[0]) / (t[-1] - t[0])) * lap / (2.0 * np.pi)


def test_hand_outside_a_bend_keeps_the_turn_rate(monkeypatch):
    assert _turn_rate(0.6) == pytest.approx(1.0, abs=0.004)
    monkeypatch.setattr(pace, "_MAX_LENGTHENING", 0.0)
    assert _turn_rate(0.6) < 0.985


def test_paced_speed_is_curve_speed_plus_device_losses():
    found = paced(CURVE, 8.0, 300.0)
    assert found.periodic
    np.testing.assert_array_equal(found.positions, CURVE.positions)
    times = np.asarray(CURVE.times)
    middles = 0.5 * (times[1:] + times[:-1])
    paced_speed = np.linalg.norm(np.diff(CURVE.point(times), axis=0), axis=1) / np.diff(np.asarray(found.times))
    speed = np.linalg.norm(CURVE.velocity(middles), axis=1)
    along, bending = inertia_along(CURVE, middles)
    cost = friction_along(CURVE, middles) + along
    np.testing.assert_allclose(paced_speed, speed * (1.0 + bending / 300.0) + cost / 8.0, rtol=2e-3)
    # Device losses matter less with more drag and stiffness; without a spring bends are not compensated.
    assert found.duration < paced(CURVE, 80.0, 300.0).duration < paced(CURVE, 80.0, 3000.0).duration < CURVE.duration
    assert paced(CURVE, 80.0, 0.0).duration > paced(CURVE, 80.0, 3000.0).duration


def test_open_curve_stays_open_with_same_start():
    curve = Trajectory(
        [1.0, 1.5, 2.0, 3.0], [[0.02, 0.0, 0.0], [0.03, 0.01, 0.0], [0.04, 0.01, 0.01], [0.05, 0.0, 0.0]]
    )
    found = paced(curve, 8.0, 300.0)
    assert not found.periodic
    assert found.start == 1.0


@pytest.mark.parametrize(
    ("drag", "stiffness", "message"),
    [
        (-1.0, 300.0, "drag must be finite and at least 0 N s/m, got -1"),
        (0, 300.0, "drag must be more than 0 N s/m, got 0"),
        (8.0, -1.0, "stiffness must be at least 0 N/m, got -1"),
        ("8", 300.0, "drag is '8'; expected a number"),
    ],
)
def test_invalid_drag_or_stiffness_is_refused(drag, stiffness, message):
    with pytest.raises(ParameterError, match=message):
        paced(CURVE, drag, stiffness)


def test_curve_out_of_reach_is_refused():
    with pytest.raises(SimError, match="does not reach"):
        paced(Trajectory.circle(0.9, 2.0), 8.0, 300.0)
