"""A map of one's own says a pose: its size, its derivative and its kernel follow from that."""

import numpy as np
import pytest

from controllers.errors import ParameterError
from controllers.haptic_map.base import HapticMap
from controllers.haptic_map.evaluate import MAP_KERNELS

X = np.array([0.04, -0.01, 0.02, 0.8, 0.0, 0.6, 0.0])
RATE = 3.0  # [rad/m]


class Turned(HapticMap):
    """Root along p, turned about z by RATE·p_x; its one joint turned as the stylus is."""

    def pose(self, x):
        half = 0.5 * RATE * x[0]
        return np.concatenate([x[:3], [np.cos(half), 0.0, 0.0, np.sin(half)], x[3:]])


def kernel_of(haptic_map: HapticMap, x: np.ndarray, rows: int) -> tuple[np.ndarray, np.ndarray]:
    kind, params, memory = haptic_map.compiled()
    pose, jacobian = np.empty(haptic_map.nq), np.empty((rows, 6))
    MAP_KERNELS[kind](params, x, memory, pose, jacobian)
    return pose, jacobian


def test_sizes_and_derivative_follow_from_the_pose() -> None:
    made = Turned()
    assert (made.nq, made.nv) == (11, 9)
    expected = np.zeros((9, 6))
    expected[:3, :3] = np.eye(3)
    expected[5, 0] = RATE
    # ω_H turns the joint about H's axes; its own frame is turned by R, so ω = Rᵀ ω_H.
    w, y = X[3], X[5]
    expected[6:, 3:] = np.array([[w * w - y * y, 0, 2 * w * y], [0, 1, 0], [-2 * w * y, 0, w * w - y * y]]).T
    np.testing.assert_allclose(made.jacobian(X), expected, atol=1e-8)


def test_the_kernel_asks_the_map() -> None:
    made = Turned()
    pose, jacobian = kernel_of(made, X, made.nv)
    np.testing.assert_array_equal(pose, made.pose(X))
    np.testing.assert_array_equal(jacobian, made.jacobian(X))
    assert kernel_of(made, X, 0)[0].tolist() == pose.tolist()  # without the derivative


def test_a_derivative_that_is_given_is_taken() -> None:
    class Given(Turned):
        def jacobian(self, x, memory=None):
            return np.full((9, 6), 7.0)

    assert np.all(kernel_of(Given(), X, 9)[1] == 7.0)


def test_what_goes_wrong_in_a_map_is_kept_and_the_pose_stays() -> None:
    class Fails(Turned):
        def pose(self, x):
            if x[0] > 0.05:
                raise ZeroDivisionError("beyond")
            return super().pose(x) if x[0] > 0.03 else super().pose(x)[: 11 if x[0] > -0.03 else 10]

    made = Fails()
    before, _ = kernel_of(made, X, 0)
    made.check()
    after, _ = kernel_of(made, X + np.array([0.02, 0, 0, 0, 0, 0, 0]), 0)
    np.testing.assert_array_equal(after, before)
    with pytest.raises(ZeroDivisionError, match="beyond"):
        made.check()
    wrong = Fails()
    kernel_of(wrong, np.array([-0.04, 0, 0, 1.0, 0, 0, 0]), 0)
    with pytest.raises(ParameterError, match=r"gave a pose of shape \(10,\); expected 11 finite numbers"):
        wrong.check()
