"""The filter between stylus and figure: no lag at constant acceleration, exact at rest, also for orientations."""

import numpy as np
from scipy.spatial.transform import Rotation

from sim.reference.stylus_filter import extrapolate_orientation, smooth_hand, smooth_turn

SMOOTHING, PERIOD = 0.74, 8e-3
RNG = np.random.default_rng(3)


def _quaternion(rotation: Rotation) -> np.ndarray:
    return np.roll(rotation.as_quat(), 1)


def _angle(q: np.ndarray, r: np.ndarray) -> float:
    return 2.0 * min(float(np.linalg.norm(q - r)), float(np.linalg.norm(q + r)))


def _turn_of(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return q.copy(), np.zeros((2, 3))


def test_constant_orientation_is_returned_bit_for_bit() -> None:
    for measured in RNG.normal(size=(20, 4)):
        measured /= np.linalg.norm(measured)
        q, turning = _turn_of(measured)
        for _ in range(50):
            smooth_turn(q, turning, measured, SMOOTHING, PERIOD)
        np.testing.assert_array_equal(q, measured)
        np.testing.assert_array_equal(turning, 0.0)
        np.testing.assert_array_equal(extrapolate_orientation(q, turning, PERIOD), measured)


def test_rotation_about_one_axis_equals_the_position_filter() -> None:
    axis = np.array([0.36, -0.48, 0.8])
    angles = 0.3 * np.cumsum(RNG.normal(size=300)) * PERIOD + 0.5 * np.sin(np.arange(300) * 0.05)
    hand = np.zeros((3, 3))
    hand[0, 0] = angles[0]
    q, turning = _turn_of(_quaternion(Rotation.from_rotvec(angles[0] * axis)))
    for angle in angles[1:]:
        smooth_hand(hand, np.array([angle, 0.0, 0.0]), SMOOTHING, PERIOD)
        # Either sign of a quaternion is the same orientation.
        measured = RNG.choice([-1.0, 1.0]) * _quaternion(Rotation.from_rotvec(angle * axis))
        smooth_turn(q, turning, measured, SMOOTHING, PERIOD)
        assert _angle(q, _quaternion(Rotation.from_rotvec(hand[0, 0] * axis))) < 1e-12
        np.testing.assert_allclose(turning, np.outer(hand[1:, 0], axis), rtol=1e-9, atol=1e-9)


def test_constant_angular_acceleration_is_followed_without_lag() -> None:
    start, axis = Rotation.from_rotvec([0.4, 0.2, -0.9]), np.array([0.0, 0.6, 0.8])

    def orientation(t: float) -> np.ndarray:
        return _quaternion(start * Rotation.from_rotvec((0.7 * t + 0.8 * t**2) * axis))

    q, turning = _turn_of(orientation(0.0))
    for k in range(1, 201):
        smooth_turn(q, turning, orientation(k * PERIOD), SMOOTHING, PERIOD)
    t = 200 * PERIOD
    assert _angle(q, orientation(t)) < 1e-12
    np.testing.assert_allclose(turning[0], (0.7 + 1.6 * t) * axis, atol=1e-8)
    np.testing.assert_allclose(turning[1], 1.6 * axis, atol=1e-6)
    for s in (-PERIOD, PERIOD):
        assert _angle(np.array(extrapolate_orientation(q, turning, s)), orientation(t + s)) < 1e-12


def test_encoder_step_is_spread_over_several_periods() -> None:
    step = _quaternion(Rotation.from_rotvec([0.0, 0.0, 2e-3]))
    q, turning = _turn_of(np.array([1.0, 0.0, 0.0, 0.0]))
    smooth_turn(q, turning, step, SMOOTHING, PERIOD)
    first = _angle(q, np.array([1.0, 0.0, 0.0, 0.0]))
    assert 0.3 * 2e-3 < first < 0.65 * 2e-3
    for _ in range(60):
        smooth_turn(q, turning, step, SMOOTHING, PERIOD)
    assert _angle(q, step) < 1e-6
    assert abs(float(q @ q) - 1.0) < 1e-14


def test_velocity_and_acceleration_of_circular_motion_are_unbiased() -> None:
    # The filter assumes jerk that turns with the hand: without it the velocity of this lap is 1.6 % too small.
    period, lap = 2e-3, 2.2
    smoothing, rate = float(np.exp(-2.0 * np.pi * 6.0 * period)), 2.0 * np.pi / lap
    hand = np.zeros((3, 3))
    hand[0, 0] = 0.0477
    for k in range(2000):
        angle = rate * period * k
        measured = 0.0477 * np.array([np.cos(angle), np.sin(angle), 0.0])
        smooth_hand(hand, measured, smoothing, period)
    radial = measured / 0.0477
    along = np.array([-radial[1], radial[0], 0.0])
    np.testing.assert_allclose(hand[1], 0.0477 * rate * along, atol=2e-3 * 0.0477 * rate)
    np.testing.assert_allclose(hand[2], -0.0477 * rate**2 * radial, atol=3e-2 * 0.0477 * rate**2)
