"""The linearised loop against kernels (finite differences) and plant (ODE), and the certificates built on it."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from controllers.certificates.loop.energy import distance_bound, energy, peak_gain, terminal_speed
from controllers.certificates.loop.hand import NO_HAND, HandImpedance, HandRange
from controllers.certificates.loop.laws import BUNNY_LAW, FOLLOW_LAW, HOLD_LAW, SEEK_LAW, follow_law
from controllers.certificates.loop.linear_loop import linearise
from controllers.certificates.loop.passivity import damping_needed, passivity
from controllers.certificates.loop.sampled_loop import SampledLoop
from controllers.certificates.loop.sampling import Sampling
from controllers.certificates.loop.stability import (
    boundary,
    critical_damping,
    critical_stiffness,
    delay_margin,
    lap_multipliers,
    stability,
)
from controllers.certificates.report import Certificate
from controllers.curves.trajectory import Trajectory
from controllers.errors import CurveError, ParameterError
from controllers.fields.algebra.instructions import TRACE_SIZE
from controllers.fields.bunny import Bunny
from controllers.fields.follow import Follow
from controllers.fields.stretchy_tubes import StretchyTubes, stretchy_wrench
from controllers.state import HAND_SWITCH, HandState
from models.phantom.dynamics import coriolis_matrix, gravity_torques, mass_matrix
from models.phantom.kinematics import (
    forward_kinematics,
    jacobian,
    joint_torques,
    vector_to_device_frame,
    vector_to_hand_frame,
)
from models.phantom.parameters import PREMIUM_1_5
from tests.controllers.rivers_for_certificates import CIRCLE, DEVICE, river
from tests.derivatives import central_differences

RIVER = river(b_d=4.0)
PHASES = np.array([0.3, 1.7, 3.1])


def _torque(law, theta, omega, t):
    """Joint torques of the compiled kernels, called as in the servo loop."""
    p = np.array(vector_to_hand_frame(forward_kinematics(tuple(theta))))
    v = np.array(vector_to_hand_frame(tuple(np.array(jacobian(tuple(theta))) @ omega)))
    force = law.wrench(HandState.at(p, v, t)).force
    return np.array(joint_torques(tuple(theta), vector_to_device_frame(tuple(force)))) + gravity_torques(tuple(theta))


def test_delay_beyond_128_periods_raises_parameter_error() -> None:
    assert Sampling(1e-3, 0.128).whole_delay == 128
    with pytest.raises(ParameterError, match=r"at most 128 periods of 0\.001 s, got 3\.0 s"):
        Sampling(1e-3, 3.0)


@pytest.mark.parametrize("kind", ["follow", "parallel", "bunny"])
def test_linearised_law_matches_finite_differences_of_the_kernels(kind):
    if kind == "follow":
        law, symbolic, width = Follow(CIRCLE, 300.0, 4.0, 0.25), FOLLOW_LAW, 0.25
    elif kind == "parallel":
        law, symbolic, width = Follow(CIRCLE, 300.0, 4.0, 0.25, True, 0.3), follow_law(0.7), 0.25
    else:
        law, symbolic, width = Bunny(CIRCLE, 300.0, 4.0, 0.02, pace="clock"), BUNNY_LAW, 0.02
    linear = linearise(DEVICE, symbolic, CIRCLE, PHASES, NO_HAND, width)
    for i, t in enumerate(PHASES):
        theta, rate = linear.theta[i], linear.rate[i]
        by_theta = linear.weight_theta[i] + 300.0 * linear.unit_theta[0, i] + 4.0 * linear.unit_theta[1, i]
        by_omega = 300.0 * linear.unit_omega[0, i] + 4.0 * linear.unit_omega[1, i]
        # In the servo ω is independent of θ: J(θ) at the perturbed angles maps it to the velocity of the tip.
        np.testing.assert_allclose(
            central_differences(lambda x, rate=rate, t=t: _torque(law, x, rate, t), theta, 1e-6), by_theta, atol=2e-5
        )
        np.testing.assert_allclose(
            central_differences(lambda x, theta=theta, t=t: _torque(law, theta, x, t), rate, 1e-6), by_omega, atol=1e-7
        )


@pytest.mark.parametrize("kind", ["seek", "hold"])
def test_linearised_tube_law_matches_finite_differences_of_the_kernels(kind):
    law = StretchyTubes(CIRCLE, 150.0, 180.0)
    program, k = law.program(), 150.0 if kind == "seek" else 180.0
    linear = linearise(DEVICE, SEEK_LAW if kind == "seek" else HOLD_LAW, CIRCLE, PHASES, NO_HAND)
    for i, t in enumerate(PHASES):
        memory, wrench = program.fresh_memory(), np.zeros(6)

        def felt_force(p, v, memory, wrench=wrench):
            hand = HandState.at(p, v, 0.0).vector()
            hand[HAND_SWITCH] = float(kind == "hold")
            stretchy_wrench(program.params, 0, 0, memory, TRACE_SIZE, hand, wrench)
            return wrench[:3].copy()

        felt_force(CIRCLE.point(t), np.zeros(3), memory)

        def torque(theta, omega, memory=memory, felt_force=felt_force):
            p = np.array(vector_to_hand_frame(forward_kinematics(tuple(theta))))
            v = np.array(vector_to_hand_frame(tuple(np.array(jacobian(tuple(theta))) @ omega)))
            pull = joint_torques(tuple(theta), vector_to_device_frame(tuple(felt_force(p, v, memory.copy()))))
            return np.array(pull) + gravity_torques(tuple(theta))

        theta, rate = linear.theta[i], linear.rate[i]
        by_theta = linear.weight_theta[i] + k * linear.unit_theta[0, i] + law.b * linear.unit_theta[1, i]
        by_omega = k * linear.unit_omega[0, i] + law.b * linear.unit_omega[1, i]
        np.testing.assert_allclose(
            central_differences(lambda x, rate=rate, torque=torque: torque(x, rate), theta, 1e-6), by_theta, atol=2e-5
        )
        np.testing.assert_allclose(
            central_differences(lambda x, theta=theta, torque=torque: torque(theta, x), rate, 1e-6), by_omega, atol=1e-7
        )


@pytest.mark.slow
def test_held_tube_is_certified_and_one_too_stiff_for_its_delay_refuted():
    hold = RIVER._replace(law=HOLD_LAW, k_r=150.0, b_d=2.0, width=np.inf)
    good = stability(hold, [NO_HAND, HandImpedance(0.1, 2.0, 200.0)])
    assert good.verdict == "certified"
    assert good.figures["multiplier"] is None
    assert good.margin > 5.0
    bad = stability(hold._replace(k_r=2500.0, sampling=Sampling(1e-3, 2e-3)), [NO_HAND])
    assert bad.verdict == "refuted"
    # A direction left free along the curve is no less stable than a held one: the seeking tube's onset is not lower.
    seek = stability(hold._replace(law=SEEK_LAW), [NO_HAND])
    assert seek.verdict == "certified"
    assert seek.figures["critical_stiffness"].min() >= good.figures["critical_stiffness"].min() * (1.0 - 1e-6)


@pytest.mark.slow
def test_critical_stiffness_does_not_depend_on_the_requested_gain():
    hands = HandRange().hands()[::3]
    below = stability(RIVER, hands)
    critical = (below.margin + 1.0) * RIVER.k_r
    for k_r in (1.001 * critical, 20.0 * critical):
        above = stability(RIVER._replace(k_r=k_r), hands)
        assert above.verdict == "refuted"
        assert (above.margin + 1.0) * k_r == pytest.approx(critical, rel=1e-4)
        assert above.reason.split("critical")[1] == below.reason.split("critical")[1]
        assert above.figures["critical_stiffness"].min() == pytest.approx(critical, rel=1e-4)
    assert stability(RIVER._replace(k_r=0.999 * critical), hands).verdict != "refuted"
    assert "no k_r is low enough" in stability(RIVER._replace(b_d=300.0), hands).reason


@pytest.mark.parametrize("hand", [NO_HAND, HandImpedance(0.2, 5.0, 400.0)])
def test_plant_matches_finite_differences_of_the_equations_of_motion(hand):
    curve = Trajectory.circle(0.0477, 4e6)
    loop = SampledLoop(linearise(DEVICE, FOLLOW_LAW, curve, np.array([1.3e6]), hand), Sampling(2e-3))
    theta0 = loop.linear.theta[0]
    p_d = np.array(DEVICE.position(theta0), dtype=float)

    def motion(_, x, torque):
        theta, rate = x[:3], x[3:]
        j = np.array(DEVICE.jacobian(theta), dtype=float)
        jacobian_rate = central_differences(lambda h: np.array(DEVICE.jacobian(theta + h * rate)), 0.0, 1e-6) @ rate
        push = hand.mass * jacobian_rate + hand.damping * (j @ rate)
        push += hand.stiffness * (np.array(DEVICE.position(theta), dtype=float) - p_d)
        total = np.array(mass_matrix(tuple(theta))) + hand.mass * j.T @ j
        resistance = np.array(coriolis_matrix(tuple(theta), tuple(rate))) @ rate + PREMIUM_1_5.viscous_friction * rate
        return np.concatenate(
            [rate, np.linalg.solve(total, torque - resistance - gravity_torques(tuple(theta)) - j.T @ push)]
        )

    def after(x, torque):
        return solve_ivp(motion, (0.0, 2e-3), x, args=(torque,), method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]

    rest, weight = np.concatenate([theta0, np.zeros(3)]), np.array(gravity_torques(tuple(theta0)))
    free, driven = loop.plant(2e-3)
    by_state, by_torque = (
        central_differences(lambda x: after(x, weight), rest, 1e-5),
        central_differences(lambda u: after(rest, u), weight, 1e-4),
    )
    np.testing.assert_allclose(by_state, free[0], rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(by_torque, driven[0], rtol=1e-5, atol=1e-6)


def test_direction_removed_along_the_curve_has_eigenvalue_one():
    loop = SampledLoop(RIVER.still(), Sampling(1e-3, 1.5e-3))
    for whole, across in zip(loop.matrices(300.0, 4.0), loop.frozen(300.0, 4.0), strict=True):
        eigenvalues = np.linalg.eigvals(whole)
        neutral = np.argmin(np.abs(eigenvalues - 1.0))
        assert abs(eigenvalues[neutral] - 1.0) < 1e-7
        left = np.sort(np.abs(np.delete(eigenvalues, neutral)))
        np.testing.assert_allclose(left, np.sort(np.abs(np.linalg.eigvals(across))), atol=2e-6)


def test_radius_at_fractional_delay_lies_between_those_at_whole_periods():
    linear = RIVER.still()
    radius = [SampledLoop(linear, Sampling(1e-3, d)).radius(1500.0, 4.0).max() for d in (0.0, 4e-4, 9.9999e-4, 1e-3)]
    assert radius[0] < radius[1] < radius[2]
    assert radius[2] == pytest.approx(radius[3], abs=1e-5)


def test_radius_is_one_at_critical_gains_and_at_the_delay_margin():
    loop = SampledLoop(RIVER.still(), RIVER.sampling)
    np.testing.assert_allclose(loop.radius(critical_stiffness(loop, 4.0), 4.0), 1.0, atol=1e-6)
    np.testing.assert_allclose(loop.radius(300.0, critical_damping(loop, 300.0, 4.0)), 1.0, atol=1e-6)
    margin = delay_margin(loop, 300.0, 4.0)
    late = SampledLoop(loop.linear, replace(RIVER.sampling, delay=margin + 2e-6))
    early = SampledLoop(loop.linear, replace(RIVER.sampling, delay=margin - 2e-6))
    assert early.radius(300.0, 4.0).max() < 1.0 < late.radius(300.0, 4.0).max()


def test_weak_spring_and_damper_match_the_continuous_approximation():
    # Slow against T only the hold matters: half a period of lag of the spring takes k T/2 from the damping.
    loop = SampledLoop(RIVER.still(), Sampling(1e-4, 0.0, 1e5))
    critical = critical_stiffness(loop, 0.5).min()
    friction = 0.5 + 5e-4 / 0.22**2
    assert critical == pytest.approx(2.0 * friction / 1e-4, rel=0.05)


def test_lap_multipliers_do_not_depend_on_the_number_of_steps():
    fast = river(k_r=30.0, b_d=1.0, curve=Trajectory.circle(0.0477, 0.8))
    phases = np.arange(800) * 1e-3
    whole = SampledLoop(linearise(DEVICE, FOLLOW_LAW, fast.curve, phases, NO_HAND, 0.25), fast.sampling)
    exact = np.abs(whole.multipliers(30.0, 1.0, 1)[0])
    assert np.log(np.abs(lap_multipliers(fast, fast.moving())[0])) == pytest.approx(np.log(exact), rel=0.01)
    assert 0.0 < exact < 1.0


def test_boundary_shrinks_with_delay():
    damping = np.array([1.0, 4.0, 16.0])
    late = RIVER._replace(sampling=Sampling(1e-3, 1e-3))
    assert (boundary(late, damping) < 0.6 * boundary(RIVER, damping)).all()


def test_demo_river_is_certified_and_a_stiff_delayed_one_refuted():
    hands = HandRange().hands()
    good = stability(RIVER, hands)
    assert good.verdict == "certified"
    assert good.margin > 5.0
    assert good.figures["multiplier"] < 1.0
    bad = stability(RIVER._replace(k_r=3000.0, sampling=Sampling(1e-3, 1e-3)), hands[:2])
    assert bad.verdict == "refuted"
    assert -1.0 < bad.margin < 0.0
    assert bad.counterexample["growth_rate"] > 0.0
    text = json.dumps(Certificate({"a": good, "b": bad}, "0").to_json(), allow_nan=False)
    assert Certificate.from_json(json.loads(text)).verdicts["b"].verdict == "refuted"


def test_damping_needed_matches_colgate_and_schenkel_without_filter_and_delay():
    for k, b, period in ((100.0, 0.0, 1e-3), (1000.0, 2.0, 5e-4), (0.0, 3.0, 2e-3)):
        assert damping_needed(k, b, Sampling(period, 0.0, 1e9))[0] == pytest.approx(0.5 * k * period + b, rel=1e-6)


def test_river_is_refuted_as_passive_by_a_destabilising_spring():
    verdict = passivity(RIVER)
    assert verdict.verdict == "refuted"
    spring = verdict.counterexample["hand"]
    assert spring.mass == spring.damping == 0.0
    loop = SampledLoop(RIVER.still(spring), RIVER.sampling)
    assert loop.radius(300.0, 4.0).max() > 1.0
    weak = passivity(RIVER._replace(k_r=5.0, b_d=0.0))
    assert weak.verdict == "certified"
    assert weak.margin == pytest.approx(np.min(weak.figures["damping"]) - 0.5 * 5.0 * 1e-3, rel=1e-6)


def test_peak_gain_is_nearly_reached_by_the_worst_force():
    loop = SampledLoop(RIVER.still(), RIVER.sampling)
    gain = peak_gain(loop, 300.0, 4.0).distance
    basis, projection = loop.across
    best = 0.0
    for i in range(0, 48, 6):
        maps, force = loop.frozen(300.0, 4.0)[i], (projection @ loop.push)[i]
        out = loop.linear.jacobian[i] @ basis[i, :3]
        for direction in np.linalg.qr(np.random.default_rng(i).normal(size=(3, 3)))[0]:
            # Along one axis of the response the worst force is the sign of the impulse response, reversed in time.
            forces, row = [], direction @ out
            for _ in range(800):
                forces.append(row @ force / max(np.linalg.norm(row @ force), 1e-300))
                row = row @ maps
            state = np.zeros(len(maps))
            for push in reversed(forces):
                state = maps @ state + force @ push
            best = max(best, float(np.linalg.norm(out @ state)))
    assert 0.7 * gain < best <= gain * (1.0 + 1e-6)
    assert gain > 1.0 / 300.0


def test_distance_bound_solves_its_fixed_point_equation():
    gain = 5e-3
    bound = distance_bound(RIVER, gain, 2.0)
    lost = 1.0 - (1.0 - (bound / 0.25) ** 2) ** 3
    assert bound == pytest.approx(gain * (2.0 + 300.0 * bound * lost), rel=1e-9)
    assert distance_bound(RIVER, gain, 40.0) == np.inf


def test_parallel_flow_has_larger_power_and_distance_bounds():
    paper, parallel = energy(RIVER, 1.0, 8.5), energy(RIVER._replace(law=follow_law(1.0)), 1.0, 8.5)
    assert parallel.verdict == "certified"
    rng, speed = np.random.default_rng(3), 2.0 * np.pi * 0.0477 / 4.0
    law, most = Follow(CIRCLE, 0.0, 4.0, np.inf, parallel=True), 0.0
    for _ in range(300):
        along = np.array([0.0, rng.uniform(0.0, 2.0 * speed), 0.0])
        most = max(most, float(law.wrench(HandState.at([rng.uniform(0.01, 0.15), 0.0, 0.0], along)).force @ along))
    assert 0.98 * parallel.figures["power_bound"] < most <= parallel.figures["power_bound"]
    assert parallel.figures["distance_bound"] > paper.figures["distance_bound"]
    assert RIVER._replace(law=follow_law(1.0)).shear == pytest.approx(2.0 * np.pi / 4.0, rel=1e-2)
    assert RIVER.shear == 0.0


def test_energy_certificate_is_unknown_beyond_its_allowed_push_and_stiffness():
    good = energy(RIVER, 1.0, 8.5)
    assert good.verdict == "certified"
    assert good.figures["distance_bound"] < CIRCLE.reach
    assert good.figures["lap_energy"] < good.figures["lap_energy_bound"]
    assert np.all(terminal_speed(RIVER, RIVER.moving()) < good.figures["pace"])
    assert energy(RIVER, good.figures["push_allowed"] + 0.05, 8.5).verdict == "unknown"
    assert energy(RIVER._replace(k_r=9000.0), 0.1, 8.5).verdict == "unknown"


def test_linearise_raises_curve_error_where_the_curve_stands_still():
    path = Trajectory([0.0, 1.0, 2.0], [[0, 0, 0], [0.02, 0, 0], [0.04, 0.01, 0]], ends="clamped")
    with pytest.raises(CurveError, match="stands still"):
        linearise(DEVICE, FOLLOW_LAW, path, np.array([0.0]), NO_HAND)


@pytest.mark.parametrize(
    "construct", [lambda: HandImpedance(mass=-1.0), lambda: Sampling(0.0), lambda: Sampling(1e-3, -1.0)]
)
def test_out_of_range_parameters_raise_parameter_error(construct):
    with pytest.raises(ParameterError):
        construct()
