"""Trajectory optimisation keeps limbs from going deeper into each other than they were captured."""

import numpy as np
import pytest

from geometry import quaternions
from models.humanoid.skeleton import JOINTS, rest_pose
from models.mocap.motion.clip import Clip
from models.mocap.motion.interpenetration import PARTS, depths
from models.mocap.preparation.feasible import feasible
from models.mocap.preparation.looping import close_or_rest
from models.mocap.preparation.prepare import prepared
from models.mocap.preparation.stances import stances
from models.mocap.readers.own_bvh import write_bvh

ARM_IN_TRUNK = PARTS.index(("left arm", "trunk"))


@pytest.fixture(scope="module")
def embracing():
    """A body that stands for a second with a forearm in its belly."""
    pose = rest_pose()
    for joint, axis, degrees in (("left_shoulder", 0, -80.0), ("left_shoulder", 1, 90.0), ("left_elbow", 2, -90.0)):
        columns = slice(7 + 4 * JOINTS.index(joint), 11 + 4 * JOINTS.index(joint))
        pose[columns] = quaternions.product(pose[columns], quaternions.about_axis(axis, np.deg2rad(degrees)))
    return Clip(np.repeat(pose[None], 61, axis=0), 60.0, "embracing")


@pytest.mark.parametrize("allowed", [0.0, 0.02])
@pytest.mark.slow
def test_arm_is_no_deeper_in_the_trunk_than_allowed(embracing, allowed):
    schedule, overlap = stances(embracing, embracing), np.full(len(PARTS), allowed)
    assert depths(embracing.poses[:1])[0, ARM_IN_TRUNK] > 0.03
    assert depths(feasible(embracing, schedule).clip.poses)[:, ARM_IN_TRUNK].min() > 0.03
    apart = depths(feasible(embracing, schedule, overlap=overlap).clip.poses)
    assert apart[:, ARM_IN_TRUNK].max() == pytest.approx(allowed, abs=3e-3)
    assert np.delete(apart, ARM_IN_TRUNK, axis=1).max() < 1e-3


@pytest.mark.slow
def test_arm_that_moves_towards_the_trunk_comes_to_rest_outside_of_it(tmp_path):
    """A forearm that turns in at 6 rad/s would go 9 cm deep while its velocity decays."""
    n = 60
    poses = np.repeat(rest_pose()[None], n, axis=0)
    shoulder, elbow = (slice(7 + 4 * k, 11 + 4 * k) for k in map(JOINTS.index, ("left_shoulder", "left_elbow")))
    lowered, turns = quaternions.about_axis(0, np.deg2rad(-80.0)), np.deg2rad(np.linspace(-135.0, 35.0, n))
    poses[:, shoulder] = quaternions.product(lowered, quaternions.about_axis(1, turns))
    poses[:, elbow] = quaternions.about_axis(2, np.deg2rad(-90.0))
    clip = Clip(poses, 120.0, "turned in")
    assert depths(clip.poses).max() == 0.0
    assert depths(close_or_rest(clip, "open").clip.poses)[:, ARM_IN_TRUNK].max() > 0.09
    write_bvh(clip, tmp_path / "turned_in.bvh")
    result = prepared(tmp_path / "turned_in.bvh", "open")
    assert result.near
    assert depths(result.clip.poses).max() < 0.01


@pytest.mark.slow
def test_legs_of_a_jogging_capture_do_not_pass_through_each_other(mocap):
    """One leg passed 4.9 cm deep through the other; 1.1 cm as captured."""
    assert prepared(mocap / "cmu_amc" / "02_03.amc").fidelity.intrusions == ()
