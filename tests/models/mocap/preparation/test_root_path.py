import numpy as np
import pytest

from geometry.arrays import Array
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip
from models.mocap.motion.kinematics import sole_points
from models.mocap.preparation.poses import resampled, smoothed
from models.mocap.preparation.root_path import without_foot_sliding

FPS = 120.0


def _ramp(n: int) -> Array:
    """A ramp from 0 to 1 with rest at both ends and constant speed between."""
    speed = np.clip(np.minimum(np.arange(n) - 20, n - 21 - np.arange(n)) / 6.0, 0.0, 1.0)
    return np.cumsum(speed) / speed.sum()


def _standing() -> Array:
    return resampled(embedded("cheer"), FPS).poses[0]


def test_body_sliding_over_the_floor_under_load_is_held_by_its_feet():
    poses = np.repeat(_standing()[None], 130, axis=0)
    poses[:, 0] += 1.0 * _ramp(130)  # 1.2 m/s
    clip = Clip(poses, FPS, "slides")
    held = without_foot_sliding(clip, smoothed(clip))
    travel = np.ptp(sole_points(held.poses)[:, :, 0], axis=0)
    assert travel.max() < 0.15  # motion slower than the bound of a standing foot remains
    np.testing.assert_array_equal(held.poses[:, 2:], clip.poses[:, 2:])


@pytest.mark.parametrize("name", ["walk", "run", "jump"])
def test_clip_whose_feet_rest_under_load_keeps_its_path(name: str):
    clip = resampled(embedded(name), FPS)
    assert without_foot_sliding(clip, smoothed(clip)) is clip


@pytest.mark.parametrize("name", ["walk", "run"])
def test_gait_in_place_gets_its_travel_back_also_in_flights(name: str):
    gait = resampled(embedded(name), FPS)
    poses, travel = gait.poses.copy(), gait.poses[-1, :2] - gait.poses[0, :2]
    poses[:, :2] -= np.linspace(0.0, 1.0, gait.n_frames)[:, None] * travel
    treadmill = Clip(poses, FPS, "treadmill")
    returned = without_foot_sliding(treadmill, smoothed(treadmill))
    regained = returned.poses[-1, :2] - returned.poses[0, :2]
    assert np.linalg.norm(regained - travel) < 0.03 * np.linalg.norm(travel)
