"""The orientation field: its law against SciPy, its discontinuity at half a turn, and a free stylus in it."""

import numpy as np
import pytest
from numba import njit
from scipy.spatial.transform import Rotation

from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.fields.algebra.program import evaluate
from controllers.fields.follow import Follow
from controllers.fields.orientation import Orientation, curve_orientation
from controllers.state import HandState
from tests.derivatives import extrapolated_differences

RNG = np.random.default_rng(11)


def wxyz(rotation):
    return np.roll(rotation.as_quat(), 1, axis=-1)


def rotation(q):
    return Rotation.from_quat(np.roll(q, -1, axis=-1))


def rotation_between(end, start):
    """Rotation vector, in the fixed frame, from one orientation to another."""
    return (rotation(end) * rotation(start).inv()).as_rotvec()


def turning_circle(turns=1.0, samples=96):
    """A circle along which the stylus turns about an oblique axis and oscillates."""
    times = np.linspace(0.0, 4.0, samples + 1)
    lap = 0.5 * np.pi * times
    oscillation = Rotation.from_rotvec(np.outer(np.sin(lap), [0.4, -0.2, 0.3]))
    turning = Rotation.from_rotvec(np.outer(turns * lap, [0.6, 0.0, 0.8])) * oscillation
    points = Trajectory.circle(0.05, 4.0).point(times)
    points[-1] = points[0]
    return Trajectory(times, points, wxyz(turning), periodic=True)


CURVE = turning_circle()
FIELD = Orientation(CURVE, 0.2, 3e-3, np.inf)


def hand(q, p=None, w=(0.0, 0.0, 0.0)):
    position = CURVE.point(1.0) if p is None else p
    return HandState(0.0, position, wxyz(q), np.zeros(3), np.asarray(w, dtype=float))


@pytest.mark.parametrize("periodic", [True, False])
def test_compiled_orientation_and_angular_velocity_match_the_curve(periodic):
    curve = CURVE
    if not periodic:
        times = np.linspace(0.0, 2.0, 9)
        curve = Trajectory(times, CURVE.point(times), CURVE.orientation(times))
    blob = np.concatenate([np.full(5, np.nan), curve.packed()])
    for t in RNG.uniform(0.01, curve.end - 0.01, 50):
        q, w = curve_orientation(blob, 5, t)
        np.testing.assert_allclose(abs(np.dot(q, curve.orientation(t))), 1.0, atol=1e-14)
        assert np.linalg.norm(q) == pytest.approx(1.0, abs=1e-15)
        expected = extrapolated_differences(curve.orientation, t, 1e-5, rotation_between)
        np.testing.assert_allclose(w, expected, atol=1e-8)
        if periodic:
            later, later_w = curve_orientation(blob, 5, t + 2 * curve.duration)
            np.testing.assert_allclose(abs(np.dot(q, later)), 1.0, atol=1e-13)
            np.testing.assert_allclose(w, later_w, atol=1e-10)


def test_moment_is_a_spring_along_the_geodesic_and_a_damper():
    target = rotation(CURVE.orientation(1.0))
    _, spin = curve_orientation(CURVE.packed(), 0, 1.0)
    for _ in range(200):
        q, w = Rotation.random(random_state=RNG), RNG.normal(size=3)
        wrench = FIELD.wrench(hand(q, w=w))
        expected = 0.2 * (target * q.inv()).as_rotvec() + 3e-3 * (np.array(spin) - w)
        np.testing.assert_allclose(wrench.torque, expected, atol=1e-9)
        np.testing.assert_array_equal(wrench.force, 0.0)


def test_stylus_that_turns_with_the_curve_feels_no_moment():
    for t in RNG.uniform(0.0, 4.0, 30):
        _, spin = curve_orientation(CURVE.packed(), 0, t)
        wrench = FIELD.wrench(hand(rotation(CURVE.orientation(t)), CURVE.point(t), spin))
        np.testing.assert_allclose(wrench.torque, 0.0, atol=1e-9)


def test_moment_is_continuous_except_at_half_a_turn():
    target, spring = rotation(CURVE.orientation(1.0)), Orientation(CURVE, 0.2, 0.0, np.inf)

    def moment(vector):
        return spring.wrench(hand(Rotation.from_rotvec(vector) * target)).torque

    for axis in RNG.normal(size=(20, 3)):
        axis /= np.linalg.norm(axis)
        for angle in (0.0, 1e-200, 1e-9, 1.0, 3.0, np.pi * (1.0 - 1e-12)):
            np.testing.assert_allclose(moment(angle * axis), -0.2 * angle * axis, atol=1e-9)
        at_half_turn = moment(np.pi * axis)
        assert np.linalg.norm(at_half_turn) == pytest.approx(0.2 * np.pi, rel=1e-9)
        np.testing.assert_allclose(np.cross(at_half_turn, axis), 0.0, atol=1e-8)
        beyond = moment(np.pi * (1.0 + 1e-9) * axis)
        np.testing.assert_allclose(beyond, 0.2 * np.pi * axis, atol=1e-8)
        # Elsewhere it is continuous along lines: over 1e-11 it changes no more than its slope allows.
        for angle in RNG.uniform(-3.1, 3.1, 20):
            change = moment((angle + 1e-11) * axis) - moment(angle * axis)
            assert np.abs(change).max() < 1e-9


def test_moment_ends_continuously_at_the_edge_of_the_tube():
    field, q = Orientation(CURVE, 0.2, 3e-3, 0.02), Rotation.from_rotvec([0.5, -1.0, 0.3])
    for _ in range(20):
        direction = RNG.normal(size=3)
        direction /= np.linalg.norm(direction)
        centre = CURVE.point(RNG.uniform(0.0, 4.0))
        for s in np.linspace(0.0, 0.03, 40):
            near, far = (field.wrench(hand(q, centre + x * direction)).torque for x in (s, s + 1e-13))
            assert np.abs(far - near).max() < 1e-9
    np.testing.assert_array_equal(field.wrench(hand(q, np.array([0.0, 0.0, 0.03]))).torque, 0.0)
    for position in ([1e6, -1e6, 1e6], [0.0, 0.0, 0.0]):
        assert np.isfinite(FIELD.wrench(hand(q, np.array(position))).torque).all()


def test_sum_with_a_force_law_keeps_its_force_and_trace():
    follow = Follow(CURVE, 300.0, 8.0)
    both, alone = follow.program() + FIELD.program(), follow.program()
    memory, memory_alone = both.fresh_memory(), alone.fresh_memory()
    wrench, force = np.empty(6), np.empty(6)
    for k in range(100):
        turned = Rotation.random(random_state=RNG)
        state = HandState(0.0, CURVE.point(0.02 * k) * 1.1, wxyz(turned), RNG.normal(size=3), RNG.normal(size=3))
        evaluate(*both.compiled(), memory, state.vector(), wrench)
        evaluate(*alone.compiled(), memory_alone, state.vector(), force)
        np.testing.assert_array_equal(wrench[:3], force[:3])
        np.testing.assert_array_equal(memory[:8], memory_alone[:8])
        # The search for t* is warm here and cold there.
        np.testing.assert_allclose(wrench[3:], FIELD.wrench(state).torque, atol=1e-9)


@njit
def _turn(units, ops, params, memory, state, inertia, steps, angles):
    """Angles of a ball that the moment alone turns at one point of the curve, in semi-implicit steps of 0.1 ms."""
    wrench, h = np.empty(6), 1e-4
    for k in range(steps):
        evaluate(units, ops, params, memory, state, wrench)
        state[11:14] += h / inertia * wrench[3:]
        half = 0.5 * h * state[11:14]
        w, x, y, z = state[4], state[5], state[6], state[7]
        state[4] -= half[0] * x + half[1] * y + half[2] * z
        state[5] += half[0] * w + half[1] * z - half[2] * y
        state[6] += half[1] * w + half[2] * x - half[0] * z
        state[7] += half[2] * w + half[0] * y - half[1] * x
        state[4:8] /= np.sqrt((state[4:8] ** 2).sum())
        # By the arc tangent, since the arc cosine of a small angle's is rounded to 1e-8.
        angles[k] = 2.0 * np.arctan2(np.sqrt((state[5:8] ** 2).sum()), abs(state[4]))


def test_released_stylus_turns_monotonically_to_the_curve():
    """With an upright curve and critical damping the angle decreases throughout."""
    circle, inertia = Trajectory.circle(0.05, 4.0), 2e-5
    field = Orientation(circle, 0.2, 2.0 * np.sqrt(0.2 * inertia), np.inf).program()
    for axis in RNG.normal(size=(5, 3)):
        q = Rotation.from_rotvec(3.0 * axis / np.linalg.norm(axis))
        state = HandState(0.0, circle.point(1.0), wxyz(q), np.zeros(3), np.zeros(3)).vector()
        angles = np.empty(2000)
        _turn(*field.compiled(), field.fresh_memory(), state, inertia, 2000, angles)
        assert angles[0] == pytest.approx(3.0, abs=0.01)
        assert (np.diff(angles) < 1e-9).all()
        assert angles[-1] < 1e-4


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ((-1.0, 0.0, 0.1), "k_o must be finite and at least 0 N m/rad, got -1"),
        ((1.0, np.nan, 0.1), "b_o must be finite and at least 0 N m s/rad"),
        ((1.0, 0.0, 0.0), "epsilon must be at least 0.0001 m"),
    ],
)
def test_invalid_gains_raise_parameter_error(numbers, message):
    with pytest.raises(ParameterError, match=message):
        Orientation(CURVE, *numbers)
