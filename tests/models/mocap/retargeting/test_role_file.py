"""Role files: the same motion as by joint names, or an error that names the valid choices."""

import re

import numpy as np
import pytest

from experiments.cli import main
from models.mocap.library import embedded, load
from models.mocap.motion.clip import Clip
from models.mocap.readers.motion_file import MotionFileError
from models.mocap.retargeting.hints import Hints
from tests.models.mocap.retargeting.rigs import Rig, write_rig

JOINT = re.compile(r"(ROOT|JOINT) (\S+)")


@pytest.fixture
def named_and_numbered(tmp_path):
    """One rig with the joint names of a vendor and with numbers, and the joint of each role in the second."""
    walk = embedded("walk")
    path, bare = tmp_path / "named.bvh", tmp_path / "bare.bvh"
    write_rig(Rig(zero="random", twists="{}Twist", fingers=True), Clip(walk.poses[::3], walk.fps / 3, "walk"), path)
    text = path.read_text()
    numbers = {name: f"Bone.{k:03d}" for k, (_, name) in enumerate(JOINT.findall(text))}
    bare.write_text(JOINT.sub(lambda found: f"{found[1]} {numbers[found[2]]}", text))
    report = load(path).report
    toes = {"left_toe": "LeftToeBase", "right_toe": "RightToeBase"}
    return path, bare, {role: numbers[joint] for role, joint in (report.taken | toes).items()}


def write_role_file(roles, tmp_path, encoding="utf-8"):
    path = tmp_path / "roles.toml"
    path.write_text("".join(f'{role} = "{joint}"\n' for role, joint in roles.items()), encoding=encoding)
    return path


def test_role_file_gives_the_same_motion_as_joint_names(named_and_numbered, tmp_path):
    named, bare, roles = named_and_numbered
    by_roles = load(bare, Hints(roles=write_role_file(roles, tmp_path)))
    np.testing.assert_allclose(by_roles.clip.poses, load(named).clip.poses, atol=1e-12)
    assert not any("--roles" in remark for remark in by_roles.report.remarks)


def test_role_file_with_a_byte_order_mark_may_omit_the_trunk_and_head(named_and_numbered, tmp_path):
    _, bare, roles = named_and_numbered
    limbs = {role: joint for role, joint in roles.items() if role.startswith(("left", "right"))}
    report = load(bare, Hints(roles=write_role_file(limbs, tmp_path, "utf-8-sig"))).report
    assert report.taken == {role: joint for role, joint in roles.items() if "toe" not in role and role != "head"}
    assert report.missing == ("head (follows chest)",)


def with_changes(roles, **changes):
    return {role: joint for role, joint in (roles | changes).items() if joint is not None}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"left_knee": "Bone.001"}, r"roles.toml: no role 'left_knee'; expected one of pelvis, abdomen, .*left_toe"),
        ({"left_thigh": "Bone.999"}, r"left_thigh: no joint of bare.bvh called 'Bone.999'; expected one of Bone.000"),
        ({"left_thigh": None}, r"no joint for left_thigh; expected left_thigh = \"NAME OF A JOINT\""),
        ({"left_toe": "Bone.000"}, r"Bone.000 is both pelvis and left_toe; expected a joint for one role"),
    ],
)
def test_error_of_an_invalid_role_names_the_valid_choices(named_and_numbered, tmp_path, capsys, changes, message):
    _, bare, roles = named_and_numbered
    path = write_role_file(with_changes(roles, **changes), tmp_path)
    for command in ("convert", "prepare"):
        assert main([command, str(bare), str(tmp_path / "out.bvh"), "--roles", str(path)]) == 2
        assert re.search(message, capsys.readouterr().err)
    assert not (tmp_path / "out.bvh").exists()


def test_parts_of_a_limb_in_the_wrong_order_are_refused(named_and_numbered, tmp_path):
    _, bare, roles = named_and_numbered
    swapped = with_changes(roles, left_forearm=roles["left_hand"], left_hand=roles["left_forearm"])
    with pytest.raises(MotionFileError, match=r"is above .* in the skeleton; expected clavicle and then upper_arm and"):
        load(bare, Hints(roles=write_role_file(swapped, tmp_path)))


@pytest.mark.parametrize("text", ["left_thigh = Bone", "left_thigh = 3", "[roles]\nleft_thigh = 'a'", ""])
def test_role_file_of_another_format_is_refused(named_and_numbered, tmp_path, text):
    (tmp_path / "roles.toml").write_text(text)
    with pytest.raises(MotionFileError, match=r"roles.toml"):
        load(named_and_numbered[1], Hints(roles=tmp_path / "roles.toml"))


@pytest.mark.parametrize(("size", "message"), [(None, "a readable role file"), (0, "a role file"),
                                            (200_000, "a role file of at most 0.1 MB")])  # fmt: skip
def test_missing_empty_or_oversized_role_file_is_refused(named_and_numbered, tmp_path, size, message):
    path = tmp_path / "roles.toml"
    if size is not None:
        path.write_bytes(b"#" * size)
    with pytest.raises(MotionFileError, match=rf"roles.toml.*; expected {message}$"):
        load(named_and_numbered[1], Hints(roles=path))


def test_joint_name_that_two_joints_have_is_refused(named_and_numbered, tmp_path):
    _, bare, roles = named_and_numbered
    bare.write_text(bare.read_text().replace(f"{roles['right_shank']}\n", f"{roles['left_shank']}\n"))
    with pytest.raises(MotionFileError, match=r"left_shank: 2 joints of bare.bvh called"):
        load(bare, Hints(roles=write_role_file(roles, tmp_path)))


def test_role_file_may_state_toes_and_wrists_of_a_capture(mocap, tmp_path):
    """In CMU's skeleton the hand is beyond the wrist, and the wrist is the end of the forearm."""
    source = mocap / "cmu_amc/02_01.amc"
    loaded = load(source)
    ends = {f"{side}_{end}": f"{side[0]}{joint}" for side in ("left", "right")
            for end, joint in (("toe", "toes"), ("wrist", "wrist"))}  # fmt: skip
    by_roles = load(source, Hints(roles=write_role_file(loaded.report.taken | ends, tmp_path)))
    np.testing.assert_allclose(by_roles.clip.poses, loaded.clip.poses, atol=1e-12)
