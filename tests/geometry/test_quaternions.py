import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from geometry import quaternions


@pytest.mark.parametrize("angle", [1e-5, 1e-2, 1.0, 2.8, 3.5, 5.0])
def test_logarithm_derivative_matches_central_differences(angle):
    """Central differences of scipy's logarithm along rotations in the rotated frame."""
    vectors = np.random.default_rng(7).normal(size=(5, 3))
    vectors *= angle / np.linalg.norm(vectors, axis=1, keepdims=True)
    step = 1e-6 * np.eye(3)
    expected = [
        np.stack([(_nearest_rotation_vector(v, e) - _nearest_rotation_vector(v, -e)) / 2e-6 for e in step], axis=-1)
        for v in vectors
    ]
    np.testing.assert_allclose(quaternions.logarithm_derivative(vectors), expected, atol=1e-8)


def _nearest_rotation_vector(v, increment):
    """The rotation vector nearest to v of v's rotation times the increment's; it need not be the shortest."""
    shortest = (Rotation.from_rotvec(v) * Rotation.from_rotvec(increment)).as_rotvec()
    complementary = (1.0 - 2.0 * np.pi / np.linalg.norm(shortest)) * shortest
    return min(shortest, complementary, key=lambda vector: np.linalg.norm(vector - v))


def test_continuous_logarithm_does_not_jump_beyond_half_a_turn() -> None:
    axis = np.array([0.48, -0.6, 0.64])
    angles = np.linspace(1.8 * np.pi, 0.0, 90)
    # As quaternions of either sign.
    turn = quaternions.exponential(angles[:, None] * axis) * np.where(np.arange(90) % 7 < 3, -1.0, 1.0)[:, None]
    np.testing.assert_allclose(quaternions.continuous_logarithm(turn), angles[:, None] * axis, atol=1e-12)
    assert np.abs(np.diff(quaternions.logarithm(turn), axis=0)).max() > 3.0


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_headings_of_somersaults_and_cartwheels_count_no_turns(axis, side) -> None:
    """Three turns about x or y that lean to a side, then half a turn about the vertical."""
    angles = np.concatenate((np.linspace(0.0, 6.0 * np.pi, 360), np.full(60, 6.0 * np.pi)))
    yaw = np.concatenate((np.zeros(360), np.linspace(0.0, np.pi, 60)))
    lean = quaternions.about_axis(1 - axis, 0.1 * side * np.sin(angles / 2.0))
    q = quaternions.product(
        quaternions.about_axis(2, yaw), quaternions.product(quaternions.about_axis(axis, angles), lean)
    )
    headings = quaternions.without_jumps(quaternions.heading(q), q)
    np.testing.assert_allclose([headings[0], headings[359], headings[-1]], [0.0, 0.0, np.pi], atol=0.05)


def test_headings_of_an_upright_body_count_whole_turns() -> None:
    yaw = np.linspace(0.0, 5.0 * np.pi, 100)
    q = quaternions.product(quaternions.about_axis(2, yaw), quaternions.about_axis(0, np.full(100, 0.3)))
    headings = quaternions.without_jumps(quaternions.heading(q), q)
    np.testing.assert_allclose(headings - headings[0], yaw, atol=1e-9)
