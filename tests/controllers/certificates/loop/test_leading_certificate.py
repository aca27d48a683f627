"""Certificate of leading: its linearised regimes and walker against the executed law and MuJoCo."""

from dataclasses import replace

import numpy as np
import pytest

from controllers.certificates.loop.hand import NO_HAND, HandImpedance
from controllers.certificates.loop.leading_law import Regime, walking
from controllers.certificates.loop.linear_loop import linearise
from controllers.certificates.loop.sampled_loop import SampledLoop
from controllers.certificates.loop.sampling import Sampling
from controllers.certificates.loop.stability import CertifiedRiver, stability
from controllers.fields.algebra.instructions import TRACE_SIZE
from controllers.fields.algebra.walker_feed import feed_walkers
from controllers.fields.leading import Leading, leading_wrench
from controllers.state import HandState
from controllers.walking.gait import Gait
from controllers.walking.walker import walker_at
from controllers.walking.walking import Walking
from experiments.certify.certified_device import phantom_device
from experiments.certify.certified_leading import certify_leading, leading_energy, leading_field, leading_regimes
from experiments.certify.trial_simulation import Conditions, simulate
from experiments.config.modes import Lead
from experiments.config.options import run_config
from experiments.setups.parts.leading_hand import s_curve
from experiments.studies.leading_trials import SCALE, STIFFNESS_RATIO, TRIALS, leading_trial
from experiments.studies.trial_onset import observed, predicted
from models.mocap.library import embedded
from tests.derivatives import central_differences

DEVICE, CURVE = phantom_device(), s_curve()
FLUTTER = Regime(True, True, True, 3.0)


def _river(regime, b=8.0):
    return CertifiedRiver(regime.law(SCALE, STIFFNESS_RATIO), 120.0, b, np.inf, CURVE, DEVICE, Sampling(1e-3))


@pytest.mark.parametrize("name", TRIALS)
def test_linearised_regime_matches_finite_differences_of_the_law(name):
    trial = TRIALS[name]
    field, position = trial.field(300.0), trial.curve.point(trial.phase)
    by_position = central_differences(lambda x: field.wrench(HandState.at(position + x)).force, np.zeros(3), 1e-5)
    by_velocity = central_differences(lambda v: field.wrench(HandState.at(position, v)).force, np.zeros(3), 1e-5)
    linear = trial.loop().linear
    inverse = np.linalg.inv(linear.jacobian[0])
    found = inverse.T @ linear.unit_theta[0, 0] @ inverse
    np.testing.assert_allclose(300.0 * found, by_position, atol=1e-4)
    np.testing.assert_allclose(inverse.T @ linear.unit_omega[1, 0] @ inverse, by_velocity / trial.b_d, atol=1e-8)
    assert np.abs(linear.unit_theta[1]).max() < 1e-6


@pytest.mark.parametrize(
    ("regime", "neutral"),
    [
        (Regime(False, True), 1),
        (Regime(True, False, True), 1),
        (Regime(False, True, True, 1.0), 1),
        (Regime(True, True), 0),
        (Regime(False, False, True), 2),
    ],
)
def test_neutral_directions_of_each_regime_are_taken_out(regime, neutral):
    loop = SampledLoop(_river(regime).still(), Sampling(1e-3, 1.5e-3))
    for whole, across in zip(loop.matrices(120.0, 8.0), loop.frozen(120.0, 8.0), strict=True):
        values = np.linalg.eigvals(whole)
        nearest = np.argsort(np.abs(values - 1.0))
        assert np.abs(values[nearest[:neutral]] - 1.0).max(initial=0.0) < 1e-6
        assert np.abs(values[nearest[neutral]] - 1.0) > 1e-3
        left = np.sort(np.abs(values[nearest[neutral:]]))
        np.testing.assert_allclose(left, np.sort(np.abs(np.linalg.eigvals(across))), atol=2e-6)
    held = _river(regime).still(HandImpedance(0.1, 1.0, 100.0))
    assert held.neutral.shape[2] == 0


@pytest.mark.parametrize("delay", [0.0, 1.5e-3])
@pytest.mark.parametrize("regime", [Regime(True, True), Regime(True, False, True, heading=0.4)])
def test_walker_state_follows_linear_maps(regime, delay):
    """The difference of two nearby hands, under the executed law on the linear device, obeys the linear maps."""
    hand, b, scale = HandImpedance(0.05, 0.5, 20.0), 6.0, 40.0
    sampling = Sampling(1e-3, delay)
    trial = leading_trial(regime, 0.3, b, sampling)
    linear = linearise(DEVICE, regime.law(scale, STIFFNESS_RATIO), trial.curve, np.array([trial.phase]), hand)
    loop = SampledLoop(linear, sampling)
    c, s = regime.tangent(linear.velocity[0])
    gait = Gait(1.4, 0.01, np.array([2, 2]), 0.45)
    settings = Walking(gait, (0.0, 0.0), float(np.arctan2(s, c)), scale, forward=1e3, backward=1e3, pull=1e3)
    field, rate = Leading(settings, 120.0, 180.0, b), settings.rate
    program, free, jacobian = field.program(), loop.matrices(0.0, 0.0)[0], linear.jacobian[0]
    # The backward edge is far behind, so the hand must be far behind to move a standing figure.
    lag = 2.0 * 0.01 / rate * (1.0 if regime.beyond else -1e3)
    start = (lag + (0.2 if regime.beyond else -0.2)) / scale
    position = np.array([c * start, s * start, 0.0])
    held = field.wrench(HandState.at(position)).force  # balanced by the hand

    def trajectory(x, ticks):
        memory, out = program.fresh_memory(), []
        walkers = program.fresh_walkers()
        walker = walker_at.py_func(walkers.state, 0)
        for k in range(ticks):
            out.append(np.append(x, [walker.argument[0], walker.speed[0]]))
            state = HandState.at(position + jacobian @ x[:3], loop.measured_velocity[0] @ x, k * sampling.period)
            wrench = np.zeros(6)
            feed_walkers(walkers, program.params, memory, state.vector())
            leading_wrench(program.params, 0, 0, memory, TRACE_SIZE, state.vector(), wrench)
            x = free @ x + loop.fresh[0] @ (jacobian.T @ (wrench[:3] - held))
        return np.array(out)

    perturbation = np.zeros(loop.size)
    perturbation[:3] = np.linalg.solve(jacobian, [1e-7, 2e-7, -1e-7])
    ticks = 60
    unperturbed = trajectory(np.zeros(loop.size), ticks)
    difference = trajectory(perturbation, ticks) - unperturbed
    whole = walking(loop, regime, scale, rate, field.k_l, b)[0]
    assert whole.shape == (loop.size + 2, loop.size + 2)
    expected = difference[1].copy()
    for k in range(1, ticks):
        np.testing.assert_allclose(difference[k][:3], expected[:3], atol=1e-12 + 1e-4 * np.abs(expected[:3]).max())
        np.testing.assert_allclose(difference[k][-2:], expected[-2:], atol=1e-11 + 1e-4 * np.abs(expected[-2:]).max())
        expected = whole @ expected
    assert np.abs(difference[-1][-2:]).max() > 1e-9


def test_power_of_the_executed_law_stays_below_the_certified_bound():
    field = leading_field(run_config(mode="lead"), Lead(), embedded("walk"))
    verdict = leading_energy(field)
    rng = np.random.default_rng(7)
    greatest = 0.0
    for _ in range(500):
        p, direction = rng.uniform([-0.03, -0.06, -0.02], [0.06, 0.06, 0.02]), rng.normal(size=3)
        springs = np.asarray(field.wrench(HandState.at(p)).force)
        if np.linalg.norm(springs) > 8.5:
            continue
        # Power is greatest along the spring force, at half of its terminal speed.
        for v in (rng.uniform(0.0, 0.6) * direction / np.linalg.norm(direction), 0.5 * springs / field.b):
            power = float(np.asarray(field.wrench(HandState.at(p, v)).force) @ v)
            assert power <= verdict.figures["power_bound"]
            greatest = max(greatest, power)
    assert greatest > 0.5 * verdict.figures["power_bound"]
    assert leading_energy(replace(field, b=0.0)).verdict == "unknown"


def test_springs_ahead_and_aside_do_work_round_a_closed_loop():
    """Round a small square the executed springs do work: the force has no potential."""
    trial = TRIALS["too far ahead and aside, c = 2"]
    field, position = trial.field(300.0), trial.curve.point(trial.phase)
    ring = 2e-5 * np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])
    middles = position + 0.5 * (ring[1:] + ring[:-1])
    forces = np.array([field.wrench(HandState.at(middle)).force for middle in middles])
    work = float(np.sum(forces * np.diff(ring, axis=0)))
    # The antisymmetric part of the springs' matrix, k_l c / 2 each way, times twice the square's area.
    assert abs(work) == pytest.approx(300.0 * 2.0 * 2.0 * (2e-5) ** 2, rel=0.05)


@pytest.mark.slow
def test_leading_is_certified_except_beyond_the_front_and_refuted_with_little_damping():
    field = leading_field(run_config(mode="lead"), Lead(), embedded("walk"))
    assert leading_regimes(field)["_beyond"][0].turn > leading_regimes(field)["_aside"][0].turn > 0.5
    hands = type("Few", (), {"hands": lambda self: [NO_HAND, HandImpedance(0.1, 2.0, 0.0)]})()
    verdicts = certify_leading(field, CURVE, DEVICE, Sampling(1e-3), hands)  # pyright: ignore
    assert {name: verdict.verdict for name, verdict in verdicts.items()} == {
        "stability": "certified", "stability_back": "certified", "stability_aside": "certified",
        "stability_beyond": "unknown", "passivity": "refuted", "energy": "certified", "region": "unknown",
    }  # fmt: skip
    # Where the limiter leaves a twentieth of spring and damping, the non-conservative force exceeds the damping.
    beyond = verdicts["stability_beyond"]
    assert "limiter cuts the force" in beyond.reason
    assert np.max(np.asarray(beyond.figures["radius"])) < 0.995 < 1.0 < float(str(beyond.figures["radius_cut"])) < 1.01
    assert verdicts["stability"].figures["walker_radius"] < 1.0
    # With little damping the non-conservative force destabilises a hand that is too far ahead and aside.
    weak = stability(_river(FLUTTER, b=1.0), [NO_HAND])
    assert weak.verdict == "refuted"
    assert stability(_river(Regime(True, True), b=1.0), [NO_HAND]).verdict == "certified"


@pytest.mark.slow
@pytest.mark.parametrize("name", TRIALS)
def test_onset_of_instability_in_mujoco_is_as_predicted(name):
    trial = TRIALS[name]
    expected = predicted(trial)
    assert observed(trial, expected, Conditions()) == pytest.approx(expected, rel=0.03)


@pytest.mark.slow
def test_refuted_regime_diverges_at_the_growth_rate_of_its_counterexample():
    verdict = stability(_river(FLUTTER, b=0.5), [NO_HAND])
    example = verdict.counterexample
    assert example["growth_rate"] > 8.0
    trial = leading_trial(FLUTTER, float(example["phase"]) / CURVE.duration, 0.5, Sampling(1e-3))
    # Start at a nanometre, so that there are more than two oscillations at 4.8 Hz before the amplitude is large.
    path = simulate(trial, 120.0, 500, Conditions(), 1e-6 * example["state"])
    speed = np.linalg.norm(np.diff(path, axis=0), axis=1)
    third = len(speed) // 3
    rate = np.log(speed[-third:].max() / speed[:third].max()) / (1e-3 * (len(speed) - third))
    assert rate == pytest.approx(example["growth_rate"], rel=0.05)
