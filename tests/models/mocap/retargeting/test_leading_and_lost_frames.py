"""Frames that are no part of the motion: leading calibration poses, lost, broken and cut frames."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from geometry import quaternions
from models.errors import ModelError
from models.humanoid.skeleton import BODIES
from models.mocap.library import embedded, embedded_names, load
from models.mocap.motion.clip import Clip
from models.mocap.preparation.prepare import prepared
from models.mocap.readers.formats import read_motion
from models.mocap.readers.own_bvh import write_bvh
from models.mocap.retargeting.body_lines import body_lines
from models.mocap.retargeting.broken_frames import repair_frames
from models.mocap.retargeting.calibration_pose import calibration_pose_length
from models.mocap.retargeting.hints import Hints
from models.mocap.retargeting.retarget import retarget
from models.mocap.retargeting.skeleton_roles import roles_of
from tests.models.mocap.retargeting.rigs import Rig, at_rate, largest_angle, write_rig

FAST_CLIPS = ("spin", "jump", "run", "backflip", "squat_dance")
RATES = (20.0, 25.0, 30.0)
UP = Hints(up="+Y")  # which somersaults do not reveal
REST_POSES = ("T", "A", "random", "legs up")


def subsampled(motion, kept):
    """Frames of a motion, with the resulting frame rate."""
    fps = motion.fps / (kept.step or 1)
    return replace(motion, rotations=motion.rotations[kept], translations=motion.translations[kept], fps=fps)


def leading_frame_count(motion, roles):
    rotations = motion.global_rotations()
    return calibration_pose_length(
        motion, roles, body_lines(motion, roles, motion.global_positions(rotations), rotations)
    )


def leading_frame_counts(path, n):
    """Leading frames that are dropped from a file as it is, without its first frame, and so on to its first `n`."""
    motion = read_motion(path)
    roles = roles_of(motion.joints, motion.parents)
    parts = [subsampled(motion, slice(first, None)) for first in range(n + 1)]
    return [leading_frame_count(repair_frames(part, roles)[0], roles) for part in parts]


def assert_same_motion_without(leading, folder):
    """The file led.bvh gives the motion of plain.bvh, from which nothing is dropped, without its leading frames."""
    led, plain = load(folder / "led.bvh", UP), load(folder / "plain.bvh", UP)
    assert (led.report.dropped, plain.report.dropped) == (leading, 0)
    np.testing.assert_allclose(led.clip.poses, plain.clip.poses, atol=1e-9)


@pytest.mark.parametrize("fps", RATES)
@pytest.mark.parametrize("name", FAST_CLIPS)
def test_leading_rest_pose_before_a_fast_motion_is_recognised(name, fps, tmp_path):
    """The rest pose has zero rotations, whatever pose that is."""
    for zero in REST_POSES:
        write_rig(Rig(zero=zero, leading=2), at_rate(name, fps), tmp_path / "led.bvh")
        assert leading_frame_counts(tmp_path / "led.bvh", 2) == [2, 1, 0]


@pytest.mark.parametrize("zero", REST_POSES)
@pytest.mark.parametrize("name", FAST_CLIPS)
def test_motion_behind_a_leading_rest_pose_is_that_without_it(name, zero, tmp_path):
    clip, held = at_rate(name, 25.0), 1 + REST_POSES.index(zero) % 2
    write_rig(Rig(zero=zero), clip, tmp_path / "plain.bvh")
    write_rig(Rig(zero=zero, leading=held), clip, tmp_path / "led.bvh")
    assert_same_motion_without(held, tmp_path)


@pytest.mark.parametrize("drop", [0.0, 45.0], ids=["T", "A"])
@pytest.mark.parametrize("fps", RATES)
@pytest.mark.parametrize("name", FAST_CLIPS)
def test_leading_arms_out_pose_before_a_fast_motion_is_dropped(name, fps, drop, tmp_path):
    """On a rig with another zero pose."""
    clip = at_rate(name, fps)
    pose = np.concatenate((clip.poses[0, :3], np.tile([1.0, 0.0, 0.0, 0.0], len(BODIES))))
    for side, sign in (("left", -1.0), ("right", 1.0)):
        k = 3 + 4 * BODIES.index(f"{side}_upper_arm")
        pose[k : k + 4] = Rotation.from_euler("x", sign * drop, degrees=True).as_quat(scalar_first=True)
    rig = Rig(zero="random", seed=5)
    write_rig(rig, Clip(np.vstack((pose, clip.poses)), clip.fps, name), tmp_path / "led.bvh")
    assert leading_frame_counts(tmp_path / "led.bvh", 1) == [1, 0]
    if fps == 25.0:
        write_rig(rig, clip, tmp_path / "plain.bvh")
        assert_same_motion_without(1, tmp_path)


@pytest.mark.parametrize("held", [0.5, 1.0, 3.0])
@pytest.mark.parametrize("zero", ["T", "random"])
def test_leading_frozen_rest_pose_of_any_duration_is_dropped(zero, held, tmp_path):
    """Zero rotations, whatever pose that is, held for a multiple of the duration of the motion."""
    clip = at_rate("walk", 30.0)
    n = round(held * clip.n_frames)
    write_rig(Rig(zero=zero), clip, tmp_path / "plain.bvh")
    write_rig(Rig(zero=zero, leading=n), clip, tmp_path / "led.bvh")
    with_leading = load(tmp_path / "led.bvh")
    assert with_leading.report.dropped == n
    assert not any("jumps" in line for line in with_leading.report.notes())
    np.testing.assert_allclose(with_leading.clip.poses, load(tmp_path / "plain.bvh").clip.poses, atol=1e-9)


def test_body_that_stands_still_and_then_walks_keeps_its_frames(tmp_path):
    """A frozen pose that is no T-pose, before a walk that begins gradually or after a cut."""
    clip = at_rate("walk", 30.0)
    n = clip.n_frames
    standing, standing_elsewhere = (np.repeat(clip.poses[k : k + 1], n, axis=0) for k in (0, 5))
    arms_out, first = np.tile([1.0, 0.0, 0.0, 0.0], (len(BODIES), 1)), clip.poses[0, 3:].reshape(-1, 4)
    turned = [quaternions.slerped(arms_out, first, share) for share in np.clip(np.arange(-n, 15) / 15.0, 0.0, 1.0)]
    lowered = np.array([np.concatenate((clip.poses[0, :3], pose.ravel())) for pose in turned])
    for before in (standing, standing_elsewhere, lowered):
        write_rig(Rig(zero="A", seed=5), Clip(np.vstack((before, clip.poses)), clip.fps, "walk"), tmp_path / "r.bvh")
        assert load(tmp_path / "r.bvh").report.dropped == 0


@pytest.mark.parametrize("held", [0.0, 0.5])
@pytest.mark.parametrize("name", ["walk", "run", "cheer"])
def test_leading_arms_out_pose_blended_into_the_motion_is_dropped(name, held, tmp_path):
    """Blended over 0.05 s, so that no step is large, after a hold of a multiple of the duration of the motion."""
    clip = embedded(name)
    pose, n = np.tile([1.0, 0.0, 0.0, 0.0], (len(BODIES), 1)), round(0.05 * clip.fps)
    first = clip.poses[0, 3:].reshape(-1, 4)
    shares = np.append(np.zeros(round(held * clip.n_frames)), np.sin(np.pi / 2.0 * np.arange(n) / n))
    blended = [np.concatenate((clip.poses[0, :3], quaternions.slerped(pose, first, s).ravel())) for s in shares]
    write_rig(Rig(zero="random", seed=5), clip, tmp_path / "plain.bvh")
    write_rig(Rig(zero="random", seed=5), Clip(np.vstack((blended, clip.poses)), clip.fps, name), tmp_path / "led.bvh")
    with_leading, plain = load(tmp_path / "led.bvh", UP), load(tmp_path / "plain.bvh", UP).clip
    n = len(shares)
    assert n - 1 <= with_leading.report.dropped <= n
    kept = with_leading.clip.poses[n - with_leading.report.dropped :]
    assert largest_angle(Clip(kept, clip.fps, name), plain) < 1.0


@pytest.mark.parametrize("fps", [24.0, 30.0, 60.0])
def test_leading_arms_out_pose_that_a_filter_has_spread_over_a_fifth_of_a_second_is_dropped(fps, tmp_path):
    """Before a motion that is much slower than the steps of the filter, of which the last ones may remain."""
    clip = at_rate("cheer", fps)
    calm = Clip(np.repeat(clip.poses[:1], 4 * round(fps), axis=0), fps, "calm")
    calm.poses[:, 7:11] = Rotation.from_euler("z", 0.1 * np.sin(np.arange(calm.n_frames) / fps)[:, None]).as_quat(
        scalar_first=True
    )
    first, n = calm.poses[0, 3:].reshape(-1, 4), round(0.2 * fps)
    pose = np.tile([1.0, 0.0, 0.0, 0.0], (len(BODIES), 1))
    shares = np.sin(np.pi / 2.0 * np.arange(n) / n)
    blended = [np.concatenate((calm.poses[0, :3], quaternions.slerped(pose, first, s).ravel())) for s in shares]
    write_rig(Rig(zero="random", seed=5), Clip(np.vstack((blended, calm.poses)), fps, "calm"), tmp_path / "led.bvh")
    assert n - 1 <= load(tmp_path / "led.bvh", UP).report.dropped <= n


@pytest.mark.parametrize("name", embedded_names())
def test_motion_that_begins_at_any_frame_keeps_its_frames(name, tmp_path):
    write_rig(Rig(), embedded(name), tmp_path / "r.bvh")
    motion = read_motion(tmp_path / "r.bvh")
    roles = roles_of(motion.joints, motion.parents)
    for every in {1, round(motion.fps / 30), round(motion.fps / 20)}:
        for first in range(0, motion.n_frames - 12 * every, max(1, motion.n_frames // 12)):
            part = subsampled(motion, slice(first, None, every))
            assert leading_frame_count(part, roles) == 0, (every, first)
            assert repair_frames(part, roles)[1:] == ((), (), False, (), ()), (every, first)


@pytest.mark.parametrize("name", embedded_names())
def test_motion_that_ends_at_any_frame_keeps_its_last_frame(name, tmp_path):
    write_rig(Rig(), embedded(name), tmp_path / "r.bvh")
    motion = read_motion(tmp_path / "r.bvh")
    roles = roles_of(motion.joints, motion.parents)
    for every in {1, round(motion.fps / 30), round(motion.fps / 20)}:
        for last in range(12 * every, motion.n_frames, max(1, motion.n_frames // 40)):
            assert not repair_frames(subsampled(motion, slice(None, last, every)), roles).shortened, (every, last)


def test_motion_that_starts_evenly_from_its_rest_pose_keeps_it(tmp_path):
    """The zero pose is then a keyframe, not a calibration pose."""
    clip = at_rate("spin", 30.0)
    rest = np.concatenate((clip.poses[0, :3], np.tile([1.0, 0.0, 0.0, 0.0], len(BODIES))))
    transition = [np.concatenate((clip.poses[0, :3], quaternions.slerped(
        rest[3:].reshape(-1, 4), clip.poses[0, 3:].reshape(-1, 4), share).ravel())) for share in (0.0, 0.25, 0.5, 0.75)
    ]  # fmt: skip
    write_rig(Rig(), Clip(np.vstack((transition, clip.poses)), clip.fps, "spin"), tmp_path / "r.bvh")
    assert load(tmp_path / "r.bvh").report.dropped == 0


@pytest.mark.slow
def test_only_rest_poses_are_dropped_from_captures(mocap):
    dropped = {}
    for path in sorted((*mocap.rglob("*.bvh"), *mocap.glob("cmu_amc/*.amc"), *mocap.glob("deepmimic/*_[a-z]*.txt"))):
        if path.stem.endswith("character"):
            continue
        motion = read_motion(path)
        roles = roles_of(motion.joints, motion.parents)
        if isinstance(roles, str):
            continue
        for every in {1, max(1, round(motion.fps / 30)), max(1, round(motion.fps / 20))}:
            part = subsampled(motion, slice(None, None, every))
            if part.n_frames >= 10 and (n := leading_frame_count(part, roles)):
                dropped[path.name, every] = n
            assert repair_frames(part, roles).frames == () or "16_09" in path.name
    assert {name for name, _ in dropped} == {"01_01.bvh", "dme_example.bvh"}
    assert set(dropped.values()) == {1}


@pytest.mark.parametrize(("first", "n"), [(20, 1), (20, 3)])
def test_lost_frames_are_interpolated_and_remarked(walk_rows, first, n):
    table, load_rows = walk_rows
    whole = load_rows(table)
    lost = table.copy()
    lost[first : first + n] = 0.0
    clip, report, _ = load_rows(lost)
    assert largest_angle(clip, whole.clip) < 8.0
    which = "frame 20" if n == 1 else "3 frames, the first of them frame 20,"
    assert any(line.startswith(f"{which} (0.67 s) did not belong") for line in report.remarks)
    assert not any("did not belong" in line for line in whole.report.remarks)


@pytest.mark.parametrize("degrees", [60.0, 120.0])
def test_joint_that_flips_for_one_frame_is_interpolated(walk_rows, degrees):
    table, load_rows = walk_rows
    disturbed = table.copy()
    disturbed[17, 30:33] += degrees
    clip, report, _ = load_rows(disturbed)
    assert largest_angle(clip, load_rows(table).clip) < 5.0
    assert any(line.startswith("frame 17 (0.57 s) did not belong") for line in report.remarks)


@pytest.mark.parametrize("columns", [slice(30, 33), slice(0, 3), slice(0, None)], ids=["joint", "root", "all"])
def test_last_frame_that_jumps_away_is_dropped(walk_rows, columns):
    table, load_rows = walk_rows
    disturbed = table.copy()
    disturbed[-1, columns] += 120.0
    clip, report, _ = load_rows(disturbed)
    whole = load_rows(table).clip
    assert clip.n_frames == whole.n_frames - 1
    assert largest_angle(clip, Clip(whole.poses[:-1], whole.fps, "walk")) < 1.0
    assert [line for line in report.remarks if "frame" in line] == [
        "the last frame did not belong to the motion before it: left out"
    ]
    assert not any("last frame" in line for line in load_rows(table).report.remarks)


@pytest.mark.parametrize("columns", [slice(30, 33), slice(0, 3), slice(0, None)], ids=["joint", "root", "all"])
def test_first_frame_that_jumps_away_is_dropped(walk_rows, columns):
    table, load_rows = walk_rows
    disturbed = table.copy()
    disturbed[0, columns] += 120.0
    clip, report, _ = load_rows(disturbed)
    assert (clip.n_frames, report.dropped) == (len(table) - 1, 1)
    assert largest_angle(clip, load_rows(table[1:]).clip) < 1.0


def test_reversal_of_a_fast_motion_is_no_broken_frame(walk_rows):
    """The frames beside the turning point are equal, but the motion approaches and leaves it."""
    table, load_rows = walk_rows
    outward = table[:9].copy()
    outward[:, 30] += np.array([0.0, 0.0, 0.0, 2.0, 4.0, 8.0, 12.0, 26.0, 58.0])
    there_and_back = np.vstack((outward, outward[-2::-1]))
    assert not any("did not belong" in line for line in load_rows(there_and_back).report.remarks)


def test_root_that_jumps_for_one_frame_is_interpolated(walk_rows):
    table, load_rows = walk_rows
    disturbed = table.copy()
    disturbed[12, :3] = 0.0
    clip, _, _ = load_rows(disturbed)
    np.testing.assert_allclose(clip.poses[:, :3], load_rows(table).clip.poses[:, :3], atol=0.01)


def test_long_gap_is_remarked(walk_rows):
    table, load_rows = walk_rows
    lost = table.copy()
    lost[12:22] = 0.0
    assert any("the whole body jumps in a frame at 0.37 s, 0.70 s:" in line for line in load_rows(lost).report.remarks)


def test_cut_between_two_takes_is_remarked(walk_rows):
    table, load_rows = walk_rows
    joined = np.vstack((table[:20], table[8:]))
    joined[20:, [0, 2]] += np.abs(table[:, 1]).max()
    assert not any("jumps" in line for line in load_rows(table).report.remarks)
    assert any("the whole body jumps in a frame at 0.63 s:" in line for line in load_rows(joined).report.remarks)


def test_permanent_joint_jump_within_a_frame_is_remarked(walk_rows):
    table, load_rows = walk_rows
    jumped = table.copy()
    jumped[20:, 30] += 80.0
    jump_remarks = [line for line in load_rows(jumped).report.remarks if "jump within a frame" in line]
    assert len(jump_remarks) == 1
    assert re.match(r"joints jump within a frame, the others do not: \w+ by 80° at 0.63 s;", jump_remarks[0])
    assert not any("jump within" in line for line in load_rows(table).report.remarks)


def test_frame_time_too_long_for_a_camera_is_remarked_and_not_prepared(walk_rows, tmp_path):
    text = (tmp_path / "r.bvh").read_text()
    assert not any("a frame lasts" in line for line in load(tmp_path / "r.bvh").report.remarks)
    for seconds, shown in (("0.5", "0.5"), ("33.3333", "33")):
        (tmp_path / "r.bvh").write_text(re.sub(r"Frame Time: \S+", f"Frame Time: {seconds}", text))
        shown = f"a frame lasts {shown} s, longer than a camera's: if that is wrong, give --frame-rate"
        assert shown in load(tmp_path / "r.bvh").report.remarks
    with pytest.raises(ModelError, match=r"since a frame lasts 33 s; expected a Frame Time in seconds, such as"):
        prepared(tmp_path / "r.bvh")


def test_motion_of_less_than_two_prepared_frames_is_refused(walk_rows, tmp_path):
    path = tmp_path / "r.bvh"
    path.write_text(re.sub(r"Frame Time: \S+", "Frame Time: 0.00003", path.read_text()))
    with pytest.raises(ModelError, match=r"frames that last 0\.00\d+ s; expected 1/120 s at least: a Frame Time"):
        prepared(path)


def test_legs_that_swing_faster_than_any_human_s_are_remarked(walk_rows, tmp_path):
    text = (tmp_path / "r.bvh").read_text()
    for seconds, expected_count in (("0.0333333", 0), ("0.0083333", 0), ("0.0033333", 1), ("0.0001", 1)):
        (tmp_path / "r.bvh").write_text(re.sub(r"Frame Time: \S+", f"Frame Time: {seconds}", text))
        remarks = load(tmp_path / "r.bvh").report.remarks
        assert sum("faster than any human's" in line for line in remarks) == expected_count


def test_assumed_frame_rate_is_remarked(tmp_path):
    """AMC files state none."""
    write_rig(Rig(), at_rate("walk", 30.0), tmp_path / "r.bvh")
    motion = read_motion(tmp_path / "r.bvh")
    roles = roles_of(motion.joints, motion.parents)
    assert retarget(motion, roles)[1].remarks == ()
    (remark,) = retarget(replace(motion, timed=False), roles)[1].remarks
    assert remark.startswith("the file states no frame rate: 30 a second are assumed; ")


def test_frame_rate_hint_replaces_the_rate_of_the_file(tmp_path):
    """In a retargeted file, and in a file of the figure, which is otherwise read unchanged."""
    for name, write in (
        ("r.bvh", lambda clip, path: write_rig(Rig(), clip, path)),
        ("own.bvh", lambda *to: write_bvh(*to)),
    ):
        write(at_rate("walk", 30.0), tmp_path / name)
        expected = load(tmp_path / name).clip
        text = (tmp_path / name).read_text()
        (tmp_path / name).write_text(re.sub(r"Frame Time: \S+", "Frame Time: 33.3333", text))
        stated = load(tmp_path / name, Hints(frame_rate=30.0))
        assert stated.clip.fps == 30.0
        np.testing.assert_array_equal(stated.clip.poses, expected.poses)
        assert stated.report is None or stated.report.remarks == ()


@pytest.mark.parametrize("rate", [0.0, -60.0, float("nan"), float("inf"), 1e6])
def test_invalid_frame_rate_hint_is_refused(rate):
    with pytest.raises(ModelError, match=r"frame rate is .* a second; expected 0\.1 to 10000, such as 60"):
        Hints(frame_rate=rate)


@pytest.mark.parametrize(("kept", "repeats"), [((0, 0, 2, 2, 4, 4), "doubled"), ((0, 1, 2, 3, 3, 5), "pulldown")])
def test_repeated_frames_are_interpolated(kept, repeats, walk_rows):
    """As where a file of 15 frames a second is written with 30, or 24 with 30."""
    rows, load_rows = walk_rows
    n = len(rows) // 6 * 6
    taken = (np.arange(0, n, 6)[:, None] + kept).ravel()
    found, whole = load_rows(rows[taken]), load_rows(rows[:n])
    assert "frames repeat the one before" in " ".join(found.report.remarks)
    assert not any("repeat" in remark for remark in whole.report.remarks)
    n = found.clip.n_frames
    assert n == len(taken) - (kept[-1] == kept[-2])
    assert largest_angle(Clip(found.clip.poses, 30.0, "f"), Clip(whole.clip.poses[:n], 30.0, "w")) < 8.0
    repeated = load_rows(rows[taken] + np.arange(len(taken))[:, None] * 1e-9)
    assert largest_angle(Clip(repeated.clip.poses[:n], 30.0, "f"), Clip(whole.clip.poses[:n], 30.0, "w")) > 8.0


def test_a_pose_that_is_held_at_an_end_or_for_long_is_no_repeated_frame(walk_rows):
    rows, load_rows = walk_rows
    middle = np.concatenate([rows[:12], np.repeat(rows[12:13], 6, axis=0), rows[13:]])
    ends = np.concatenate([rows[:1], rows, rows[-1:], rows[-1:]])
    for held in (middle, ends):
        assert not any("repeat" in remark for remark in load_rows(held).report.remarks)
