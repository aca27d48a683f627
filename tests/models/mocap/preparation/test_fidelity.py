"""Deviation of prepared clips from their captures, on motions of known deviation."""

import numpy as np
import pytest

from geometry import quaternions
from models.humanoid.skeleton import JOINTS
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip, PlanarDisplacement
from models.mocap.preparation.fidelity import Fidelity, fidelity
from models.mocap.preparation.looping import LoopedClip, close_or_rest
from models.mocap.preparation.poses import resampled


@pytest.fixture(scope="module")
def walk():
    return resampled(embedded("walk"), 120.0)


def as_one_cycle(clip: Clip) -> LoopedClip:
    return LoopedClip(clip, "cycle", 0.0, clip.duration, 0.0)


def test_planar_displacement_is_no_deviation(walk):
    moved = Clip(PlanarDisplacement(3.0, -2.0, 2.5).moved(walk.poses), walk.fps, "moved")
    result = fidelity(moved, walk, as_one_cycle(walk), 1.0)
    assert result.root < 1e-9
    assert result.joints < 1e-7
    assert result.gait
    assert result.faults() == ()


def test_root_deviation_does_not_align_paths_by_turning_the_body():
    """A body that sways by ±10 cm deviates by 14 cm RMS from one that sways in antiphase."""
    rest = np.zeros((241, 75))
    rest[:, 3::4] = 1.0
    sway = 0.1 * np.sin(np.arange(241) * 2.0 * np.pi / 120.0)
    forward, backward = rest.copy(), rest.copy()
    forward[:, 0], backward[:, 0] = sway, -sway
    result = fidelity(
        Clip(forward, 120.0, "forth"), Clip(backward, 120.0, "back"), as_one_cycle(Clip(backward, 120.0, "back")), 1.0
    )
    assert result.root == pytest.approx(0.2 / np.sqrt(2.0), rel=1e-2)


@pytest.mark.parametrize(("part", "root"), [(1.0, 0.0), (0.5, 0.25)])
def test_uniform_travel_given_back_to_a_gait_in_place_is_no_deviation(walk, part, root):
    """On a treadmill; where only a part of the travel was taken out, the rest of the path counts."""
    treadmill, times = walk.poses.copy(), np.linspace(0.0, 1.0, walk.n_frames)
    travel = walk.displacement
    treadmill[:, :2] -= part * np.outer(times, (travel.x, travel.y))
    result = fidelity(walk, Clip(treadmill, walk.fps, "treadmill"), as_one_cycle(walk), 1.0)
    length = np.hypot(travel.x, travel.y)
    assert result.gait
    assert result.root == pytest.approx(root * length / np.sqrt(3.0), rel=0.03, abs=0.01)


def test_joint_with_the_largest_deviation_is_the_first_extreme(walk):
    poses, knee = walk.poses.copy(), JOINTS.index("left_knee")
    columns = slice(7 + 4 * knee, 11 + 4 * knee)
    turn = quaternions.about_axis(1, np.array(0.3))
    poses[30:50, columns] = quaternions.product(poses[30:50, columns], turn)
    poses[:, 2] += 0.06
    result = fidelity(Clip(poses, walk.fps, "bent"), walk, as_one_cycle(walk), 1.0)
    assert result.extremes[0].joint == "left_knee"
    assert result.extremes[0].angle == pytest.approx(0.3, abs=1e-6)
    assert 30 / 120 <= result.extremes[0].when < 50 / 120
    assert result.joints == pytest.approx(0.3 * np.sqrt(20 / walk.n_frames / len(JOINTS)), rel=1e-6)
    assert result.root == pytest.approx(0.06, abs=1e-9)
    assert "the root is 6.0 cm" in result.faults()[0]


def test_transitions_to_rest_of_an_open_clip_are_not_compared(walk):
    part = Clip(walk.poses[: walk.n_frames // 6], 120.0, "part")
    opened = close_or_rest(part, "open")
    assert opened.start < -0.2
    result = fidelity(opened.clip, part, opened, 1.0)
    assert result.joints < 1e-7
    assert result.root < 1e-9
    assert not result.gait


def test_clip_at_another_pace_is_compared_at_corresponding_times(walk):
    slow = resampled(Clip(walk.poses, 0.8 * walk.fps, "slow"), 120.0)
    result = fidelity(slow, walk, as_one_cycle(slow), 0.8)
    assert result.joints < 1e-6


def test_lap_in_which_the_body_turns_over_is_no_gait(walk):
    poses, n = walk.poses.copy(), walk.n_frames
    wheel = 2.0 * np.pi * np.arange(n) / (n - 1)
    poses[:, 3:7] = quaternions.product(poses[:, 3:7], quaternions.about_axis(0, wheel))
    cartwheel = Clip(poses, walk.fps, "cartwheel")
    assert cartwheel.closes(1e-3)
    assert not fidelity(cartwheel, cartwheel, as_one_cycle(cartwheel), 1.0).gait


def test_arm_that_is_deeper_in_the_trunk_than_in_the_capture_is_reported(walk):
    poses = walk.poses.copy()
    for joint, axis, angle in (("left_shoulder", 1, 90.0), ("left_elbow", 2, -90.0)):
        columns = slice(7 + 4 * JOINTS.index(joint), 11 + 4 * JOINTS.index(joint))
        poses[30:40, columns] = quaternions.about_axis(axis, np.deg2rad(angle))
        if joint == "left_shoulder":
            lowered = quaternions.about_axis(0, np.deg2rad(-80.0))
            poses[30:40, columns] = quaternions.product(lowered, poses[30:40, columns])
    folded = Clip(poses, walk.fps, "folded")
    (found,) = fidelity(folded, walk, as_one_cycle(walk), 1.0).intrusions
    assert found.parts == ("left arm", "trunk")
    assert found.depth > 0.1
    assert found.captured == 0.0
    assert 30 / 120 <= found.when < 40 / 120
    assert "into the trunk at 0.2" in fidelity(folded, walk, as_one_cycle(walk), 1.0).faults()[-1]
    assert fidelity(folded, folded, as_one_cycle(walk), 1.0).intrusions == ()


def test_fault_message_has_enough_digits_to_differ_from_the_bound():
    result = Fidelity(np.deg2rad(3.0004), 0.0512, (), gait=True, intrusions=())
    assert result.faults() == (
        "joints are 3.0004° RMS from the capture; 3 at most",
        "the root is 5.1 cm RMS from the capture; 5 at most",
    )
