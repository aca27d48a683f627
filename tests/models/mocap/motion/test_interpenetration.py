"""How deep parts of the body are in each other, on poses that are made for it."""

import numpy as np
import pytest

from geometry import quaternions
from models.humanoid.skeleton import JOINTS, rest_pose
from models.mocap.library import embedded, embedded_names
from models.mocap.motion.clip import Clip
from models.mocap.motion.interpenetration import PARTS, depths, overlaps
from models.mocap.motion.mirror import mirrored
from models.mocap.preparation.poses import add_tangents


def turned(pose, joint, axis, degrees):
    """A pose with one joint turned about an axis of its segment."""
    columns = slice(7 + 4 * JOINTS.index(joint), 11 + 4 * JOINTS.index(joint))
    pose = pose.copy()
    pose[columns] = quaternions.product(pose[columns], quaternions.about_axis(axis, np.deg2rad(degrees)))
    return pose


def test_rest_pose_touches_nothing():
    assert (depths(rest_pose()[None]) == 0.0).all()


@pytest.mark.parametrize("name", embedded_names())
def test_embedded_clips_touch_nothing(name):
    assert depths(embedded(name).poses[::4]).max() < 0.005


CROSSED = [
    (("left leg", "right leg"), [("left_hip", 0, -15.0), ("right_hip", 0, 15.0)]),
    (("left arm", "trunk"), [("left_shoulder", 0, -80.0), ("left_shoulder", 1, 90.0), ("left_elbow", 2, -90.0)]),
    (("left arm", "legs"), [("left_shoulder", 0, -105.0)]),
]


def crossed(turns):
    pose = rest_pose()
    for turn in turns:
        pose = turned(pose, *turn)
    return pose


@pytest.mark.parametrize(("parts", "turns"), CROSSED)
def test_gradient_of_a_depth_matches_central_differences(parts, turns):
    # One leg in front, so that not two pairs of shapes are equally deep.
    pose, k, step = turned(crossed(turns), "left_hip", 1, -4.0), PARTS.index(parts), 1e-4
    gradient = overlaps(pose[None], np.zeros(len(PARTS))).gradients[0, k]
    ahead, behind = (
        depths(add_tangents(np.repeat(pose[None], 57, axis=0), sign * step * np.eye(57)))[:, k] for sign in (1, -1)
    )
    assert np.abs(gradient).max() > 0.1
    np.testing.assert_allclose(gradient, (ahead - behind) / (2 * step), atol=0.02 * np.abs(gradient).max())


@pytest.mark.parametrize(("parts", "turns"), CROSSED)
def test_limbs_that_cross_are_deep_in_each_other_and_so_is_their_mirror_image(parts, turns):
    pose = crossed(turns)
    found = depths(pose[None])[0]
    assert found[PARTS.index(parts)] > 0.03
    other = tuple(part.replace("left", "right") for part in parts) if "arm" in parts[0] else parts
    image = depths(mirrored(Clip(np.repeat(pose[None], 2, axis=0), 30.0, "crossed")).poses)[0]
    assert image[PARTS.index(other)] == pytest.approx(found[PARTS.index(parts)], abs=1e-4)
