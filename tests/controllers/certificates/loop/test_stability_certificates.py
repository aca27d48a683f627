"""The linearised loop is the loop that runs: kernels by finite differences, plant by its ODE; and what follows."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from controllers.certificates.loop.energy import distance_bound, energy, peak_gain, terminal_speed
from controllers.certificates.loop.hand import NO_HAND, HandImpedance, HandRange
from controllers.certificates.loop.laws import BUNNY_LAW, FOLLOW_LAW, HOLD_LAW, PARALLEL_LAW, SEEK_LAW
from controllers.certificates.loop.linear_loop import linearise
from controllers.certificates.loop.passivity import damping_needed, passivity
from controllers.certificates.loop.sampled_loop import SampledLoop, exponentials
from controllers.certificates.loop.sampling import Sampling
from controllers.certificates.loop.stability import (
    River,
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
from experiments.certify.certified_device import phantom_device
from models.phantom.dynamics import coriolis_matrix, gravity_torques, mass_matrix
from models.phantom.kinematics import (
    forward_kinematics,
    jacobian,
    joint_torques,
    vector_to_device_frame,
    vector_to_hand_frame,
)
from models.phantom.parameters import PREMIUM_1_5

DEVICE = phantom_device()
CIRCLE = Trajectory.circle(0.0477, 4.0)
RIVER = River(FOLLOW_LAW, 300.0, 4.0, 0.25, CIRCLE, DEVICE, Sampling(1e-3))
PHASES = np.array([0.3, 1.7, 3.1])


def _torque(law, theta, omega, t):
    """Torques by the compiled kernels, called as the servo calls them."""
    p = np.array(vector_to_hand_frame(forward_kinematics(tuple(theta))))
    v = np.array(vector_to_hand_frame(tuple(np.array(jacobian(tuple(theta))) @ omega)))
    force = law.wrench(HandState.at(p, v, t)).force
    return np.array(joint_torques(tuple(theta), vector_to_device_frame(tuple(force)))) + gravity_torques(tuple(theta))


def _difference(function, x, step=1e-6):
    columns = [(function(x + step * e) - function(x - step * e)) / (2.0 * step) for e in np.eye(len(x))]
    return np.stack(columns, axis=1)


def test_a_delay_of_thousands_of_periods_is_refused_before_it_fills_the_memory() -> None:
    assert Sampling(1e-3, 0.128).whole_delay == 128
    with pytest.raises(ParameterError, match=r"at most 128 periods of 0\.001 s, got 3\.0 s"):
        Sampling(1e-3, 3.0)


@pytest.mark.parametrize("kind", ["follow", "parallel", "bunny"])
def test_the_law_is_differentiated_as_the_kernels_run_it(kind):
    if kind == "follow":
        law, symbolic, width = Follow(CIRCLE, 300.0, 4.0, 0.25), FOLLOW_LAW, 0.25
    elif kind == "parallel":
        law, symbolic, width = Follow(CIRCLE, 300.0, 4.0, 0.25, parallel=True), PARALLEL_LAW, 0.25
    else:
        law, symbolic, width = Bunny(CIRCLE, 300.0, 4.0, 0.02, pace="clock"), BUNNY_LAW, 0.02
    linear = linearise(DEVICE, symbolic, CIRCLE, PHASES, NO_HAND, width)
    for i, t in enumerate(PHASES):
        theta, rate = linear.theta[i], linear.rate[i]
        by_theta = linear.weight_theta[i] + 300.0 * linear.unit_theta[0, i] + 4.0 * linear.unit_theta[1, i]
        by_omega = 300.0 * linear.unit_omega[0, i] + 4.0 * linear.unit_omega[1, i]
        # ω is apart from θ in the servo: J(θ) turns it to the tip's velocity at the perturbed angles.
        np.testing.assert_allclose(
            _difference(lambda x, rate=rate, t=t: _torque(law, x, rate, t), theta), by_theta, atol=2e-5
        )
        np.testing.assert_allclose(
            _difference(lambda x, theta=theta, t=t: _torque(law, theta, x, t), rate), by_omega, atol=1e-7
        )


@pytest.mark.parametrize("kind", ["seek", "hold"])
def test_tubes_are_differentiated_as_the_kernels_run_them(kind):
    law = StretchyTubes(CIRCLE, 150.0, 180.0)
    program, k = law.program(), 150.0 if kind == "seek" else 180.0
    linear = linearise(DEVICE, SEEK_LAW if kind == "seek" else HOLD_LAW, CIRCLE, PHASES, NO_HAND)
    for i, t in enumerate(PHASES):
        memory, wrench = program.fresh_memory(), np.zeros(6)

        def feel(p, v, memory, wrench=wrench):
            hand = HandState.at(p, v, 0.0).vector()
            hand[HAND_SWITCH] = float(kind == "hold")
            stretchy_wrench(program.params, 0, 0, memory, TRACE_SIZE, hand, wrench)
            return wrench[:3].copy()

        feel(CIRCLE.point(t), np.zeros(3), memory)

        def torque(theta, omega, memory=memory, feel=feel):
            p = np.array(vector_to_hand_frame(forward_kinematics(tuple(theta))))
            v = np.array(vector_to_hand_frame(tuple(np.array(jacobian(tuple(theta))) @ omega)))
            pull = joint_torques(tuple(theta), vector_to_device_frame(tuple(feel(p, v, memory.copy()))))
            return np.array(pull) + gravity_torques(tuple(theta))

        theta, rate = linear.theta[i], linear.rate[i]
        by_theta = linear.weight_theta[i] + k * linear.unit_theta[0, i] + law.b * linear.unit_theta[1, i]
        by_omega = k * linear.unit_omega[0, i] + law.b * linear.unit_omega[1, i]
        np.testing.assert_allclose(
            _difference(lambda x, rate=rate, torque=torque: torque(x, rate), theta), by_theta, atol=2e-5
        )
        np.testing.assert_allclose(
            _difference(lambda x, theta=theta, torque=torque: torque(theta, x), rate), by_omega, atol=1e-7
        )


def test_rubber_that_is_held_is_certified_and_one_too_stiff_for_its_delay_refuted():
    hold = RIVER._replace(law=HOLD_LAW, k_r=150.0, b_d=2.0, width=np.inf)
    good = stability(hold, [NO_HAND, HandImpedance(0.1, 2.0, 200.0)])
    assert good.verdict == "certified"
    assert good.figures["multiplier"] is None
    assert good.margin > 5.0
    bad = stability(hold._replace(k_r=2500.0, sampling=Sampling(1e-3, 2e-3)), [NO_HAND])
    assert bad.verdict == "refuted"
    # A free direction along the curve is no less stable than one that is held: the seeking tube's onset is not lower.
    seek = stability(hold._replace(law=SEEK_LAW), [NO_HAND])
    assert seek.verdict == "certified"
    assert seek.figures["critical_stiffness"].min() >= good.figures["critical_stiffness"].min() * (1.0 - 1e-6)


def test_the_critical_gain_does_not_depend_on_the_gain_that_is_asked_for():
    hands = HandRange().hands()
    below = stability(RIVER, hands)
    least = (below.margin + 1.0) * RIVER.k_r
    for k_r in (1.001 * least, 20.0 * least):
        above = stability(RIVER._replace(k_r=k_r), hands)
        assert above.verdict == "refuted"
        assert (above.margin + 1.0) * k_r == pytest.approx(least, rel=1e-4)
        assert above.reason.split("critical")[1] == below.reason.split("critical")[1]
        assert above.figures["critical_stiffness"].min() == pytest.approx(least, rel=1e-4)
    assert stability(RIVER._replace(k_r=0.999 * least), hands).verdict != "refuted"
    assert "no k_r is low enough" in stability(RIVER._replace(b_d=300.0), hands).reason


@pytest.mark.parametrize("hand", [NO_HAND, HandImpedance(0.2, 5.0, 400.0)])
def test_the_plant_is_the_derivative_of_its_equations_of_motion(hand):
    curve = Trajectory.circle(0.0477, 4e6)
    loop = SampledLoop(linearise(DEVICE, FOLLOW_LAW, curve, np.array([1.3e6]), hand), Sampling(2e-3))
    theta0 = loop.linear.theta[0]
    p_d = np.array(DEVICE.position(theta0), dtype=float)

    def motion(_, x, torque):
        theta, rate = x[:3], x[3:]
        j = np.array(DEVICE.jacobian(theta), dtype=float)
        step = 1e-6
        bend = (np.array(DEVICE.jacobian(theta + step * rate)) - np.array(DEVICE.jacobian(theta - step * rate))) @ rate
        push = hand.mass * bend / (2 * step) + hand.damping * (j @ rate)
        push += hand.stiffness * (np.array(DEVICE.position(theta), dtype=float) - p_d)
        total = np.array(mass_matrix(tuple(theta))) + hand.mass * j.T @ j
        loss = np.array(coriolis_matrix(tuple(theta), tuple(rate))) @ rate + PREMIUM_1_5.viscous_friction * rate
        return np.concatenate(
            [rate, np.linalg.solve(total, torque - loss - gravity_torques(tuple(theta)) - j.T @ push)]
        )

    def after(x, torque):
        return solve_ivp(motion, (0.0, 2e-3), x, args=(torque,), method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]

    rest, weight = np.concatenate([theta0, np.zeros(3)]), np.array(gravity_torques(tuple(theta0)))
    free, driven = loop.plant(2e-3)
    np.testing.assert_allclose(_difference(lambda x: after(x, weight), rest, 1e-5), free[0], rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(_difference(lambda u: after(rest, u), weight, 1e-4), driven[0], rtol=1e-5, atol=1e-6)


def test_what_is_taken_out_along_the_curve_is_a_neutral_shift():
    loop = SampledLoop(RIVER.still(), Sampling(1e-3, 1.5e-3))
    for whole, across in zip(loop.matrices(300.0, 4.0), loop.frozen(300.0, 4.0), strict=True):
        all_of_them = np.linalg.eigvals(whole)
        neutral = np.argmin(np.abs(all_of_them - 1.0))
        assert abs(all_of_them[neutral] - 1.0) < 1e-7
        left = np.sort(np.abs(np.delete(all_of_them, neutral)))
        np.testing.assert_allclose(left, np.sort(np.abs(np.linalg.eigvals(across))), atol=2e-6)


def test_a_delay_between_whole_periods_lies_between_them():
    linear = RIVER.still()
    radius = [SampledLoop(linear, Sampling(1e-3, d)).radius(1500.0, 4.0).max() for d in (0.0, 4e-4, 9.9999e-4, 1e-3)]
    assert radius[0] < radius[1] < radius[2]
    assert radius[2] == pytest.approx(radius[3], abs=1e-5)


def test_the_loop_is_neutral_at_its_critical_gains_and_at_its_delay_margin():
    loop = SampledLoop(RIVER.still(), RIVER.sampling)
    np.testing.assert_allclose(loop.radius(critical_stiffness(loop, 4.0), 4.0), 1.0, atol=1e-6)
    np.testing.assert_allclose(loop.radius(300.0, critical_damping(loop, 300.0, 4.0)), 1.0, atol=1e-6)
    margin = delay_margin(loop, 300.0, 4.0)
    late = SampledLoop(loop.linear, replace(RIVER.sampling, delay=margin + 2e-6))
    early = SampledLoop(loop.linear, replace(RIVER.sampling, delay=margin - 2e-6))
    assert early.radius(300.0, 4.0).max() < 1.0 < late.radius(300.0, 4.0).max()


def test_a_weak_spring_and_damper_obey_the_textbook():
    # Slow against T, all is continuous but the hold: half a period's lag of the spring takes k T/2 of the damping.
    loop = SampledLoop(RIVER.still(), Sampling(1e-4, 0.0, 1e5))
    least = critical_stiffness(loop, 0.5).min()
    friction = 0.5 + 5e-4 / 0.22**2
    assert least == pytest.approx(2.0 * friction / 1e-4, rel=0.05)


def test_the_multipliers_of_a_lap_do_not_depend_on_how_it_is_cut():
    river = River(FOLLOW_LAW, 30.0, 1.0, 0.25, Trajectory.circle(0.0477, 0.8), DEVICE, Sampling(1e-3))
    phases = np.arange(800) * 1e-3
    whole = SampledLoop(linearise(DEVICE, FOLLOW_LAW, river.curve, phases, NO_HAND, 0.25), river.sampling)
    exact = np.abs(whole.multipliers(30.0, 1.0, 1)[0])
    assert np.log(np.abs(lap_multipliers(river, river.moving())[0])) == pytest.approx(np.log(exact), rel=0.01)
    assert 0.0 < exact < 1.0


def test_the_boundary_shrinks_with_delay():
    damping = np.array([1.0, 4.0, 16.0])
    late = RIVER._replace(sampling=Sampling(1e-3, 1e-3))
    assert (boundary(late, damping) < 0.6 * boundary(RIVER, damping)).all()


def test_the_demo_is_certified_and_a_stiff_late_river_refuted():
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


def test_colgate_and_schenkel_without_filter_and_delay():
    for k, b, period in ((100.0, 0.0, 1e-3), (1000.0, 2.0, 5e-4), (0.0, 3.0, 2e-3)):
        assert damping_needed(k, b, Sampling(period, 0.0, 1e9))[0] == pytest.approx(0.5 * k * period + b, rel=1e-6)


def test_a_river_is_not_passive_and_a_spring_shows_it():
    verdict = passivity(RIVER)
    assert verdict.verdict == "refuted"
    spring = verdict.counterexample["hand"]
    assert spring.mass == spring.damping == 0.0
    loop = SampledLoop(RIVER.still(spring), RIVER.sampling)
    assert loop.radius(300.0, 4.0).max() > 1.0
    weak = passivity(RIVER._replace(k_r=5.0, b_d=0.0))
    assert weak.verdict == "certified"
    assert weak.margin == pytest.approx(np.min(weak.figures["damping"]) - 0.5 * 5.0 * 1e-3, rel=1e-6)


def test_the_peak_gain_is_reached_by_the_worst_force():
    loop = SampledLoop(RIVER.still(), RIVER.sampling)
    gain = peak_gain(loop, 300.0, 4.0).distance
    basis, projection = loop.across
    best = 0.0
    for at in range(0, 48, 6):
        maps, force = loop.frozen(300.0, 4.0)[at], (projection @ loop.push)[at]
        out = loop.linear.jacobian[at] @ basis[at, :3]
        for direction in np.linalg.qr(np.random.default_rng(at).normal(size=(3, 3)))[0]:
            # Along one axis of the response the worst course of the force is its sign, backwards in time.
            pushes, row = [], direction @ out
            for _ in range(800):
                pushes.append(row @ force / max(np.linalg.norm(row @ force), 1e-300))
                row = row @ maps
            state = np.zeros(len(maps))
            for push in reversed(pushes):
                state = maps @ state + force @ push
            best = max(best, float(np.linalg.norm(out @ state)))
    assert 0.7 * gain < best <= gain * (1.0 + 1e-6)
    assert gain > 1.0 / 300.0


def test_the_bound_of_the_distance_is_its_own_cause():
    gain = 5e-3
    bound = distance_bound(RIVER, gain, 2.0)
    lost = 1.0 - (1.0 - (bound / 0.25) ** 2) ** 3
    assert bound == pytest.approx(gain * (2.0 + 300.0 * bound * lost), rel=1e-9)
    assert distance_bound(RIVER, gain, 40.0) == np.inf


def test_a_parallel_flow_gives_more_power_and_its_bound_of_the_distance_is_wider():
    papers, beside = energy(RIVER, 1.0, 8.5), energy(RIVER._replace(law=PARALLEL_LAW), 1.0, 8.5)
    assert beside.verdict == "certified"
    rng, speed = np.random.default_rng(3), 2.0 * np.pi * 0.0477 / 4.0
    law, most = Follow(CIRCLE, 0.0, 4.0, np.inf, parallel=True), 0.0
    for _ in range(300):
        along = np.array([0.0, rng.uniform(0.0, 2.0 * speed), 0.0])
        most = max(most, float(law.wrench(HandState.at([rng.uniform(0.01, 0.15), 0.0, 0.0], along)).force @ along))
    assert 0.98 * beside.figures["power_bound"] < most <= beside.figures["power_bound"]
    assert beside.figures["distance_bound"] > papers.figures["distance_bound"]
    assert RIVER._replace(law=PARALLEL_LAW).shear == pytest.approx(2.0 * np.pi / 4.0, rel=1e-2)
    assert RIVER.shear == 0.0


def test_the_energy_certificate_knows_what_it_does_not_know():
    good = energy(RIVER, 1.0, 8.5)
    assert good.verdict == "certified"
    assert good.figures["distance_bound"] < CIRCLE.reach
    assert good.figures["lap_energy"] < good.figures["lap_energy_bound"]
    assert np.all(terminal_speed(RIVER, RIVER.moving()) < good.figures["pace"])
    assert energy(RIVER, good.figures["push_allowed"] + 0.05, 8.5).verdict == "unknown"
    assert energy(RIVER._replace(k_r=9000.0), 0.1, 8.5).verdict == "unknown"


def test_a_curve_that_stands_still_has_no_direction():
    path = Trajectory([0.0, 1.0, 2.0], [[0, 0, 0], [0.02, 0, 0], [0.04, 0.01, 0]], ends="clamped")
    with pytest.raises(CurveError, match="stands still"):
        linearise(DEVICE, FOLLOW_LAW, path, np.array([0.0]), NO_HAND)


@pytest.mark.parametrize(
    "wrong", [lambda: HandImpedance(mass=-1.0), lambda: Sampling(0.0), lambda: Sampling(1e-3, -1.0)]
)
def test_numbers_out_of_their_intervals_are_refused(wrong):
    with pytest.raises(ParameterError):
        wrong()


@pytest.mark.parametrize("size", [1e-9, 0.01, 0.5, 5.0, 30.0])
def test_exponentials_of_a_stack_are_scipy_s_one_by_one(size: float) -> None:
    matrices = size * np.random.default_rng(3).normal(size=(20, 9, 9))
    expected = np.array([expm(one) for one in matrices])
    off = np.abs(exponentials(matrices) - expected).max(axis=(1, 2)) / np.abs(expected).max(axis=(1, 2))
    assert off.max() < 1e-11
