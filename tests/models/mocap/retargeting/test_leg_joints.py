"""Joints and End Sites of legs that few rigs have: heels, invented tips, joints beside the pelvis, still copies,
bones that stretch."""

import re

import numpy as np
import pytest

from models.errors import ModelError
from models.mocap.library import load, read_motion
from models.mocap.motion.clip import Clip
from models.mocap.retargeting.retarget import retarget
from models.mocap.retargeting.skeleton_roles import roles_of
from tests.models.mocap.retargeting.rigs import Rig, at_rate, write_rig

TIP_REMARK = "the file does not define the ends of left foot, right foot: their directions are estimated"


@pytest.fixture
def written(tmp_path):
    """A function that writes the walk on a rig, changes the text of its hierarchy, and returns the file."""

    def write(rig, change=lambda text: text):
        path = tmp_path / "r.bvh"
        write_rig(rig, at_rate("walk", 30.0), path)
        hierarchy, motion = path.read_text().split("MOTION")
        path.write_text(change(hierarchy) + "MOTION" + motion)
        return path

    return write


def with_heels(text):
    """A joint at the heel between ankle and toes, as in OpenSim, of which the heel does not turn."""
    toes = re.compile(r"JOINT (\w+)ToeBase\s*\{\s*OFFSET (\S+) (\S+) (\S+)(.*?\n\t{4}\})", re.DOTALL)
    heel = np.array([-5.0, 0.8, -4.0])

    def inserted(match):
        x, y, z = np.array(match.group(2, 3, 4), dtype=float) - heel
        offset = " ".join(map(str, heel))
        name, rest = match[1], match[5]
        return f"JOINT {name}Calcn {{ OFFSET {offset} JOINT {name}ToeBase {{ OFFSET {x} {y} {z}{rest} }}"

    changed, count = toes.subn(inserted, text)
    assert count == 2
    return changed


def test_heel_between_ankle_and_toes_changes_nothing(written):
    plain = load(written(Rig())).clip
    np.testing.assert_allclose(load(written(Rig(), with_heels)).clip.poses, plain.poses, atol=1e-9)


def with_tips(*offset):
    """A function that moves the End Sites of the feet to an offset from the ankle."""

    def change(text):
        feet = re.compile(r"(JOINT \w+Foot.*?End Site\s*\{\s*OFFSET )\S+ \S+ \S+", re.DOTALL)
        changed, count = feet.subn(rf"\g<1>{offset[0]} {offset[1]} {offset[2]}", text)
        assert count == 2
        return changed

    return change


@pytest.mark.parametrize("tip", [(10, 10, -5), (0, -10, -3), (-8, 0, -5)], ids=["aside", "across", "heel"])
def test_tips_of_feet_that_do_not_point_ahead_are_not_taken_for_toes(tip, written):
    rig = Rig(without=("toe",))
    plain = load(written(rig)).clip
    loaded = load(written(rig, with_tips(*tip)))
    np.testing.assert_allclose(loaded.clip.poses, plain.poses, atol=1e-9)
    assert TIP_REMARK in loaded.report.remarks


def test_tips_of_feet_that_point_ahead_are_taken_for_toes(written):
    assert TIP_REMARK not in load(written(Rig(without=("toe",)), with_tips(15, 0, -5))).report.remarks


def test_mirrored_body_whose_feet_have_tips_alone_is_refused(written):
    def mirrored(text):
        other = {"Left": "Right", "Right": "Left"}
        return re.sub("Left|Right", lambda side: other[side[0]], with_tips(15, 0, -5)(text))

    with pytest.raises(ModelError, match="the body is mirrored: toes and knees point back"):
        load(written(Rig(without=("toe",)), mirrored))


@pytest.mark.parametrize("share", [0.4, 0.6])
def test_joint_beside_the_pelvis_that_is_taken_for_an_unknown_hip_is_refused(share, written):
    """The line from it to the knee would be up to 7° off the thigh."""

    def renamed(text):
        return text.replace("_buttock", "HipJoint").replace("UpLeg", "Coxa")

    with pytest.raises(ModelError, match="left thigh bends at LeftCoxa, between LeftHipJoint and LeftLeg"):
        load(written(Rig(hips=share), renamed))


@pytest.mark.parametrize("copied", [r"\g<1>", r"\g<1>1", r"\g<1>_jnt"], ids=["equal name", "number", "suffix"])
def test_leg_of_a_control_rig_that_does_not_move_is_not_taken(copied, written):
    """It stands before the leg that moves, and has its joints' names."""

    def with_still_legs(text):
        legs = re.findall(r"\tJOINT \w+UpLeg\n.*?\n\t\}\n", text, re.DOTALL)
        still = [re.sub(r"\t*CHANNELS.*\n", "", re.sub(r"(?<=JOINT )(\w+)", copied, leg)) for leg in legs]
        assert len(legs) == 2
        return text.replace(legs[0], "".join((*still, legs[0])))

    plain = load(written(Rig())).clip
    np.testing.assert_allclose(load(written(Rig(), with_still_legs)).clip.poses, plain.poses, atol=1e-9)


@pytest.mark.parametrize("stretch", [0.0, 0.02, 0.2])
def test_bones_that_change_their_lengths_are_remarked(stretch, written):
    """The right knee moves along the thigh by up to `stretch` of its length."""
    path = written(Rig(positions=True))
    motion = read_motion(path)
    knee = motion.joints.index("RightLeg")
    factor = 1.0 + stretch / 2.0 * np.sin(np.linspace(0.0, 20.0, motion.n_frames))
    motion.translations[:, knee] *= factor[:, None]
    remarks = retarget(motion, roles_of(motion.joints, motion.parents))[1].remarks
    listed = [remark for remark in remarks if "change their lengths" in remark]
    assert len(listed) == (stretch > 0.1)
    assert all("(right thigh by 19%)" in remark for remark in listed)


def test_soles_of_a_pose_that_is_held_are_remarked_as_an_estimate(tmp_path):
    pose = at_rate("walk", 30.0).poses[0]
    for n in (1, 60):
        write_rig(Rig(), Clip(np.repeat(pose[None], n, axis=0), 30.0, "held"), tmp_path / "r.bvh")
        assert any("soles' orientation is estimated" in line for line in load(tmp_path / "r.bvh").report.remarks)


def test_heading_of_feet_with_tips_below_the_ankle_is_remarked_as_an_estimate(tmp_path):
    """Of a body that squats throughout: its tips are then not in line with the shank."""
    path = tmp_path / "r.bvh"
    write_rig(Rig(without=("toe",)), at_rate("squat_dance", 30.0), path)
    hierarchy, motion = path.read_text().split("MOTION")
    path.write_text(with_tips(0, 0, -7)(hierarchy) + "MOTION" + motion)
    assert TIP_REMARK in load(path).report.remarks
