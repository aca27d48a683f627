"""Left and right of a rig: mirrored bodies and swapped limbs are refused, and knees that seem to bend back are read."""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from geometry import quaternions
from models.errors import ModelError
from models.humanoid.skeleton import BODIES
from models.mocap.library import load
from models.mocap.motion.kinematics import global_rotations
from models.mocap.retargeting.hints import Hints
from tests.models.mocap.retargeting.posed_clips import posed
from tests.models.mocap.retargeting.rigs import Rig, write_rig

SWAP_TEST_CLIPS = ("walk", "ginga", "cheer", "squat_dance")


def test_kneeling_body_is_not_taken_for_mirrored(motions, tmp_path):
    """Its toes point backwards in the world, and forwards relative to their shanks."""
    bend = [(f"{side}_{part}", "y", degrees) for side in ("left", "right")
            for part, degrees in (("thigh", 0.0), ("shank", 90.0), ("foot", 30.0))]  # fmt: skip
    kneeling = posed(bend, motions.clip("cheer"))
    write_rig(Rig(), kneeling, tmp_path / "r.bvh")
    assert load(tmp_path / "r.bvh", Hints(up="+Y")).report.up == "+Y"
    swap_sides(tmp_path / "r.bvh", "")
    with pytest.raises(ModelError, match="the body is mirrored"):
        load(tmp_path / "r.bvh", Hints(up="+Y"))


def seen_by_a_depth_camera(clip, knees, reach):
    """The clip on straight legs whose knees seem to bend by some angles, with arms `reach` ahead of hanging [deg]."""
    legs = [(f"{side}_{part}", "y", degrees) for side, knee in zip(("left", "right"), knees, strict=True)
            for part, degrees in (("thigh", 0.0), ("shank", knee), ("foot", -knee))]  # fmt: skip
    still = posed([*legs, ("left_forearm", "y", 0.0), ("right_forearm", "y", 0.0)], clip)
    for side, down in (("left", -80.0), ("right", 80.0)):
        k = 3 + 4 * BODIES.index(f"{side}_upper_arm")
        arm = Rotation.from_euler("xy", (down, -reach), degrees=True)
        still.poses[:, k : k + 4] = arm.as_quat(scalar_first=True)
    return still


@pytest.mark.parametrize("knees", [(-20.0, -20.0), (-20.0, 3.0)])
def test_legs_face_ahead_though_straight_knees_seem_to_bend_back(knees, motions, tmp_path):
    """Depth cameras see them so; without toes, hands that are held out tell where the body faces."""
    rig = Rig(zero="random", without=("toe",), tips=None)
    write_rig(rig, seen_by_a_depth_camera(motions.clip("cheer"), knees, 60.0), tmp_path / "r.bvh")
    rotations = global_rotations(load(tmp_path / "r.bvh", Hints(up="+Y")).clip.poses)
    ahead = quaternions.rotated(rotations, np.array([1.0, 0.0, 0.0]))
    for part in ("left_thigh", "left_shank", "right_thigh", "right_shank"):
        turned = np.sum(ahead[:, BODIES.index(part)] * ahead[:, BODIES.index("pelvis")], axis=1)
        assert np.median(turned) > np.cos(np.deg2rad(30.0))


def test_body_with_hanging_arms_whose_knees_bend_back_may_be_mirrored(motions, tmp_path):
    back = seen_by_a_depth_camera(motions.clip("cheer"), (-20.0, -20.0), 0.0)
    write_rig(Rig(without=("toe",), tips=None), back, tmp_path / "r.bvh")
    with pytest.raises(ModelError, match="the body is mirrored: knees point back"):
        load(tmp_path / "r.bvh", Hints(up="+Y"))


def swap_sides(path, *words):
    """Swap left and right in those joint names of a file that contain one of the words."""
    sides = {"Left": "Right", "Right": "Left"}
    pattern = re.compile(rf"(Left|Right)(?={'|'.join(words)})")
    path.write_text(pattern.sub(lambda found: sides[found[1]], path.read_text()))


def test_mirrored_body_is_refused(motions, tmp_path):
    write_rig(Rig(), motions.clip("squat_dance"), tmp_path / "r.bvh")
    swap_sides(tmp_path / "r.bvh", "")
    with pytest.raises(ModelError, match=r"the body is mirrored.* --roles FILE"):
        load(tmp_path / "r.bvh")


@pytest.mark.parametrize(
    ("limbs", "words"),
    [("arms", ("Shoulder", "Arm", "ForeArm", "Hand")), ("legs", ("UpLeg", "Leg", "Foot", "ToeBase"))],
)
@pytest.mark.parametrize("name", SWAP_TEST_CLIPS)
def test_arms_or_legs_with_swapped_sides_are_refused(limbs, words, name, motions, tmp_path):
    write_rig(Rig(), motions.clip(name), tmp_path / "r.bvh")
    swap_sides(tmp_path / "r.bvh", *words)
    with pytest.raises(ModelError, match=rf"left and right of the {limbs} are exchanged.* --roles FILE"):
        load(tmp_path / "r.bvh")
