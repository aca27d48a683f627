"""Files with several people are refused with the hips of each; a role file selects one."""

import re

import numpy as np
import pytest

from experiments.cli import main
from models.mocap.library import embedded, load
from models.mocap.motion.clip import Clip
from models.mocap.readers.formats import read_motion
from models.mocap.readers.motion_file import MotionFileError
from models.mocap.retargeting.bodies import people_hips
from models.mocap.retargeting.hints import Hints
from tests.models.mocap.retargeting.rigs import Rig, random_rig, write_rig

NAME = re.compile(r"(ROOT|JOINT) (\S+)")
TWO_PEOPLE = (
    'there are 2 people, with the hips A_Hips, B_Hips; expected one, or --roles FILE whose line pelvis = "B_Hips"'
)


def scene(path, *people):
    """A file that joins the people of several files under one root, with prefixed joint names and offset positions."""
    hierarchies, rows = [], []
    for file, prefix, offset in people:
        hierarchy, motion = file.read_text().split("MOTION\n")
        _, time, *frames = motion.strip().split("\n")
        named = NAME.sub(lambda found, prefix=prefix: f"JOINT {prefix}{found[2]}", hierarchy.removeprefix("HIERARCHY"))
        hierarchies.append(named.strip())
        values = np.array([frame.split() for frame in frames], dtype=float)
        values[:, 0] += offset
        rows.append(values)
    n = min(map(len, rows))
    head = "HIERARCHY\nROOT Scene\n{\nOFFSET 0 0 0\nCHANNELS 3 Xposition Yposition Zposition\n"
    table = np.hstack([np.zeros((n, 3)), *(values[:n] for values in rows)])
    lines = [" ".join(f"{value:.6f}" for value in row) for row in table]
    path.write_text("\n".join([head + "\n".join(hierarchies), "}", "MOTION", f"Frames: {n}", time, *lines, ""]))
    return path


@pytest.fixture
def files(tmp_path):
    """Files of a standing and of a walking person on the same rig."""
    walk = embedded("walk")
    walking = Clip(walk.poses[::4], walk.fps / 4, "walk")
    still = Clip(np.repeat(walking.poses[:1], walking.n_frames, axis=0), walking.fps, "still")
    for clip in (walking, still):
        write_rig(Rig(), clip, tmp_path / f"{clip.name}.bvh")
    return tmp_path / "still.bvh", tmp_path / "walk.bvh"


def test_two_people_are_refused_by_every_command(files, tmp_path, capsys):
    scene_file = scene(tmp_path / "both.bvh", (files[0], "A_", 0.0), (files[1], "B_", 100.0))
    for command in ("convert", "prepare"):
        assert main([command, str(scene_file), str(tmp_path / "out.bvh")]) == 2
        assert TWO_PEOPLE in capsys.readouterr().err
    assert main(["track", str(scene_file)]) == 2
    assert TWO_PEOPLE in capsys.readouterr().err
    assert not (tmp_path / "out.bvh").exists()


@pytest.mark.parametrize(("prefix", "which"), [("A_", 0), ("B_", 1)])
def test_role_file_with_a_pelvis_selects_its_person(files, tmp_path, prefix, which):
    scene_file = scene(tmp_path / "both.bvh", (files[0], "A_", 0.0), (files[1], "B_", 100.0))
    (tmp_path / "roles.toml").write_text(f'pelvis = "{prefix}Hips"\n')
    loaded, single = load(scene_file, Hints(roles=tmp_path / "roles.toml")), load(files[which])
    np.testing.assert_allclose(loaded.clip.poses, single.clip.poses, atol=1e-6)
    assert set(loaded.report.taken.values()) == {prefix + joint for joint in single.report.taken.values()}
    assert all(joint == "Scene" or joint.startswith(prefix) for joint in loaded.report.unused)


def test_role_file_with_limbs_selects_their_person_and_its_head(files, tmp_path):
    scene_file = scene(tmp_path / "both.bvh", (files[0], "A_", 0.0), (files[1], "B_", 100.0))
    taken = load(files[1]).report.taken
    limbs = {role: joint for role, joint in taken.items() if role.startswith(("left", "right"))}
    (tmp_path / "roles.toml").write_text("".join(f'{role} = "B_{joint}"\n' for role, joint in limbs.items()))
    assert load(scene_file, Hints(roles=tmp_path / "roles.toml")).report.taken["head"] == f"B_{taken['head']}"


def test_role_file_with_only_a_pelvis_leaves_other_roles_to_joint_names(files, tmp_path):
    (tmp_path / "roles.toml").write_text('pelvis = "Hips"\n')
    loaded, named = load(files[1], Hints(roles=tmp_path / "roles.toml")), load(files[1])
    np.testing.assert_array_equal(loaded.clip.poses, named.clip.poses)
    assert loaded.report.taken == named.report.taken


def test_people_with_the_same_joint_names_are_refused(files, tmp_path):
    scene_file = scene(tmp_path / "both.bvh", (files[0], "", 0.0), (files[1], "", 100.0))
    with pytest.raises(MotionFileError, match=r"2 people, with the hips Hips, Hips; expected one, or joints of"):
        load(scene_file)


def test_three_people_are_refused(files, tmp_path):
    scene_file = scene(tmp_path / "s.bvh", (files[0], "A_", 0.0), (files[1], "B_", 100.0), (files[1], "C_", -100.0))
    with pytest.raises(MotionFileError, match=r"3 people, with the hips A_Hips, B_Hips, C_Hips"):
        load(scene_file)


def test_coincident_copy_of_a_skeleton_is_dropped_with_a_remark(files, tmp_path):
    loaded = load(scene(tmp_path / "both.bvh", (files[1], "DEF-", 0.0), (files[1], "ORG-", 0.0)))
    np.testing.assert_allclose(loaded.clip.poses, load(files[1]).clip.poses, atol=1e-6)
    remark = "2 skeletons have their hips at the same position (DEF-Hips, ORG-Hips): that of DEF-Hips is used"
    assert any(remark in line for line in loaded.report.notes())


@pytest.mark.slow
def test_one_person_on_a_random_rig_counts_as_one(tmp_path):
    """Twist joints, fingers, props, nodes above the hips and joints before the thighs are no second person."""
    walk = embedded("walk")
    clip, rng = Clip(walk.poses[::40], walk.fps / 40, "walk"), np.random.default_rng(3)
    for _ in range(60):
        write_rig(rig := random_rig(rng), clip, tmp_path / "r.bvh")
        assert len(people_hips(read_motion(tmp_path / "r.bvh"))) == 1, rig


@pytest.mark.slow
def test_captures_have_at_most_one_person(mocap):
    for path in sorted([*mocap.glob("*/*.bvh"), *mocap.glob("*_amc/*.amc")]):
        people = people_hips(read_motion(path))
        assert len(people) <= 1, path
        assert all(len(copies) == 1 for copies in people), path
