"""Frames that programs make up: held poses, rows of zeros, a calibration pose that a filter has spread."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from models.mocap.library import load, read_motion
from models.mocap.motion.clip import Clip
from models.mocap.retargeting.retarget import _world_axes, retarget
from models.mocap.retargeting.retarget_report import floor_remarks, two_digits
from models.mocap.retargeting.skeleton_roles import roles_of
from tests.models.mocap.retargeting.rigs import Rig, at_rate, largest_angle, write_rig


@pytest.mark.parametrize("front", [True, False])
def test_a_pose_that_is_held_for_long_is_said_and_turns_no_sole(walked, front) -> None:
    table, loaded = walked
    held = np.repeat(table[:1] if front else table[-1:], 4 * len(table), axis=0)
    plain, filled = loaded(table), loaded(np.vstack((held, table) if front else (table, held)))
    motion = filled.clip.poses[len(held) :] if front else filled.clip.poses[: len(table)]
    assert largest_angle(Clip(motion, 30.0, "walk"), plain.clip) < 1.0
    told = [line for line in filled.report.remarks if "nothing moves at all" in line]
    assert len(told) == 1
    assert told[0].startswith(f"nothing moves at all for {two_digits(len(held) / 30.0)} s (the first at")
    assert not any("nothing moves" in line for line in plain.report.remarks)


@pytest.mark.parametrize("where", [slice(20, 26), slice(-3, None)])
def test_rows_of_zeros_are_lost_frames_also_where_every_joint_has_a_place(where, tmp_path) -> None:
    for positions in (False, True):
        write_rig(Rig(positions=positions), at_rate("walk", 30.0), tmp_path / "r.bvh")
        head, _, rows = (tmp_path / "r.bvh").read_text().partition("Frame Time: ")
        seconds, *rows = rows.strip().splitlines()
        rows[where] = [" ".join("0" for _ in row.split()) for row in rows[where]]
        (tmp_path / f"{positions}.bvh").write_text(f"{head}Frame Time: {seconds}\n" + "\n".join(rows) + "\n")
    plain, placed = load(tmp_path / "False.bvh"), load(tmp_path / "True.bvh")
    assert largest_angle(plain.clip, placed.clip) < 0.1
    assert plain.report.remarks == placed.report.remarks


def test_the_floor_is_not_that_of_a_gap(walked) -> None:
    table, loaded = walked
    lost = table.copy()
    lost[12:22] = 0.0
    raised = np.array([0.0, 1.0, 0.0]) * np.abs(table[:, 1]).max()  # of a body whose place is above a floor at zero
    lost[:12, :3] += raised
    lost[22:, :3] += raised
    whole, gap = loaded(table).clip.poses, loaded(lost).clip.poses
    np.testing.assert_allclose(gap[22:, 2], whole[22:, 2], atol=0.01)


def test_a_calibration_pose_that_a_filter_has_spread_is_left_out_as_a_whole(tmp_path) -> None:
    write_rig(Rig(zero="along X"), at_rate("walk", 120.0), tmp_path / "r.bvh")
    motion = read_motion(tmp_path / "r.bvh")
    roles = roles_of(motion.joints, motion.parents)
    spread = motion.rotations.copy()
    for k, share in enumerate((1.0, 0.3, 0.15, 0.05)):  # of the zero pose that is left
        turns = Rotation.from_quat(spread[k], scalar_first=True).as_rotvec()
        spread[k] = Rotation.from_rotvec((1.0 - share) * turns).as_quat(scalar_first=True)
    assert retarget(motion, roles)[1].dropped == 0
    assert retarget(replace(motion, rotations=spread), roles)[1].dropped == 4


def test_times_count_from_the_first_frame_of_the_file() -> None:
    clearance = np.where(np.arange(100) < 40, 0.0, 0.3)
    (plain,), (led,) = (list(floor_remarks(clearance, 30.0, dropped)) for dropped in (0, 90))
    assert "(the first at 1.33 s)" in plain
    assert "(the first at 4.33 s)" in led


@pytest.mark.parametrize("heel_first", [True, False])
def test_of_a_heel_and_toes_the_toes_are_those_towards_which_the_knees_bend(heel_first, tmp_path) -> None:
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


def test_a_crawl_faces_where_its_trunk_points_whatever_limb_it_leans_on() -> None:
    for roll in (-30.0, 0.0, 30.0):
        crawl = Rotation.from_euler("ZYX", [40.0, 70.0, roll], degrees=True)
        axes = Rotation.from_quat(
            _world_axes(np.asarray(crawl.as_quat(scalar_first=True)), np.array([0.0, 0.0, 1.0])), scalar_first=True
        )
        x, y, _ = axes.apply(crawl.apply([0.0, 0.0, 1.0]))
        assert abs(np.rad2deg(np.arctan2(y, x))) < 1.0
