"""Closing of a motion: its cycle, its half stride, or rest at both ends."""

import numpy as np
import pytest

from geometry import quaternions
from models.errors import ModelError
from models.humanoid.skeleton import CONTACT_RADIUS, JOINTS, rest_pose
from models.mocap.dynamics.contacts import contacts
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip, PlanarDisplacement, pose_difference
from models.mocap.motion.kinematics import sole_points
from models.mocap.motion.mirror import mirrored
from models.mocap.motion.ranges import beyond_ranges
from models.mocap.preparation.looping import close_or_rest
from models.mocap.preparation.poses import add_tangents, resampled


def test_lap_of_a_walk_is_found_and_closed(walks):
    walk, excerpt = walks
    found = close_or_rest(excerpt)
    assert found.kind == "cycle"
    assert found.clip.closes()
    # The embedded walk is two strides.
    assert found.clip.duration == pytest.approx(walk.duration / 2, abs=0.03)


@pytest.mark.parametrize("start", [0.0, 0.1, 0.2])
def test_walk_of_less_than_a_stride_is_continued_by_its_mirror_image(start):
    """Two moments of it, each with a foot in the air, are similar enough for a gait's ends; a cycle would limp."""
    walk = resampled(embedded("walk"), 120.0)
    stride = walk.duration / 2.0
    first, last = (round((start + part) * stride * walk.fps) for part in (0.0, 0.75))
    found = close_or_rest(Clip(walk.poses[first : last + 1], walk.fps, "less than a stride"))
    assert found.kind == "half stride"
    assert found.clip.closes()
    assert found.clip.duration == pytest.approx(stride, abs=0.1 * stride)


def test_run_on_the_spot_whose_ends_differ_by_a_rounded_ankle_is_closed_as_a_whole():
    """A stride at 24 frames a second: d of its ends is large, as their velocities are one-sided."""
    lap = resampled(embedded("run"), 24.0).poses[:18]
    lap[:, :2] = 0.0
    lap[-1] = lap[0]
    ankle = np.zeros((1, 57))
    ankle[0, 6 + 3 * JOINTS.index("right_ankle")] = 0.006
    lap[-1:] = add_tangents(lap[-1:], ankle)
    found = close_or_rest(resampled(Clip(lap, 24.0, "run on the spot"), 120.0))
    assert found.kind == "cycle"
    assert found.clip.closes()
    assert found.clip.duration == pytest.approx(17 / 24, abs=0.01)


@pytest.fixture(scope="module")
def turning():
    """Function of a yaw rate a frame: five and a half laps of the embedded walk, whose heading it turns on the spot."""
    walk = resampled(embedded("walk"), 60.0)
    n = walk.n_frames - 1

    def turned(rates):
        frames = np.arange(int(5.5 * n))
        laps = [PlanarDisplacement(*(k // n) * walk.poses[n, :2], 0.0).moved(walk.poses[k % n]) for k in frames]
        yaw, place, poses = 0.0, laps[0][:2], []
        for k, pose in enumerate(laps):
            step = pose[:2] - laps[max(k - 1, 0)][:2]
            yaw += rates(k / len(frames))
            c, s = np.cos(yaw), np.sin(yaw)
            place = place + np.array([[c, -s], [s, c]]) @ step
            row = pose.copy()
            row[:2] = 0.0
            row = PlanarDisplacement(0.0, 0.0, yaw).moved(row)
            row[:2] = place
            poses.append(row)
        return Clip(np.array(poses), walk.fps, "turning")

    return turned, walk.duration / 2


def test_walk_along_a_curve_is_a_cycle_that_turns(turning):
    turned, stride = turning
    found = close_or_rest(turned(lambda x: 0.004))
    assert found.kind == "cycle"
    assert found.clip.duration < 2.5 * stride
    assert found.lost_turn.angle < np.deg2rad(10.0)


def test_cycle_of_a_walk_keeps_a_turn_that_lasts_half_of_it(turning):
    """A straight stride would be the best cycle."""
    turned, _ = turning
    found = close_or_rest(turned(lambda x: 0.02 if 0.4 < x < 0.85 else 0.0))
    assert found.kind == "open" or abs(found.clip.displacement.yaw) > np.deg2rad(45.0)


def test_turn_that_a_cycle_lacks_is_measured(turning):
    turned, _ = turning
    clip = turned(lambda x: 0.02 if x > 0.9 else 0.0)
    found = close_or_rest(clip)
    assert found.kind == "cycle"
    assert found.lost_turn.angle > np.deg2rad(40.0)
    assert found.lost_turn.at == pytest.approx(clip.duration, abs=0.3)


def test_turn_and_return_in_the_middle_that_a_cycle_lacks_is_measured(turning):
    turned, _ = turning
    found = close_or_rest(turned(lambda x: 0.03 * ((0.45 < x < 0.5) - (0.5 < x < 0.55))))
    assert found.kind == "cycle"
    assert np.deg2rad(40.0) < found.lost_turn.angle < np.deg2rad(70.0)


def test_swing_of_the_pelvis_in_a_straight_walk_is_no_turn(turning):
    """Cut where the pelvis is turned left at first and right at last."""
    turned, stride = turning
    walk = turned(lambda x: 0.03 * np.cos(22.0 * np.pi * x))
    quarter = round(stride * walk.fps / 4.0)
    cut = Clip(walk.poses[quarter:-quarter], walk.fps, "cut")
    ends = np.unwrap(quaternions.heading(cut.poses[:, 3:7]))[[0, -1]]
    assert abs(ends[1] - ends[0]) > np.deg2rad(30.0)
    found = close_or_rest(cut)
    assert found.kind == "cycle"
    assert found.lost_turn.angle < np.deg2rad(10.0)


def test_cycle_of_jumps_in_place_is_closed_on_the_floor():
    """They differ in an arm while the body stands, so that poses in flight are more alike."""
    jump = resampled(embedded("jump"), 60.0)
    n = jump.n_frames - 1
    flight = ~contacts(jump).supported[:-1]
    stands = 1.0 - np.convolve(np.tile(flight, 3), np.hanning(13) / np.hanning(13).sum(), "same")[n : 2 * n]
    shoulder = slice(7 + 4 * (JOINTS.index("left_shoulder")), 11 + 4 * (JOINTS.index("left_shoulder")))
    laps = []
    for k in range(3):
        lap = jump.poses[:-1].copy()
        raised = quaternions.exponential(0.15 * k * stands[:, None] * np.array([1.0, 0.0, 0.0]))
        lap[:, shoulder] = quaternions.product(lap[:, shoulder], raised)
        laps.append(lap)
    clip = Clip(np.concatenate(laps), jump.fps, "jumps")
    found = close_or_rest(clip)
    assert found.kind == "cycle"
    supported = contacts(clip).supported
    assert supported[round(found.start * clip.fps)]
    assert supported[round(found.end * clip.fps)]


@pytest.mark.parametrize(("seconds", "kept"), [(0.2, False), (1.2, True)])
def test_cycle_lacks_a_short_event_at_most_and_measures_it(turning, seconds, kept):
    """Both arms are raised once in a walk of twelve seconds."""
    walk = turning[0](lambda x: 0.0)
    raised, elbow = np.zeros((walk.n_frames, 57)), 6 + 3 * JOINTS.index("left_elbow") + 1
    envelope = np.clip((seconds / 2.0 + 0.1 - np.abs(np.arange(walk.n_frames) / walk.fps - 5.0)) / 0.1, 0.0, 1.0)
    for joint in ("left_shoulder", "right_shoulder", "left_elbow", "right_elbow"):
        raised[:, 6 + 3 * JOINTS.index(joint) + 1] = -2.0 * envelope
    found = close_or_rest(Clip(add_tangents(walk.poses, raised), walk.fps, "event"))
    turned = pose_difference(np.repeat(walk.poses[:1], found.clip.n_frames, axis=0), found.clip.poses)[:, elbow]
    assert (np.ptp(turned) > 1.5) == kept
    left_out = (0.0, 0.0) if kept else (seconds + 0.2, 5.0 - seconds / 2.0 - 0.1)
    assert found.left_out == pytest.approx(left_out, abs=0.15)


@pytest.mark.parametrize(("angle", "kept"), [(1.4, True), (0.9, False)])
def test_gesture_of_one_arm_is_kept_or_told(angle, kept, turning):
    """An arm is raised by 80° or 50° for a tenth of a walk, in which it swings by 15° or so."""
    walk = turning[0](lambda x: 0.0)
    raised, shoulder = np.zeros((walk.n_frames, 57)), 6 + 3 * JOINTS.index("left_shoulder")
    times = np.arange(walk.n_frames) / walk.fps
    raised[:, shoulder] = angle * np.clip((0.7 - np.abs(times - 5.0)) / 0.1, 0.0, 1.0)
    found = close_or_rest(Clip(add_tangents(walk.poses, raised), walk.fps, "gesture"))
    turned = pose_difference(np.repeat(walk.poses[:1], found.clip.n_frames, axis=0), found.clip.poses)[:, shoulder]
    assert (np.ptp(turned) > 0.8 * angle) == kept
    assert found.left_out == pytest.approx((0.0, 0.0) if kept else (1.3, 4.35), abs=0.15)


def test_part_whose_standing_feet_end_at_another_place_is_no_cycle():
    """Arms swing, and a foot is put 17 cm aside meanwhile: across the seam it would slide back."""
    standing, time = resampled(embedded("cheer"), 120.0).poses[0], np.arange(300) / 120.0
    swing, aside = np.zeros((300, 57)), np.zeros((300, 57))
    for joint, sign in (("left_shoulder", 1.0), ("right_shoulder", -1.0)):
        swing[:, 6 + 3 * JOINTS.index(joint)] = 0.8 * sign * np.sin(np.pi * time)
    for joint, sign in (("left_hip", 1.0), ("left_ankle", -1.0)):
        aside[:, 6 + 3 * JOINTS.index(joint)] = 0.2 * sign * np.clip((time - 0.8) / 0.25, 0.0, 1.0)
    kinds = [close_or_rest(Clip(add_tangents(np.tile(standing, (300, 1)), t), 120.0, "arms")).kind
             for t in (swing, swing + aside)]  # fmt: skip
    assert kinds[0] == "cycle"
    assert kinds[1] != "cycle"


def test_looped_returns_a_closed_clip_unchanged(walks):
    assert close_or_rest(walks[0]).clip is walks[0]


def test_looped_closes_a_lap_written_with_few_digits(walks):
    """As in files of motion libraries. Taken for open, a walk in a circle had a residual of 8 % instead of 2."""
    walk, _ = walks
    poses = walk.poses.copy()
    poses[-1, 7:] += 3e-5 * np.random.default_rng(3).standard_normal(68)
    poses[-1, 3:] /= np.repeat(np.linalg.norm(poses[-1, 3:].reshape(18, 4), axis=1), 4)
    written = Clip(poses, walk.fps, "few digits")
    assert not written.closes()
    found = close_or_rest(written)
    assert (found.kind, found.clip.closes()) == ("cycle", True)
    assert np.abs(pose_difference(found.clip.poses, written.poses)).max() < 2e-4


def test_lap_without_frames_around_it_shares_the_jump_between_its_ends(walks):
    """As in files of one lap: spread over the lap, a jump of 28° at a shoulder turned it by 17° RMS."""
    walk, _ = walks
    drift = np.zeros((walk.n_frames, 57))
    drift[:, 6 + 3 * JOINTS.index("right_shoulder")] = np.linspace(0.0, 0.5, walk.n_frames)
    drifting = Clip(add_tangents(walk.poses, drift), walk.fps, "drift")
    found = close_or_rest(drifting, f"0:{drifting.duration}").clip
    changed = np.linalg.norm(pose_difference(drifting.poses, found.poses), axis=1)
    assert found.closes()
    assert np.abs(changed[[0, -1]] - 0.25).max() < 1e-6
    assert changed.max() < 0.26
    assert changed[round(0.3 * walk.fps) : -round(0.3 * walk.fps)].max() < 1e-6


def test_looped_removes_the_drift_of_a_lap_on_standing_feet():
    """A cheer away from the origin whose capture turns by 4° and drifts by 2 cm per lap."""
    cheer = resampled(embedded("cheer"), 120.0)
    n = cheer.n_frames - 1
    frames, share = np.arange(int(2.4 * n)), np.arange(int(2.4 * n)) / n
    poses = np.array([PlanarDisplacement(3.0, -2.0, 0.0).moved(cheer.poses[k % n]) for k in frames])
    drift = [PlanarDisplacement(0.02 * s, 0.0, np.deg2rad(4.0) * s) for s in share]
    for k, displacement in enumerate(drift):
        poses[k, :2] -= 3.0, -2.0
        poses[k] = displacement.moved(poses[k])
        poses[k, :2] += 3.0, -2.0
    found = close_or_rest(Clip(poses, 120.0, "drifting"))
    assert found.kind == "cycle"
    np.testing.assert_allclose(found.clip.poses[-1], found.clip.poses[0], atol=1e-12)
    feet = sole_points(found.clip.poses)[:, :, :2]
    authored_feet = sole_points(cheer.poses)[:, :, :2]
    assert np.ptp(feet, axis=0).max() < np.ptp(authored_feet, axis=0).max() + 2e-3
    np.testing.assert_allclose(np.linalg.norm(found.clip.poses[:, 3:7], axis=1), 1.0, atol=1e-9)


def test_looped_brings_a_clip_without_repetition_to_rest_at_both_ends(walks):
    part = Clip(walks[1].poses[: walks[0].n_frames // 6], 120.0, "part")
    found = close_or_rest(part)
    assert found.kind == "open"
    speeds = np.abs(found.clip.velocities())
    assert max(speeds[0].max(), speeds[-1].max()) < 0.2


def test_walk_that_is_cut_anywhere_begins_and_ends_standing(walks):
    """Side by side on both feet, the trunk upright; the foot that bears the body stays where it is."""
    n = walks[0].n_frames
    for start in range(0, n // 2, n // 12):
        part = Clip(walks[1].poses[start : start + n // 2 + 7], 120.0, "part")
        found = close_or_rest(part, "open").clip
        for frame, inner in ((0, 60), (-1, -60)):
            feet = sole_points(found.poses[[frame]])[0].reshape(2, 4, 3)
            ahead = quaternions.rotated(found.poses[frame, 3:7], np.eye(3)[0])
            assert np.abs((feet.mean(axis=1)[0] - feet.mean(axis=1)[1]) @ ahead) < 0.12
            assert feet[..., 2].max() < CONTACT_RADIUS + 0.03
            tilt = quaternions.rotated(found.poses[frame, 3:7], np.eye(3)[2])[2]
            assert np.rad2deg(np.arccos(tilt)) < 1.0
            moved = np.linalg.norm(np.diff(sole_points(found.poses[[frame, inner]])[..., :2], axis=0)[0], axis=1)
            assert moved.min() < 0.05
        steps = np.abs(found.velocities())
        assert max(steps[0].max(), steps[-1].max()) < 0.2


def test_long_way_back_of_a_gesture_whose_hips_sink_at_first_stays_on_the_floor():
    """An arm is raised by 150° in 2 s; at first the hips sink at 0.6 m/s, as where a tracker settles. With that
    velocity over all of the way, feet would be 0.9 m high."""
    n = 240
    path = np.zeros((n, 57))
    path[:, 6 + 3 * JOINTS.index("left_shoulder")] = 2.6 * np.linspace(0.0, 1.0, n) ** 2
    sunk = 0.03 * np.exp(-np.arange(n) / 6.0)
    path[:, 2] = sunk
    for joint, angle in (("hip", 1.0), ("knee", -2.0), ("ankle", 1.0)):
        for side in ("left", "right"):
            path[:, 7 + 3 * JOINTS.index(f"{side}_{joint}")] = 4.0 * angle * sunk
    found = close_or_rest(Clip(add_tangents(np.repeat(rest_pose()[None], n, axis=0), path), 120.0, "settling"))
    assert found.kind == "way back"
    assert found.clip.duration > 4.0
    way = sole_points(found.clip.poses[n:])[..., 2] - CONTACT_RADIUS
    assert way.min(axis=1).max() < 0.12


def test_noise_in_the_first_frame_hardly_changes_the_transition_from_rest(walks):
    """An elbow 8° off in the first frame moves at 17 rad/s by the difference of two frames: from that velocity it would
    turn by a further 176° before it rests, from that of the low-passed motion by 66°."""
    opened = Clip(walks[1].poses[: walks[0].n_frames // 4], walks[1].fps, "opened")
    offset = np.zeros((1, 57))
    offset[0, 6 + 3 * JOINTS.index("left_elbow") + 1] = np.deg2rad(8.0)
    poses = opened.poses.copy()
    poses[0] = add_tangents(poses[:1], offset)[0]
    noisy, plain = (close_or_rest(clip, "open").clip for clip in (Clip(poses, opened.fps, "noisy"), opened))
    elbow = slice(6 + 3 * JOINTS.index("left_elbow"), 9 + 3 * JOINTS.index("left_elbow"))
    thrown = pose_difference(plain.poses[:1], noisy.poses[:1])[0, elbow]
    assert np.linalg.norm(thrown) < np.deg2rad(75.0)


def test_transition_to_rest_keeps_the_knee_in_range_if_requested(walks):
    """The shank of the first half of a stride, thrown forward at 15 rad/s in its last frames."""
    opened = Clip(walks[1].poses[: walks[0].n_frames // 2], walks[1].fps, "opened")
    n, knee = opened.n_frames, 6 + 3 * JOINTS.index("left_knee")
    poses = opened.poses.copy()
    for k in range(12):
        thrown = np.zeros((1, 57))
        thrown[0, knee + 1] = -15.0 * (12 - k) / opened.fps
        poses[n - 1 - k] = add_tangents(poses[n - 1 - k : n - k], -thrown)[0]
    excess = [
        beyond_ranges(close_or_rest(Clip(poses, opened.fps, "thrown"), "open", ending=ending).clip.poses[n:]).max()
        for ending in ("decay", "limited decay")
    ]
    captured_excess = max(beyond_ranges(poses).max(), 0.0)
    assert excess[0] > captured_excess + np.deg2rad(20.0)
    assert excess[1] < captured_excess + np.deg2rad(1.01)


@pytest.mark.parametrize(("raised", "speed", "added"), [(0.0, 0.0, 0.0), (0.02, 0.0, 0.35), (0.0, 4.0, 0.35)])
def test_end_that_stands_at_rest_gets_no_frames(raised, speed, added):
    """A person who lifts an arm and stands still again; hovering by 2 cm, or with an arm that swings at the ends."""
    times = np.linspace(0.0, 1.5, 181)
    tangents = np.zeros((181, 57))
    tangents[:, 6 + 3 * JOINTS.index("left_shoulder")] = np.sin(np.pi * times / 1.5) ** 4 + speed * times
    poses = add_tangents(np.repeat(rest_pose()[None], 181, axis=0), tangents)
    poses[:, 2] += raised + CONTACT_RADIUS - sole_points(rest_pose()[None])[0, :, 2].min()
    found = close_or_rest(Clip(poses, 120.0, "lift"), "open")
    assert -found.start == pytest.approx(added, abs=1e-9)
    assert found.clip.n_frames == 181 + 2 * round(120 * added)


def test_clip_that_ends_in_the_air_comes_to_rest_on_the_floor():
    jump = resampled(embedded("jump"), 120.0)
    flying = np.flatnonzero(sole_points(jump.poses)[:, :, 2].min(axis=1) > CONTACT_RADIUS + 0.05)
    found = close_or_rest(Clip(jump.poses[: int(np.median(flying))], 120.0, "up"), "open")
    assert sole_points(found.clip.poses[[0, -1]])[:, :, 2].min(axis=1) == pytest.approx(CONTACT_RADIUS, abs=1e-6)


def test_half_stride_is_continued_by_its_mirror_image(walks):
    walk, excerpt = walks
    found = close_or_rest(Clip(excerpt.poses[: round(0.4 * walk.n_frames)], 120.0, "steps"), mirror=True)
    assert found.kind == "half stride"
    assert found.clip.closes()
    assert found.clip.duration == pytest.approx(walk.duration / 2, abs=0.03)
    half = round(found.clip.n_frames / 2)
    image = mirrored(found.clip)
    speeds, image_speeds = (np.abs(c.velocities()[:, 6:]).mean(axis=1) for c in (found.clip, image))
    np.testing.assert_allclose(speeds[: half - 2], np.roll(image_speeds, -half + 1)[: half - 2], rtol=0.1, atol=0.05)


@pytest.mark.parametrize("frames", [2, 12])
def test_mirror_option_without_a_half_stride_is_refused(frames):
    standing = Clip(np.repeat(embedded("cheer").poses[:1], frames, axis=0), 120.0, "still")
    with pytest.raises(ModelError, match=r"--mirror.*expected a gait"):
        close_or_rest(standing, mirror=True)


def test_lap_of_a_minute_of_walking_is_a_whole_number_of_strides(walks):
    walk = walks[0]
    rows = [walk.poses[:-1]]
    for _ in range(27):
        rows.append(walk.displacement.moved(rows[-1]))
    minute = Clip(np.concatenate(rows), 120.0, "minute")
    found = close_or_rest(minute)
    assert minute.duration > 59.0
    assert found.kind == "cycle"
    laps = found.clip.duration / (walk.duration / 2)
    assert laps == pytest.approx(round(laps), abs=0.05)


def test_shortest_stated_cycle_is_accepted(walks):
    assert close_or_rest(walks[1], "1.0:1.2").kind == "cycle"


@pytest.mark.parametrize("option", ["1:9", "two", "2:1", "0:5.6", "1:1.19", "5.4:5.6"])
def test_invalid_loop_option_is_refused(walks, option):
    with pytest.raises(ModelError, match=r"--loop .*expected"):
        close_or_rest(walks[1], option)


def test_mirroring_swaps_the_soles_and_mirroring_twice_gives_the_motion(walks):
    np.testing.assert_allclose(pose_difference(mirrored(mirrored(walks[0])).poses, walks[0].poses), 0.0, atol=1e-12)
    original, mirror_image = sole_points(walks[0].poses), sole_points(mirrored(walks[0]).poses)
    np.testing.assert_allclose(original[:, :4] * (1, -1, 1), mirror_image[:, 4:], atol=1e-9)
