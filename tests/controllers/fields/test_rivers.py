"""Rivers: their flow, its settling time, and that their force equals FOLLOW."""

import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from controllers.errors import ControllerError, ParameterError
from controllers.fields.bundle import RiverBundle
from controllers.fields.follow import Follow
from controllers.fields.river import River, integrate
from controllers.state import HandState
from tests.controllers.fields.field_probes import force_of, largest_jump

CIRCLE = Trajectory.circle(0.05, 4.0)


def _knot() -> Trajectory:
    """A closed curve of varying speed and curvature, with a reach of 16 mm."""
    angle = np.linspace(0.0, 2.0 * np.pi, 65)
    radius = 0.05 + 0.008 * np.cos(3.0 * angle)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0.02 * np.sin(2.0 * angle)], axis=1)
    points[-1] = points[0]
    return Trajectory(angle, points, periodic=True)


RIVERS = [River(CIRCLE, 0.03, 0.02), River(_knot(), 0.012, 0.05)]


def settling_time(start: float, end: float, epsilon: float, tau: float) -> float:
    r"""Time [s] of the flow from one distance to a smaller one: ḋ = −w(d/ε) d/τ for any curve, so with q = (d/ε)²

    T = τ/2 (G(q_0) − G(q_1)), G(q) = ln(q/(1 − q)) + 1/(1 − q) + 1/(2 (1 − q)²).
    """
    q = np.array([start, end]) ** 2 / epsilon**2
    primitive = np.log(q / (1.0 - q)) + 1.0 / (1.0 - q) + 0.5 / (1.0 - q) ** 2
    return float(0.5 * tau * (primitive[0] - primitive[1]))


@pytest.mark.parametrize("river", RIVERS, ids=["circle", "knot"])
def test_flow_from_a_point_of_the_curve_follows_the_curve(river):
    start = 0.3
    times = np.linspace(0.0, river.curve.duration, 201)
    away = np.linalg.norm(
        integrate(river.flow, river.curve.point(start), times) - river.curve.point(start + times), axis=1
    )
    assert away.max() < 1e-6


@pytest.mark.parametrize("river", RIVERS, ids=["circle", "knot"])
def test_flow_from_within_the_tube_reaches_the_curve_after_the_settling_time(river):
    rng = np.random.default_rng(1)
    assert river.curve.reach > river.epsilon
    for _ in range(50):
        phase, share = rng.uniform(0.0, river.curve.duration), rng.uniform(0.1, 0.97)
        tangent = river.curve.velocity(phase)
        normal = np.cross(tangent, rng.normal(size=3))
        distance = share * river.epsilon
        start = river.curve.point(phase) + distance * normal / np.linalg.norm(normal)
        time = settling_time(distance, 1e-3, river.epsilon, river.tau)
        end = integrate(river.flow, start, [0.0, time])[-1]
        dense = river.curve.point(np.linspace(0.0, river.curve.duration, 20001))
        remaining = np.linalg.norm(dense - end, axis=1).min()
        # The time is exact, not only a bound: ḋ = −w d/τ holds for every curve.
        assert remaining == pytest.approx(1e-3, abs=2e-6)


def test_river_has_no_flow_and_no_force_outside_its_tube():
    river = RIVERS[0]
    p = np.array([0.081, 0.0, 0.0])
    assert not river.flow(0.0, p).any()
    assert not river.wrench(HandState.at(p, [0.3, 0.1, 0.2])).force.any()


def test_force_is_viscous_drag_towards_the_flow_and_equals_follow():
    rng = np.random.default_rng(2)
    river = River(_knot(), 0.03, 0.02, 5.0)
    follow = Follow(river.curve, 250.0, 5.0, 0.03)
    for _ in range(50):
        p = river.curve.point(rng.uniform(0, 6)) + rng.uniform(-0.01, 0.01, 3)
        v = rng.normal(scale=0.1, size=3)
        distance = np.linalg.norm(river.curve.point(np.linspace(0, 2 * np.pi, 50001)) - p, axis=1).min()
        w = max(0.0, 1.0 - (distance / 0.03) ** 2) ** 3
        np.testing.assert_allclose(river.wrench(HandState.at(p, v)).force, 5.0 * (river.flow(0, p) - w * v), atol=1e-6)
        np.testing.assert_array_equal(river.wrench(HandState.at(p, v)).force, follow.wrench(HandState.at(p, v)).force)


def test_force_of_rivers_and_bundles_is_continuous():
    rng = np.random.default_rng(3)
    bundle = RiverBundle(tuple(RIVERS), ("circle", "knot")).program()
    for program, epsilon in ((RIVERS[0].program(), 0.03), (bundle, 0.03)):
        for _ in range(8):
            centre = CIRCLE.point(rng.uniform(0, 4))
            # A direction that leaves the tube without meeting the axis of the circle, its medial axis.
            direction = np.cross(rng.normal(size=3), centre)
            direction *= 1.4 * epsilon / np.linalg.norm(direction)
            assert largest_jump(program, centre - direction, centre + direction, rng.normal(size=3) * 0.1) < 1e-9


def test_bundle_is_the_sum_of_its_rivers_and_indexes_them_by_name():
    bundle = RiverBundle(tuple(RIVERS), ("circle", "knot"))
    hand = HandState.at([0.05, 0.01, 0.005], [0.1, 0.0, 0.0])
    total = RIVERS[0].wrench(hand).force + RIVERS[1].wrench(hand).force
    assert np.linalg.norm(RIVERS[1].wrench(hand).force) > 0.01
    np.testing.assert_array_equal(bundle.wrench(hand).force, total)
    np.testing.assert_array_equal(force_of(bundle.program(), hand), total)
    np.testing.assert_array_equal(bundle.flow(0.0, hand.p), RIVERS[0].flow(0, hand.p) + RIVERS[1].flow(0, hand.p))
    assert bundle["knot"] is RIVERS[1]
    with pytest.raises(ParameterError, match=r"no river 'brook'.*circle, knot"):
        bundle["brook"]
    with pytest.raises(ParameterError, match="a name of its own"):
        RiverBundle(tuple(RIVERS), ("same", "same"))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"tau": 0.0}, "tau must be finite and at least 0.0001 s"),
        ({"epsilon": -1.0}, "epsilon"),
        ({"drag": np.nan}, "drag"),
        ({"speeds": [[0.1, 0.2]]}, r"shape \(m, 2\), m ≥ 2; their shape is \(1, 2\)"),
        ({"speeds": [[0.1, 0.2], [0.2, 0.1]]}, "row 1"),
    ],
)
def test_invalid_arguments_raise_controller_error(options, message):
    with pytest.raises(ControllerError, match=message):
        River(CIRCLE, **options)
