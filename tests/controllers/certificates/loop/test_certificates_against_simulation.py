"""Certificates against MuJoCo simulations with the servo's own kernels."""

import mujoco
import numpy as np
import pytest

from controllers.certificates.loop.energy import energy, terminal_speed
from controllers.certificates.loop.hand import HandImpedance, HandRange
from controllers.certificates.loop.passivity import passivity
from controllers.certificates.loop.sampled_loop import SampledLoop
from controllers.certificates.loop.sampling import Sampling
from controllers.certificates.loop.stability import stability
from controllers.curves.closest_point import closest_phases
from controllers.curves.trajectory import Trajectory
from experiments.certify.trial_simulation import (
    FULL_CONDITIONS,
    LAP_DURATION,
    Conditions,
    LoopTrial,
    draw_trial,
    hand_path,
    simulate,
)
from experiments.studies.trial_onset import growth, observed, observed_with_friction, predicted, with_friction
from sim.users.hand.arm import Arm
from tests.controllers.rivers_for_certificates import CIRCLE, river

pytestmark = pytest.mark.slow

STILL = Trajectory.circle(0.0477, LAP_DURATION)
RIVER = river(b_d=4.0)


def _trial(river, phase, hand, direction=(0.0, 0.0, 1.0)):
    return LoopTrial(STILL, phase * LAP_DURATION / 4.0, river.b_d, river.sampling, hand, np.array(direction))


def test_onset_of_instability_is_at_the_predicted_stiffness():
    rng = np.random.default_rng(11)
    trials = [draw_trial(rng) for _ in range(4)]
    errors = [abs(observed(trial, predicted(trial), Conditions()) / predicted(trial) - 1.0) for trial in trials]
    assert max(errors) < 0.05
    assert np.median(errors) < 0.02


def test_coulomb_friction_raises_the_onset_as_its_describing_function_predicts():
    sampling = Sampling(1.2e-3, 3.6e-3)
    trial = LoopTrial(STILL, 0.2 * LAP_DURATION, 2.0, sampling, HandImpedance(0.1, 2.0), np.array([0.0, 0.0, 1.0]))
    friction_onset = with_friction(trial, 1e-3)
    assert friction_onset.k_r > 1.03 * predicted(trial)
    assert observed_with_friction(trial, friction_onset, 1e-3, Conditions(coulomb=True)) == pytest.approx(
        friction_onset.k_r, rel=0.03
    )
    assert observed_with_friction(trial, friction_onset, 1e-3, Conditions(coulomb=True, rounded=True)) == pytest.approx(
        friction_onset.k_r, rel=0.05
    )


def test_integrator_lead_is_half_a_physics_step():
    trial = LoopTrial(STILL, 0.2 * LAP_DURATION, 6.0, Sampling(1e-3), HandImpedance(), np.array([0.0, 0.0, 1.0]))
    expected = predicted(trial)
    integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    coarse, fine = (observed(trial, expected, Conditions(steps, integrator)) / expected - 1.0 for steps in (8, 64))
    assert coarse > 0.05
    assert fine == pytest.approx(coarse / 8.0, rel=0.25)


def test_refuted_river_diverges_at_the_growth_rate_of_its_counterexample():
    river = RIVER._replace(k_r=3000.0, sampling=Sampling(1e-3, 1e-3))
    verdict = stability(river, [HandImpedance(), HandImpedance(0.1, 2.0, 200.0)])
    assert verdict.verdict == "refuted"
    example = verdict.counterexample
    trial = _trial(river, example["phase"], example["hand"])
    path = simulate(trial, river.k_r, 120, Conditions(), 1e-3 * example["state"])
    distance = np.linalg.norm(path, axis=1)
    assert distance[-20:].max() > 3.0 * distance[:20].max()
    assert np.log(growth(path)) / 1e-3 == pytest.approx(example["growth_rate"], rel=0.02)


def test_spring_that_refutes_passivity_destabilises_the_loop():
    example = passivity(RIVER).counterexample
    trial = _trial(RIVER, example["phase"], example["hand"])
    # The spring acts at every physics step, so the steps must be fine.
    path = simulate(trial, RIVER.k_r, 150, Conditions(substeps=1024), 1e-3 * example["state"])
    assert np.log(growth(path)) / 1e-3 == pytest.approx(example["growth_rate"], rel=0.1)


def test_certified_river_does_not_diverge_with_random_hands():
    hands = HandRange()
    assert stability(RIVER, hands.hands()).verdict == "certified"
    rng = np.random.default_rng(7)
    for _ in range(40):
        hand = HandImpedance(*(rng.uniform(low, high) for low, high in (hands.mass, hands.damping, hands.stiffness)))
        trial = _trial(RIVER, rng.uniform(0.0, 4.0), hand)
        state = np.zeros(12)
        loop = trial.loop()
        inverse = np.linalg.inv(loop.linear.jacobian[0])
        state[:3], state[3:6] = inverse @ rng.normal(scale=2e-3, size=3), inverse @ rng.normal(scale=0.1, size=3)
        state[6:9], state[9:12] = state[:3], state[3:6]
        path = simulate(trial, RIVER.k_r, 400, FULL_CONDITIONS, state)
        assert len(path) == 400
        # Friction holds it short of the curve: at f_c/k_r, 0.06 N over 300 N/m.
        assert np.linalg.norm(path[300:], axis=1).max() < 6e-4


def test_bounded_force_moves_the_hand_no_farther_than_the_distance_bound():
    push = 1.0
    verdict = energy(RIVER, push, 8.5)
    assert verdict.verdict == "certified"
    trial = LoopTrial(CIRCLE, 0.5, RIVER.b_d, RIVER.sampling, HandImpedance(), np.array([0.0, 0.0, 1.0]))
    loop = SampledLoop(RIVER.still(), RIVER.sampling)
    basis, projection = loop.across
    maps, force = loop.frozen(300.0, 4.0)[6], (projection @ loop.push)[6]
    farthest = 0.0
    for axis in np.eye(3):
        row, forces = axis @ loop.linear.jacobian[6] @ basis[6, :3], []
        for _ in range(400):
            forces.append(row @ force / max(np.linalg.norm(row @ force), 1e-300))
            row = row @ maps
        forces = push * np.array(forces[::-1])
        # A very soft spring with a distant end applies any given force.
        softness = 1e-4
        user = Arm(softness, 0.0, forces / softness + CIRCLE.point(0.5), RIVER.sampling.period)
        path = hand_path(trial, RIVER.k_r, 420, Conditions(coulomb=True), user=user)
        distance = closest_phases(CIRCLE.packed(), path)[1]
        farthest = max(farthest, float(distance.max()))
    assert 0.5 * verdict.figures["distance_bound"] < farthest < verdict.figures["distance_bound"]


def test_relaxed_hand_moves_at_terminal_speed():
    trial = LoopTrial(CIRCLE, 0.0, RIVER.b_d, RIVER.sampling, HandImpedance(), np.array([0.0, 0.0, 1.0]))
    path = hand_path(trial, RIVER.k_r, 750, Conditions(8, coulomb=True))
    phases = np.unwrap(closest_phases(CIRCLE.packed(), path)[0], period=4.0)
    assert len(path) == 750
    mean_speed = (phases[-1] - phases[249]) / 0.5 * 0.0749269
    moving = RIVER.moving()
    inside = (moving.phases > phases[249]) & (moving.phases < phases[-1])
    assert mean_speed == pytest.approx(float(1.0 / np.mean(1.0 / terminal_speed(RIVER, moving)[inside])), rel=0.02)


def test_growth_rate_does_not_depend_on_the_start_distance():
    trial = draw_trial(np.random.default_rng(5))
    expected = predicted(trial)
    rates = [np.log(growth(simulate(trial, 1.05 * expected, 150, Conditions(start=start)))) for start in (1e-6, 3e-6)]
    assert rates[0] == pytest.approx(rates[1], rel=1e-2)
