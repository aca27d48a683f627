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
