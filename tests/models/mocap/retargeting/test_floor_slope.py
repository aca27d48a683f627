"""Levelling of motions captured in a tilted volume."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from geometry import quaternions
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip
from models.mocap.motion.kinematics import global_rotations
from models.mocap.retargeting import footing
from models.mocap.retargeting.footing import levelled


@pytest.fixture(scope="module")
def walk():
    """A walk of six strides."""
    lap = embedded("walk")
    rows = [lap.poses[:-1]]
    for _ in range(2):
        rows.append(lap.displacement.moved(rows[-1]))
    return Clip(np.concatenate(rows), lap.fps, "walk")


@pytest.mark.parametrize("tilt", [-4.0, 2.0])
def test_slope_along_a_walk_is_found_and_removed(walk, tilt):
    turn = Rotation.from_euler("y", tilt, degrees=True)
    segments = global_rotations(walk.poses)
    tilted = quaternions.product(turn.as_quat(scalar_first=True), segments)
    _, level, angle = levelled(turn.apply(walk.poses[:, :3]), tilted, walk.fps)
    assert np.rad2deg(angle) == pytest.approx(abs(tilt), abs=0.1)
    remaining = quaternions.logarithm(quaternions.product(quaternions.conjugate(segments), level))
    assert np.rad2deg(np.linalg.norm(remaining, axis=2)).max() < 0.1


def test_motion_on_a_level_floor_is_unchanged(walk):
    segments = global_rotations(walk.poses)
    root, unchanged, angle = levelled(walk.poses[:, :3], segments, walk.fps)
    assert angle == 0.0
    assert unchanged is segments
    np.testing.assert_array_equal(root, walk.poses[:, :3])


def test_motion_in_place_gives_no_slope():
    cheer = embedded("cheer")
    turn = Rotation.from_euler("y", 3, degrees=True)
    tilted = quaternions.product(turn.as_quat(scalar_first=True), global_rotations(cheer.poses))
    assert levelled(turn.apply(cheer.poses[:, :3]), tilted, cheer.fps)[2] == 0.0


def test_four_stances_at_random_heights_rarely_give_a_slope():
    """A plane through four stances leaves one degree of freedom, too little to estimate their scatter."""
    rng, places = np.random.default_rng(1), np.array([[0.0, 0.2], [1.4, -0.2], [2.6, 0.3], [3.6, 1.2]])
    n_slopes = 0
    for _ in range(400):
        points = np.column_stack((places, rng.normal(0.0, 0.006, 4)))
        n_slopes += np.any(footing._floor_slopes(points, np.zeros(4, dtype=np.int64), 4) != 0.0)
    assert n_slopes / 400 < 0.08


def test_five_stances_along_a_slope_give_the_slope():
    heights = 0.02 * np.arange(5.0) * 0.7 + np.array([2.0, -1.0, -2.0, -1.0, 2.0]) * 1e-3
    points = np.column_stack((0.7 * np.arange(5.0), np.zeros(5), heights))
    np.testing.assert_allclose(footing._floor_slopes(points, np.zeros(5, dtype=np.int64), 5), [0.02, 0.0], atol=1e-4)


def test_constant_height_difference_between_feet_gives_no_slope():
    """A dance in place, left foot ahead: without a height per foot, the floor would slope by 0.7° or more."""
    feet = np.repeat([0, 1], 10)
    for seed in range(8):
        rng = np.random.default_rng(seed)
        places = np.column_stack((np.where(feet == 0, 0.4, -0.4) + rng.normal(0.0, 0.3, 20), rng.normal(0.0, 0.3, 20)))
        points = np.column_stack((places, np.where(feet == 0, 0.009, -0.009) + rng.normal(0.0, 0.002, 20)))
        assert np.linalg.norm(footing._floor_slopes(points, np.zeros_like(feet), 20)) > np.tan(np.deg2rad(0.7))
        assert not footing._floor_slopes(points, feet, 20).any()


def test_contradicting_feet_give_no_slope():
    feet, along = np.repeat([0, 1], 12), np.tile(np.linspace(-1.0, 1.0, 12), 2)
    for left in (1.0, -0.5):
        heights = 0.03 * along * np.where(feet == 0, left, 1.0)
        slopes = footing._floor_slopes(np.column_stack((along, 0.3 * feet, heights)), feet, 24)
        assert slopes[0] == (pytest.approx(0.03, rel=1e-6) if left == 1.0 else 0.0)
