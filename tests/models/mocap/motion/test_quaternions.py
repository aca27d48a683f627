import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from models.mocap.motion import quaternions


@pytest.mark.parametrize("angle", [1e-5, 1e-2, 1.0, 2.8, 3.5, 5.0])
def test_the_derivative_of_the_logarithm(angle):
    """Against central differences of scipy's logarithm along rotations in the rotated frame."""
    vectors = np.random.default_rng(7).normal(size=(5, 3))
    vectors *= angle / np.linalg.norm(vectors, axis=1, keepdims=True)
    step = 1e-6 * np.eye(3)
    found = [np.stack([(_turned(v, e) - _turned(v, -e)) / 2e-6 for e in step], axis=-1) for v in vectors]
    np.testing.assert_allclose(quaternions.logarithm_derivative(vectors), found, atol=1e-8)


def _turned(v, by):
    """The vector of the turned rotation that is nearest to v, which need not be the shortest."""
    shortest = (Rotation.from_rotvec(v) * Rotation.from_rotvec(by)).as_rotvec()
    longer = (1.0 - 2.0 * np.pi / np.linalg.norm(shortest)) * shortest
    return min(shortest, longer, key=lambda vector: np.linalg.norm(vector - v))


def test_rotation_vectors_of_a_turn_that_passes_half_a_turn_do_not_leap() -> None:
    axis = np.array([0.48, -0.6, 0.64])
    angles = np.linspace(1.8 * np.pi, 0.0, 90)
    # As quaternions of either sign.
    turn = quaternions.exponential(angles[:, None] * axis) * np.where(np.arange(90) % 7 < 3, -1.0, 1.0)[:, None]
    np.testing.assert_allclose(quaternions.continuous_logarithm(turn), angles[:, None] * axis, atol=1e-12)
    assert np.abs(np.diff(quaternions.logarithm(turn), axis=0)).max() > 3.0
