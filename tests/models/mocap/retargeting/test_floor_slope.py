"""A motion captured in a volume that was calibrated askew stands level."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from models.mocap.library import embedded
from models.mocap.motion import quaternions
from models.mocap.motion.clip import Clip, global_rotations
from models.mocap.retargeting.footing import levelled


@pytest.fixture(scope="module")
def walk():
    """Six strides."""
    lap = embedded("walk")
    rows = [lap.poses[:-1]]
    for _ in range(2):
        rows.append(lap.displacement.moved(rows[-1]))
    return Clip(np.concatenate(rows), lap.fps, "walk")


@pytest.mark.parametrize("tilt", [-4.0, 2.0])
def test_a_slope_along_the_way_is_found_and_taken_out(walk, tilt):
    turn = Rotation.from_euler("y", tilt, degrees=True)
    segments = global_rotations(walk.poses)
    tilted = quaternions.product(turn.as_quat(scalar_first=True), segments)
    _, level, angle = levelled(turn.apply(walk.poses[:, :3]), tilted, walk.fps)
    assert np.rad2deg(angle) == pytest.approx(abs(tilt), abs=0.1)
    left = quaternions.logarithm(quaternions.product(quaternions.conjugate(segments), level))
    assert np.rad2deg(np.linalg.norm(left, axis=2)).max() < 0.1


def test_a_level_floor_is_left_as_it_is(walk):
    segments = global_rotations(walk.poses)
    root, same, angle = levelled(walk.poses[:, :3], segments, walk.fps)
    assert angle == 0.0
    assert same is segments
    np.testing.assert_array_equal(root, walk.poses[:, :3])


def test_a_place_to_stand_tells_no_slope():
    cheer = embedded("cheer")
    turn = Rotation.from_euler("y", 3, degrees=True)
    tilted = quaternions.product(turn.as_quat(scalar_first=True), global_rotations(cheer.poses))
    assert levelled(turn.apply(cheer.poses[:, :3]), tilted, cheer.fps)[2] == 0.0
