"""Sharing twist along an arm keeps joint positions and hands, and leaves arms within their ranges unchanged."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from geometry import quaternions
from models.humanoid.skeleton import BODIES, JOINTS, SEGMENTS, joint_range
from models.mocap.library import embedded, embedded_names, load
from models.mocap.motion.kinematics import global_rotations
from models.mocap.retargeting.arm_twist import with_twist_shared

UPPER, FOREARM, HAND = (BODIES.index(f"right_{part}") for part in ("upper_arm", "forearm", "hand"))
ALONG = np.array([0.0, 1.0, 0.0])


def largest_excess(segments):
    """Largest excess over the range of each joint [rad], shape (17,)."""
    parents = [segment.parent for segment in SEGMENTS[1:]]
    local = quaternions.product(quaternions.conjugate(segments[:, parents]), segments[:, 1:])
    vectors, limits = quaternions.logarithm(local), joint_range()
    return np.maximum(limits[:, :, 0] - vectors, vectors - limits[:, :, 1]).max(axis=(0, 2))


def twisted(segments, body, angles):
    rotated = segments.copy()
    rotated[:, body] = quaternions.product(segments[:, body], quaternions.about_axis(1, angles))
    return rotated


@pytest.fixture
def straight_arm():
    """Arms stretched out sideways, trunk upright."""
    segments = np.zeros((80, 18, 4))
    segments[..., 0] = 1.0
    return segments


@pytest.mark.parametrize("name", embedded_names())
def test_arms_of_clips_within_joint_ranges_are_unchanged(name):
    segments = global_rotations(embedded(name).poses)
    assert_array_equal(with_twist_shared(segments)[:, [UPPER, FOREARM]], segments[:, [UPPER, FOREARM]])


def test_pronation_beyond_the_wrist_range_is_moved_to_the_forearm(straight_arm):
    pronated = twisted(straight_arm, HAND, np.linspace(0.0, np.deg2rad(120.0), 80))
    assert largest_excess(pronated)[HAND - 1] == pytest.approx(np.deg2rad(80.0))
    shared = with_twist_shared(pronated)
    assert largest_excess(shared)[[UPPER - 1, FOREARM - 1, HAND - 1]].max() < 1e-9
    assert_array_equal(shared[:, [UPPER, HAND]], pronated[:, [UPPER, HAND]])


def test_shoulder_twist_that_the_wrist_undoes_is_removed(straight_arm):
    """By 191° at the shoulder and back at the wrist: more than half a turn, so that angles wrap."""
    angles = np.deg2rad(191.0) * np.sin(np.linspace(0.0, np.pi, 80)) ** 2
    arm = twisted(twisted(straight_arm, UPPER, angles), FOREARM, angles)
    assert largest_excess(arm)[UPPER - 1] > np.deg2rad(50.0)
    shared = with_twist_shared(arm)
    assert largest_excess(shared).max() < 1e-9
    assert_allclose(quaternions.rotated(shared, ALONG), quaternions.rotated(arm, ALONG), atol=1e-12)
    steps = quaternions.logarithm(quaternions.product(quaternions.conjugate(shared[:-1]), shared[1:]))
    assert np.linalg.norm(steps, axis=2).max() < np.deg2rad(20.0), "no jump"


def test_upper_arm_above_a_bent_elbow_is_unchanged(straight_arm):
    arm = twisted(straight_arm, UPPER, np.linspace(0.0, np.deg2rad(150.0), 80))
    bend = quaternions.about_axis(2, np.full(80, np.deg2rad(90.0)))
    arm[:, FOREARM] = arm[:, HAND] = quaternions.product(arm[:, UPPER], bend)
    assert_array_equal(with_twist_shared(arm)[:, UPPER], arm[:, UPPER])


@pytest.mark.parametrize(
    "name", ["snu/pirouette.bvh", "snu/backflip.bvh", "cmu_bvh/scaled_131_03.bvh", "animated_drawings/wave_hello.bvh"]
)
def test_captured_joint_is_within_its_range_or_named_in_the_report(name, mocap):
    loaded = load(mocap / name)
    excess = largest_excess(global_rotations(loaded.clip.poses))
    remark = next((line for line in loaded.report.remarks if "beyond the figure's range" in line), "")
    for joint, largest in zip(JOINTS, excess, strict=True):
        assert (joint.replace("_", " ") in remark) == (largest > np.deg2rad(15.0))


def test_arms_of_a_captured_pirouette_are_within_their_ranges(mocap):
    """Its file twists a straight arm by 191° at the shoulder, and back by 145° at the wrist."""
    arms = slice(BODIES.index("left_clavicle") - 1, HAND)
    assert largest_excess(global_rotations(load(mocap / "snu/pirouette.bvh").clip.poses))[arms].max() < np.deg2rad(2.0)
