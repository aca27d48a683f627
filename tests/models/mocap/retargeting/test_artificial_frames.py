"""Artificial frames in files: frozen poses, rows of zeros, a calibration pose that a filter has smeared."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from models.mocap.library import load
from models.mocap.motion.clip import Clip
from models.mocap.readers.formats import read_motion
from models.mocap.retargeting.broken_frames import repair_frames
from models.mocap.retargeting.retarget import _world_axes, retarget
from models.mocap.retargeting.retarget_report import floor_remarks, two_digits
from models.mocap.retargeting.skeleton_roles import roles_of
from tests.models.mocap.retargeting.rigs import Rig, at_rate, largest_angle, write_rig


@pytest.mark.parametrize("at_start", [True, False])
def test_long_frozen_pose_is_remarked_and_does_not_rotate_the_soles(walk_rows, at_start) -> None:
    table, load_rows = walk_rows
    held = np.repeat(table[:1] if at_start else table[-1:], 4 * len(table), axis=0)
    plain, filled = load_rows(table), load_rows(np.vstack((held, table) if at_start else (table, held)))
    motion = filled.clip.poses[len(held) :] if at_start else filled.clip.poses[: len(table)]
    assert largest_angle(Clip(motion, 30.0, "walk"), plain.clip) < 1.0
    remarks = [line for line in filled.report.remarks if "nothing moves at all" in line]
    assert len(remarks) == 1
    assert remarks[0].startswith(f"nothing moves at all for {two_digits(len(held) / 30.0)} s (the first at")
    assert not any("nothing moves" in line for line in plain.report.remarks)


@pytest.mark.parametrize("rows_lost", [slice(20, 26), slice(-3, None)])
def test_rows_of_zeros_are_lost_frames_also_with_position_channels_on_every_joint(rows_lost, tmp_path) -> None:
    for positions in (False, True):
        write_rig(Rig(positions=positions), at_rate("walk", 30.0), tmp_path / "r.bvh")
        head, _, rows = (tmp_path / "r.bvh").read_text().partition("Frame Time: ")
        seconds, *rows = rows.strip().splitlines()
        rows[rows_lost] = [" ".join("0" for _ in row.split()) for row in rows[rows_lost]]
        (tmp_path / f"{positions}.bvh").write_text(f"{head}Frame Time: {seconds}\n" + "\n".join(rows) + "\n")
    plain, placed = load(tmp_path / "False.bvh"), load(tmp_path / "True.bvh")
    assert largest_angle(plain.clip, placed.clip) < 0.1
    assert plain.report.remarks == placed.report.remarks


def test_motion_that_passes_through_the_zero_pose_does_not_jump_there(tmp_path) -> None:
    """A frame of the motion was made the rest pose of the rig, and begins the file twice."""
    write_rig(Rig(), at_rate("run", 30.0), tmp_path / "r.bvh")
    motion = read_motion(tmp_path / "r.bvh")
    roles = roles_of(motion.joints, motion.parents)
    rotations = Rotation.from_quat(motion.rotations, scalar_first=True)
    rebased = (rotations[0].inv() * rotations).as_quat(scalar_first=True)
    rebased = replace(motion, rotations=np.concatenate((rebased[:1], rebased)))
    assert rebased.at_rest(range(len(motion.joints)))[:2].all()
    rebased = replace(rebased, translations=np.concatenate((motion.translations[:1], motion.translations)))
    repaired = repair_frames(rebased, roles)
    assert repaired.jumps == repaired.frames == ()


def test_floor_height_ignores_lost_frames(walk_rows) -> None:
    table, load_rows = walk_rows
    lost = table.copy()
    lost[12:22] = 0.0
    raised = np.array([0.0, 1.0, 0.0]) * np.abs(table[:, 1]).max()  # a body whose positions are above a floor at zero
    lost[:12, :3] += raised
    lost[22:, :3] += raised
    whole, gap = load_rows(table).clip.poses, load_rows(lost).clip.poses
    np.testing.assert_allclose(gap[22:, 2], whole[22:, 2], atol=0.01)


def test_calibration_pose_smeared_by_a_filter_is_dropped_entirely(tmp_path) -> None:
    write_rig(Rig(zero="along X"), at_rate("walk", 120.0), tmp_path / "r.bvh")
    motion = read_motion(tmp_path / "r.bvh")
    roles = roles_of(motion.joints, motion.parents)
    smeared = motion.rotations.copy()
    for k, share in enumerate((1.0, 0.3, 0.15, 0.05)):  # remaining share of the zero pose
        turns = Rotation.from_quat(smeared[k], scalar_first=True).as_rotvec()
        smeared[k] = Rotation.from_rotvec((1.0 - share) * turns).as_quat(scalar_first=True)
    assert retarget(motion, roles)[1].dropped == 0
    assert retarget(replace(motion, rotations=smeared), roles)[1].dropped == 4


def test_remarked_times_count_from_the_first_frame_of_the_file() -> None:
    clearance = np.where(np.arange(100) < 40, 0.0, 0.3)
    (plain,), (late,) = (
        list(floor_remarks(clearance, np.zeros((len(clearance), 3)), 30.0, dropped)) for dropped in (0, 90)
    )
    assert "(the first at 1.33 s)" in plain
    assert "(the first at 4.33 s)" in late


@pytest.mark.parametrize("heel_first", [True, False])
def test_toe_end_of_a_foot_is_the_one_towards_which_the_knee_bends(heel_first, tmp_path) -> None:
    for name, rig in (("toed", Rig()), ("bare", Rig(without=("toe",)))):
        write_rig(rig, at_rate("walk", 30.0), tmp_path / f"{name}.bvh")
    toed, bare = (read_motion(tmp_path / f"{name}.bvh") for name in ("toed", "bare"))
    tips, further = bare.tips.copy(), dict[int, np.ndarray]()
    for side in ("Left", "Right"):
        toes, foot = toed.offsets[toed.joints.index(f"{side}ToeBase")], bare.joints.index(f"{side}Foot")
        heel = np.where(np.abs(toes) == np.abs(toes).max(), -1.2, 1.0) * toes
        tips[foot], further[foot] = (heel, toes[None]) if heel_first else (toes, heel[None])
    found, _ = retarget(replace(bare, tips=tips, further_tips=further), roles_of(bare.joints, bare.parents))
    assert largest_angle(found, load(tmp_path / "toed.bvh").clip) < 1.0


def test_heading_of_a_crawl_is_the_direction_of_the_trunk_at_any_roll() -> None:
    for roll in (-30.0, 0.0, 30.0):
        crawl = Rotation.from_euler("ZYX", [40.0, 70.0, roll], degrees=True)
        axes = Rotation.from_quat(
            _world_axes(np.asarray(crawl.as_quat(scalar_first=True)), np.array([0.0, 0.0, 1.0])), scalar_first=True
        )
        x, y, _ = axes.apply(crawl.apply([0.0, 0.0, 1.0]))
        assert abs(np.rad2deg(np.arctan2(y, x))) < 1.0
