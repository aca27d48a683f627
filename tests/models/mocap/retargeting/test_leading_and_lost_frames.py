"""What is in a file and is no part of its motion: a calibration pose in front, frames that were lost."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from models.errors import ModelError
from models.humanoid.skeleton import BODIES
from models.mocap.library import embedded, embedded_names, load, read_motion
from models.mocap.motion import quaternions
from models.mocap.motion.clip import Clip
from models.mocap.preparation.prepare import prepared
from models.mocap.readers.own_bvh import write_bvh
from models.mocap.retargeting.body_lines import body_lines
from models.mocap.retargeting.broken_frames import repaired
from models.mocap.retargeting.hints import Hints
from models.mocap.retargeting.leading_pose import leading_frames
from models.mocap.retargeting.retarget import retarget
from models.mocap.retargeting.skeleton_roles import roles_of
from tests.models.mocap.retargeting.rigs import Rig, at_rate, largest_angle, write_rig

LIVELY = ("spin", "jump", "run", "backflip", "squat_dance")
RATES = (20.0, 25.0, 30.0)
UP = Hints(up="+Y")  # a body that somersaults does not tell it


def reduced(motion, kept):
    """Frames of a motion, at the rate that this makes."""
    fps = motion.fps / (kept.step or 1)
    return replace(motion, rotations=motion.rotations[kept], translations=motion.translations[kept], fps=fps)


def leading(motion, roles):
    rotations = motion.global_rotations()
    return leading_frames(motion, roles, body_lines(motion, roles, motion.global_positions(rotations), rotations))


@pytest.mark.parametrize("fps", RATES)
@pytest.mark.parametrize("name", LIVELY)
def test_a_rest_pose_before_a_fast_motion_is_left_out(name, fps, tmp_path):
    """Zero rotations, whatever the pose is."""
    clip = at_rate(name, fps)
    for zero in ("T", "A", "random", "legs up"):
        write_rig(Rig(zero=zero), clip, tmp_path / "plain.bvh")
        plain = load(tmp_path / "plain.bvh", UP)
        assert plain.report.dropped == 0
        for held in (1, 2):
            write_rig(Rig(zero=zero, leading=held), clip, tmp_path / "led.bvh")
            led, report, _ = load(tmp_path / "led.bvh", UP)
            assert report.dropped == held
            np.testing.assert_allclose(led.poses, plain.clip.poses, atol=1e-9)


@pytest.mark.parametrize("drop", [0.0, 45.0], ids=["T", "A"])
@pytest.mark.parametrize("fps", RATES)
@pytest.mark.parametrize("name", LIVELY)
def test_arms_held_out_before_a_fast_motion_are_left_out(name, fps, drop, tmp_path):
    """On a rig whose zero pose is another one."""
    clip = at_rate(name, fps)
    pose = np.concatenate((clip.poses[0, :3], np.tile([1.0, 0.0, 0.0, 0.0], len(BODIES))))
    for side, sign in (("left", -1.0), ("right", 1.0)):
        k = 3 + 4 * BODIES.index(f"{side}_upper_arm")
        pose[k : k + 4] = Rotation.from_euler("x", sign * drop, degrees=True).as_quat(scalar_first=True)
    rig = Rig(zero="random", seed=5)
    write_rig(rig, clip, tmp_path / "plain.bvh")
    write_rig(rig, Clip(np.vstack((pose, clip.poses)), clip.fps, name), tmp_path / "led.bvh")
    led = load(tmp_path / "led.bvh", UP)
    assert led.report.dropped == 1
    np.testing.assert_allclose(led.clip.poses, load(tmp_path / "plain.bvh", UP).clip.poses, atol=1e-9)


@pytest.mark.parametrize("held", [0.5, 1.0, 3.0])
@pytest.mark.parametrize("zero", ["T", "random"])
def test_a_pose_that_is_held_without_any_change_is_left_out_however_long(zero, held, tmp_path):
    """As a multiple of the motion's own duration; zero rotations, whatever the pose is."""
    clip = at_rate("walk", 30.0)
    n = round(held * clip.n_frames)
    write_rig(Rig(zero=zero), clip, tmp_path / "plain.bvh")
    write_rig(Rig(zero=zero, leading=n), clip, tmp_path / "led.bvh")
    led = load(tmp_path / "led.bvh")
    assert led.report.dropped == n
    assert not any("jumps" in line for line in led.report.notes())
    np.testing.assert_allclose(led.clip.poses, load(tmp_path / "plain.bvh").clip.poses, atol=1e-9)


def test_a_body_that_stands_still_and_then_walks_keeps_its_frames(tmp_path):
    """Held without any change, but no T-pose, whether it begins to walk slowly or is cut to."""
    clip = at_rate("walk", 30.0)
    n = clip.n_frames
    stood, elsewhere = (np.repeat(clip.poses[k : k + 1], n, axis=0) for k in (0, 5))
    arms_out, first = np.tile([1.0, 0.0, 0.0, 0.0], (len(BODIES), 1)), clip.poses[0, 3:].reshape(-1, 4)
    turned = [quaternions.slerped(arms_out, first, share) for share in np.clip(np.arange(-n, 15) / 15.0, 0.0, 1.0)]
    lowered = np.array([np.concatenate((clip.poses[0, :3], pose.ravel())) for pose in turned])
    for before in (stood, elsewhere, lowered):
        write_rig(Rig(zero="A", seed=5), Clip(np.vstack((before, clip.poses)), clip.fps, "walk"), tmp_path / "r.bvh")
        assert load(tmp_path / "r.bvh").report.dropped == 0


@pytest.mark.parametrize("held", [0.0, 0.5])
@pytest.mark.parametrize("name", ["walk", "run", "cheer"])
def test_arms_held_out_that_a_filter_blends_into_the_motion_are_left_out(name, held, tmp_path):
    """Over 0.05 s, so that no step is far from the next one; held before for a multiple of the motion's duration."""
    clip = embedded(name)
    pose, n = np.tile([1.0, 0.0, 0.0, 0.0], (len(BODIES), 1)), round(0.05 * clip.fps)
    first = clip.poses[0, 3:].reshape(-1, 4)
    shares = np.append(np.zeros(round(held * clip.n_frames)), np.sin(np.pi / 2.0 * np.arange(n) / n))
    blended = [np.concatenate((clip.poses[0, :3], quaternions.slerped(pose, first, s).ravel())) for s in shares]
    write_rig(Rig(zero="random", seed=5), clip, tmp_path / "plain.bvh")
    write_rig(Rig(zero="random", seed=5), Clip(np.vstack((blended, clip.poses)), clip.fps, name), tmp_path / "led.bvh")
    led, plain = load(tmp_path / "led.bvh", UP), load(tmp_path / "plain.bvh", UP).clip
    n = len(shares)
    assert n - 1 <= led.report.dropped <= n
    kept = led.clip.poses[n - led.report.dropped :]
    assert largest_angle(Clip(kept, clip.fps, name), plain) < 1.0


@pytest.mark.parametrize("name", embedded_names())
def test_a_motion_that_begins_anywhere_keeps_its_frames(name, tmp_path):
    write_rig(Rig(), embedded(name), tmp_path / "r.bvh")
    motion = read_motion(tmp_path / "r.bvh")
    roles = roles_of(motion.joints, motion.parents)
    for every in {1, round(motion.fps / 30), round(motion.fps / 20)}:
        for first in range(0, motion.n_frames - 12 * every, max(1, motion.n_frames // 12)):
            part = reduced(motion, slice(first, None, every))
            assert leading(part, roles) == 0, (every, first)
            assert repaired(part, roles)[1:] == ((), (), False, ()), (every, first)


@pytest.mark.parametrize("name", embedded_names())
def test_a_motion_that_ends_anywhere_keeps_its_last_frame(name, tmp_path):
    write_rig(Rig(), embedded(name), tmp_path / "r.bvh")
    motion = read_motion(tmp_path / "r.bvh")
    roles = roles_of(motion.joints, motion.parents)
    for every in {1, round(motion.fps / 30), round(motion.fps / 20)}:
        for last in range(12 * every, motion.n_frames, max(1, motion.n_frames // 40)):
            assert not repaired(reduced(motion, slice(None, last, every)), roles).shortened, (every, last)


def test_a_motion_that_goes_out_from_its_rest_pose_keeps_it(tmp_path):
    """Evenly, from the zero pose: as a keyframe there, not a calibration pose."""
    clip = at_rate("spin", 30.0)
    rest = np.concatenate((clip.poses[0, :3], np.tile([1.0, 0.0, 0.0, 0.0], len(BODIES))))
    way = [np.concatenate((clip.poses[0, :3], quaternions.slerped(
        rest[3:].reshape(-1, 4), clip.poses[0, 3:].reshape(-1, 4), share).ravel())) for share in (0.0, 0.25, 0.5, 0.75)
    ]  # fmt: skip
    write_rig(Rig(), Clip(np.vstack((way, clip.poses)), clip.fps, "spin"), tmp_path / "r.bvh")
    assert load(tmp_path / "r.bvh").report.dropped == 0


@pytest.mark.slow
def test_only_the_rest_poses_of_captures_are_left_out(mocap):
    dropped = {}
    for path in sorted((*mocap.rglob("*.bvh"), *mocap.glob("cmu_amc/*.amc"), *mocap.glob("deepmimic/*_[a-z]*.txt"))):
        if path.stem.endswith("character"):
            continue
        motion = read_motion(path)
        roles = roles_of(motion.joints, motion.parents)
        if isinstance(roles, str):
            continue
        for every in {1, max(1, round(motion.fps / 30)), max(1, round(motion.fps / 20))}:
            part = reduced(motion, slice(None, None, every))
            if part.n_frames >= 10 and (n := leading(part, roles)):
                dropped[path.name, every] = n
            assert repaired(part, roles).frames == () or "16_09" in path.name
    assert {name for name, _ in dropped} == {"01_01.bvh", "dme_example.bvh"}
    assert set(dropped.values()) == {1}


@pytest.mark.parametrize(("first", "n"), [(20, 1), (20, 3)])
def test_lost_frames_are_interpolated_and_said(walked, first, n):
    table, loaded = walked
    whole = loaded(table)
    lost = table.copy()
    lost[first : first + n] = 0.0
    clip, report, _ = loaded(lost)
    assert largest_angle(clip, whole.clip) < 8.0
    which = "frame 20" if n == 1 else "3 frames, the first of them frame 20,"
    assert any(line.startswith(f"{which} (0.67 s) did not belong") for line in report.remarks)
    assert not any("did not belong" in line for line in whole.report.remarks)


@pytest.mark.parametrize("degrees", [60.0, 120.0])
def test_a_joint_that_flips_for_a_frame_is_interpolated(walked, degrees):
    table, loaded = walked
    popped = table.copy()
    popped[17, 30:33] += degrees
    clip, report, _ = loaded(popped)
    assert largest_angle(clip, loaded(table).clip) < 5.0
    assert any(line.startswith("frame 17 (0.57 s) did not belong") for line in report.remarks)


@pytest.mark.parametrize("columns", [slice(30, 33), slice(0, 3), slice(0, None)], ids=["joint", "root", "all"])
def test_a_last_frame_that_jumps_away_is_left_out(walked, columns):
    table, loaded = walked
    popped = table.copy()
    popped[-1, columns] += 120.0
    clip, report, _ = loaded(popped)
    whole = loaded(table).clip
    assert clip.n_frames == whole.n_frames - 1
    assert largest_angle(clip, Clip(whole.poses[:-1], whole.fps, "walk")) < 1.0
    assert [line for line in report.remarks if "frame" in line] == [
        "the last frame did not belong to the motion before it: left out"
    ]
    assert not any("last frame" in line for line in loaded(table).report.remarks)


@pytest.mark.parametrize("columns", [slice(30, 33), slice(0, 3), slice(0, None)], ids=["joint", "root", "all"])
def test_a_first_frame_that_jumps_away_is_left_out(walked, columns):
    table, loaded = walked
    popped = table.copy()
    popped[0, columns] += 120.0
    clip, report, _ = loaded(popped)
    assert (clip.n_frames, report.dropped) == (len(table) - 1, 1)
    assert largest_angle(clip, loaded(table[1:]).clip) < 1.0


def test_the_turning_point_of_a_motion_there_and_back_is_no_broken_frame(walked):
    """However fast it is: the frames beside it are the same, but the motion comes and goes."""
    table, loaded = walked
    there = table[:9].copy()
    there[:, 30] += np.array([0.0, 0.0, 0.0, 2.0, 4.0, 8.0, 12.0, 26.0, 58.0])
    both = np.vstack((there, there[-2::-1]))
    assert not any("did not belong" in line for line in loaded(both).report.remarks)


def test_a_root_that_is_elsewhere_for_a_frame_is_interpolated(walked):
    table, loaded = walked
    popped = table.copy()
    popped[12, :3] = 0.0
    clip, _, _ = loaded(popped)
    np.testing.assert_allclose(clip.poses[:, :3], loaded(table).clip.poses[:, :3], atol=0.01)


def test_a_long_gap_is_said_and_left(walked):
    table, loaded = walked
    lost = table.copy()
    lost[12:22] = 0.0
    assert any("the whole body jumps in a frame at 0.37 s, 0.70 s:" in line for line in loaded(lost).report.remarks)


def test_a_cut_between_two_takes_is_said(walked):
    table, loaded = walked
    cut = table.copy()
    cut[20:, [0, 2]] += np.abs(table[:, 1]).max()
    assert not any("jumps" in line for line in loaded(table).report.remarks)
    assert any("the whole body jumps in a frame at 0.63 s:" in line for line in loaded(cut).report.remarks)


def test_a_joint_that_turns_for_good_within_a_frame_is_said(walked):
    table, loaded = walked
    exchanged = table.copy()
    exchanged[20:, 30] += 80.0
    said = [line for line in loaded(exchanged).report.remarks if "jump within a frame" in line]
    assert len(said) == 1
    assert re.match(r"joints jump within a frame, the others do not: \w+ by 80° at 0.63 s;", said[0])
    assert not any("jump within" in line for line in loaded(table).report.remarks)


def test_frames_longer_than_a_cameras_are_said(walked, tmp_path):
    text = (tmp_path / "r.bvh").read_text()
    assert not any("a frame lasts" in line for line in load(tmp_path / "r.bvh").report.remarks)
    for seconds, told in (("0.5", "0.5"), ("33.3333", "33")):
        (tmp_path / "r.bvh").write_text(re.sub(r"Frame Time: \S+", f"Frame Time: {seconds}", text))
        told = f"a frame lasts {told} s, longer than a camera's: if that is not so, state its --frame-rate"
        assert told in load(tmp_path / "r.bvh").report.remarks
    with pytest.raises(ModelError, match=r"since a frame lasts 33 s; expected a Frame Time in seconds, such as"):
        prepared(tmp_path / "r.bvh")


def test_legs_that_swing_as_no_human_s_are_said(walked, tmp_path):
    text = (tmp_path / "r.bvh").read_text()
    for seconds, said in (("0.0333333", 0), ("0.0083333", 0), ("0.0033333", 1), ("0.0001", 1)):
        (tmp_path / "r.bvh").write_text(re.sub(r"Frame Time: \S+", f"Frame Time: {seconds}", text))
        remarks = load(tmp_path / "r.bvh").report.remarks
        assert sum("faster than any human's" in line for line in remarks) == said


def test_a_frame_rate_that_the_file_does_not_state_is_said(tmp_path):
    """As of AMC files."""
    write_rig(Rig(), at_rate("walk", 30.0), tmp_path / "r.bvh")
    motion = read_motion(tmp_path / "r.bvh")
    roles = roles_of(motion.joints, motion.parents)
    assert retarget(motion, roles)[1].remarks == ()
    (said,) = retarget(replace(motion, timed=False), roles)[1].remarks
    assert said.startswith("the file states no frame rate: 30 a second are assumed; ")


def test_a_stated_frame_rate_counts_in_place_of_the_files(tmp_path):
    """Of anybody's file and of an own one, which is otherwise taken as it is."""
    for name, write in (
        ("r.bvh", lambda clip, path: write_rig(Rig(), clip, path)),
        ("own.bvh", lambda *to: write_bvh(*to)),
    ):
        write(at_rate("walk", 30.0), tmp_path / name)
        right = load(tmp_path / name).clip
        text = (tmp_path / name).read_text()
        (tmp_path / name).write_text(re.sub(r"Frame Time: \S+", "Frame Time: 33.3333", text))
        stated = load(tmp_path / name, Hints(frame_rate=30.0))
        assert stated.clip.fps == 30.0
        np.testing.assert_array_equal(stated.clip.poses, right.poses)
        assert stated.report is None or stated.report.remarks == ()


@pytest.mark.parametrize("rate", [0.0, -60.0, float("nan"), float("inf"), 1e6])
def test_a_frame_rate_that_is_none_is_refused(rate):
    with pytest.raises(ModelError, match=r"frame rate is .* a second; expected 0\.1 to 10000, such as 60"):
        Hints(frame_rate=rate)
