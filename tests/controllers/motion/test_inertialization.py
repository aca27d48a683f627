"""Inertialisation: end conditions of the quintic offset, and no reversal on the way to rest."""

import numpy as np
import pytest

from controllers.motion.inertialization import add_offset, decaying_offset, stopping_distance

T = 0.4
RNG = np.random.default_rng(11)


def _derivatives(start: np.ndarray, s: float) -> np.ndarray:
    """o, ȯ, ö by finite differences on five points inside [0, T], shape (3, n)."""
    h = 1e-3
    s = min(max(s, 2.0 * h), T - 2.0 * h)
    rows = np.empty((5, start.shape[1]))
    for k in range(5):
        decaying_offset(start, T, s + (k - 2) * h, rows[k])
    polynomial = np.polynomial.polynomial.polyfit(np.arange(-2, 3) * h, rows, 4)
    return np.array([polynomial[0], polynomial[1], 2.0 * polynomial[2]])


def test_offset_is_the_quintic_with_given_start_and_zero_end() -> None:
    start = RNG.normal(size=(3, 5)) * [[0.3], [2.0], [20.0]]
    times = np.linspace(0.0, T, 12)
    rows = np.empty((12, 5))
    for time, row in zip(times, rows, strict=True):
        decaying_offset(start, T, time, row)
    # Independent solution: the quintic with these six end conditions, by its linear equations.
    powers = np.arange(6)
    ends = [
        [np.prod(powers[:, None] - np.arange(d), axis=1) * t ** np.maximum(powers - d, 0) for d in range(3)]
        for t in (0.0, T)
    ]
    matrix = np.array(ends).reshape(6, 6)
    coefficients = np.linalg.solve(matrix, np.vstack([start, np.zeros((3, 5))]))
    np.testing.assert_allclose(rows, np.polynomial.polynomial.polyval(times, coefficients).T, atol=1e-12)
    np.testing.assert_array_equal(rows[0], start[0])
    np.testing.assert_array_equal(rows[-1], 0.0)


def test_offset_ends_without_reversal_after_the_stopping_distance() -> None:
    for speed, acceleration in ((1.3, 0.0), (-0.8, -2.0), (2.0, 4.0)):
        distance = stopping_distance(speed, acceleration, T)
        start = np.array([[-distance], [speed], [acceleration]])
        offsets = np.empty((200, 1))
        for time, row in zip(np.linspace(0.0, T, 200), offsets, strict=True):
            decaying_offset(start, T, time, row)
        steps = np.diff(offsets[:, 0]) * np.sign(speed)
        assert steps.min() > -1e-12
        # Without the stopping distance the figure would have to come back.
        for time, row in zip(np.linspace(0.0, T, 200), offsets, strict=True):
            decaying_offset(start * [[0.0], [1.0], [1.0]], T, time, row)
        assert (np.diff(offsets[:, 0]) * np.sign(speed)).min() < -1e-4


def test_offset_is_smooth_between_its_ends() -> None:
    start = RNG.normal(size=(3, 3)) * [[0.3], [2.0], [20.0]]
    before = _derivatives(start, 0.1)
    after = _derivatives(start, 0.1001)
    np.testing.assert_allclose(before, after, atol=1.0)
    assert np.abs(_derivatives(start, T)[2]).max() < 2.0


@pytest.mark.parametrize("joints", [0, 3])
def test_offset_moves_the_root_in_the_world_and_joints_in_their_own_frames(joints: int) -> None:
    from scipy.spatial.transform import Rotation

    pose = np.zeros(7 + 4 * joints)
    pose[:3] = [1.0, 2.0, 3.0]
    turns = Rotation.random(joints + 1, rng=RNG)
    pose[3:] = turns.as_quat(scalar_first=True).ravel()
    offset = RNG.normal(size=6 + 3 * joints)
    add_offset(pose, offset)
    np.testing.assert_allclose(pose[:3], np.array([1.0, 2.0, 3.0]) + offset[:3])
    expected = (turns * Rotation.from_rotvec(offset[3:].reshape(-1, 3))).as_matrix()
    np.testing.assert_allclose(
        Rotation.from_quat(pose[3:].reshape(-1, 4), scalar_first=True).as_matrix(), expected, atol=1e-12
    )
