import re

import numpy as np
import pytest

from experiments.cli import main
from experiments.flights.ballistics import clip_flights
from experiments.preparation import prepared_clip
from experiments.preparation.command import prepare_file
from experiments.preparation.prepared_file import infeasible
from experiments.preparation.tracking_trial import followed
from geometry import quaternions
from models.errors import ModelError
from models.humanoid.skeleton import CONTACT_RADIUS, JOINTS
from models.mocap.library import embedded, load
from models.mocap.motion.clip import Clip, PlanarDisplacement, pose_difference
from models.mocap.motion.foot_skate import stance_skates
from models.mocap.motion.kinematics import sole_points
from models.mocap.motion.ranges import beyond_ranges
from models.mocap.preparation.feasible import contact_forces, feasible
from models.mocap.preparation.fidelity import MAX_JOINT_DISTANCE
from models.mocap.preparation.looping import close_or_rest, mirrored
from models.mocap.preparation.poses import add_tangents, resampled
from models.mocap.preparation.prepare import prepared
from models.mocap.preparation.stances import stances, with_feet_at_rest
from models.mocap.preparation.well_formed import outliers, well_formed
from models.mocap.readers.own_bvh import write_bvh
from tests.models.mocap.retargeting.rigs import Rig, write_rig


@pytest.fixture(scope="module")
def walks():
    """The embedded walk, and an excerpt of two and a half laps of it that starts anywhere."""
    walk = resampled(embedded("walk"), 120.0)
    rows = [walk.poses[:-1]]
    for _ in range(2):
        rows.append(walk.displacement.moved(rows[-1]))
    return walk, Clip(np.concatenate(rows)[37 : 37 + round(2.5 * walk.n_frames)], walk.fps, "walks")


def test_lap_of_a_walk_is_found_and_closed(walks):
    walk, excerpt = walks
    found = close_or_rest(excerpt)
    assert found.kind == "cycle"
    assert found.clip.closes()
    # The embedded walk is two strides.
    assert found.clip.duration == pytest.approx(walk.duration / 2, abs=0.03)


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
    assert found.turns[0] == pytest.approx(found.turns[1], abs=np.deg2rad(10.0))


def test_cycle_of_a_walk_keeps_a_turn_that_lasts_half_of_it(turning):
    """A straight stride would be the best cycle."""
    turned, _ = turning
    found = close_or_rest(turned(lambda x: 0.02 if 0.4 < x < 0.85 else 0.0))
    assert found.kind == "open" or abs(found.clip.displacement.yaw) > np.deg2rad(45.0)


def test_turn_that_a_cycle_lacks_is_measured(turning):
    turned, _ = turning
    found = close_or_rest(turned(lambda x: 0.02 if x > 0.9 else 0.0))
    assert found.kind == "cycle"
    assert found.turns[0] > np.deg2rad(40.0) > np.deg2rad(15.0) > found.turns[1]


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


def test_clip_that_ends_in_the_air_comes_to_rest_on_the_floor():
    jump = resampled(embedded("jump"), 120.0)
    flying = np.flatnonzero(sole_points(jump.poses)[:, :, 2].min(axis=1) > CONTACT_RADIUS + 0.05)
    found = close_or_rest(Clip(jump.poses[: int(np.median(flying))], 120.0, "up"), "open")
    assert sole_points(found.clip.poses[[0, -1]])[:, :, 2].min(axis=1) == pytest.approx(CONTACT_RADIUS, abs=1e-6)


@pytest.mark.slow
def test_prepared_open_upright_motion_rests_on_both_feet(walks, tmp_path):
    """A stride of a walk with one foot in the air at both ends."""
    walk = walks[0]
    feet = sole_points(walk.poses)[:, :, 2].reshape(-1, 2, 4).min(axis=2).max(axis=1)
    n = walk.n_frames // 2
    start = int(np.argmax(feet[: n // 2]))
    assert feet[[start, start + n]].min() > CONTACT_RADIUS + 0.03
    write_bvh(Clip(walk.poses[start : start + n + 1], 120.0, "part"), tmp_path / "part.bvh")
    made = prepared(tmp_path / "part.bvh", "open")
    assert made.near
    np.testing.assert_allclose(sole_points(made.clip.poses)[[0, -1], :, 2], CONTACT_RADIUS, atol=5e-3)
    assert made.feasible.residual < 0.05


def test_motion_that_ends_lying_gets_no_additional_foot_stances():
    dance = resampled(embedded("cheer"), 120.0)
    lying = Clip(dance.poses[:60] - np.eye(dance.poses.shape[1])[2] * 0.6, 120.0, "low")
    np.testing.assert_array_equal(
        with_feet_at_rest(stances(lying, lying), lying).standing, stances(lying, lying).standing
    )


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


def test_feet_in_the_air_bear_no_load():
    flip = resampled(embedded("backflip"), 120.0)
    rough = Clip(flip.poses + 1e-3 * np.random.default_rng(0).normal(size=flip.poses.shape), 120.0, "rough")
    schedule = stances(flip, rough)
    high = sole_points(flip.poses)[:, :, 2] > CONTACT_RADIUS + 0.15
    assert high.any()
    assert not (schedule.pushing & high).any()


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


def test_feet_of_a_walk_stand_alternately(walks):
    schedule = stances(walks[0], walks[0])
    left, right = schedule.standing[:, :4].any(axis=1), schedule.standing[:, 4:].any(axis=1)
    assert 0.5 < left.mean() < 0.75
    assert (left | right).all()
    assert not (left & right).all()


@pytest.fixture(scope="module")
def hop():
    """A closed clip of 4 s in which a standing body hops once at 1 s and drifts by 2 cm and back."""
    still = resampled(embedded("cheer"), 120.0).poses[0]
    poses = np.repeat(still[None], 480, axis=0)
    t = np.arange(480) / 479.0
    poses[:, 0] += 0.02 * np.sin(2.0 * np.pi * t)
    poses[:, 2] += 0.3 * np.maximum(0.0, 1.0 - ((t - 0.25) / 0.05) ** 2)
    return Clip(poses, 120.0, "hop")


def test_stance_across_the_seam_has_one_place(hop):
    schedule = stances(hop, hop)
    assert hop.closes()
    assert schedule.standing[[0, -1]].all()
    assert not schedule.standing.all(axis=1).all()
    np.testing.assert_allclose(schedule.places[0], schedule.places[-1], atol=1e-9)


def test_place_weight_ramps_linearly_beside_a_stance(walks):
    schedule = stances(walks[0], walks[0])
    weight, standing = schedule.kept[:, 0], schedule.standing[:, 0]
    lands = int(np.flatnonzero(np.diff(standing.astype(int)) > 0)[0]) + 1
    rising = weight[lands - 7 : lands + 1]
    np.testing.assert_allclose(rising, np.arange(8) / 7.0, atol=1e-12)
    np.testing.assert_array_equal(schedule.places[lands - 6 : lands, 0], np.tile(schedule.places[lands, 0], (6, 1)))
    assert (weight[standing] == 1.0).all()


def test_place_weight_is_zero_in_flight(hop):
    schedule = stances(hop, hop)
    flies = ~schedule.standing.any(axis=1)
    assert flies.any()
    assert (schedule.kept[flies] == 0.0).all()


def test_mean_load_of_a_walk_is_the_body_weight(walks):
    walk = walks[0]
    loads = contact_forces(walk, stances(walk, walk)).loads.sum(axis=1)
    assert loads.mean() == pytest.approx(1.0, abs=0.05)


def test_low_moving_sole_part_without_load_does_not_count_as_foot_skate(walks):
    """A toe that rolls off is as low as a standing one."""
    walk = walks[0]
    schedule = stances(walk, walk)
    points = sole_points(walk.poses)
    all_skates = stance_skates(points, schedule.standing)
    assert well_formed(walk, ()).slid < all_skates.max()


def test_feet_that_slide_under_load_are_a_fault_though_they_do_not_stand():
    """As where a loop is closed though its feet are at other places: they cross the floor in a tenth of a second."""
    poses = np.repeat(resampled(embedded("cheer"), 120.0).poses[:1], 240, axis=0)
    poses[:, 0] += 0.4 * np.clip((np.arange(240) - 114) / 12.0, 0.0, 1.0)
    leap = well_formed(Clip(poses, 120.0, "leap"), ())
    assert leap.slid > 0.1
    assert leap.skate > 0.1
    assert any(line.startswith("feet skate by") for line in leap.faults())


def test_sole_below_the_floor_is_a_fault_though_it_does_not_stand(walks):
    walk = walks[0]
    flexed = np.zeros((walk.n_frames, 57))
    swing = sole_points(walk.poses)[:, 4:, 2].min(axis=1) > 0.015
    flexed[swing, 6 + 3 * JOINTS.index("right_ankle") + 1] = np.deg2rad(70.0)
    sunk = well_formed(Clip(add_tangents(walk.poses, flexed), walk.fps, "sunk"), ())
    assert sunk.depth > 0.03
    assert any("below the floor; 10 at most" in line for line in sunk.faults())
    assert well_formed(walk, ()).depth < 0.003


def test_embedded_walk_is_well_formed(walks):
    assert well_formed(walks[0], ()).faults() == ()


def test_pose_foreign_to_the_motion_is_an_outlier(walks):
    poses = walks[0].poses.copy()
    poses[20, 3:] = np.tile([1.0, 0, 0, 0], 18)
    assert outliers(walks[0]) == 0
    assert outliers(Clip(poses, 120.0, "popped")) >= 1


@pytest.mark.slow
def test_preparation_makes_a_captured_walk_well_formed(mocap, tmp_path):
    outcome = prepare_file(mocap / "snu/walk.bvh", tmp_path / "walk.bvh", report=tmp_path)
    made, after, follows, *_ = outcome
    before = well_formed(made.captured, clip_flights(made.captured))
    assert after.closed
    assert after.residual < 0.05 < before.residual
    assert after.skate < 0.005 < before.skate
    assert after.slid < 0.01
    assert follows.stands
    assert "the physical figure follows it for 20 s" in str(outcome)
    page = (tmp_path / "prepare-walk.html").read_text(encoding="utf-8")
    assert re.search(r"<th>loop</th><td>ends [1-9]\d*\.\d° apart, .* s</td><td>ends 0\.0° apart</td>", page)
    followed = (
        rf"<td>the physical figure follows it for 20 s with a residual of {100 * follows.residual:.1f} % of weight"
    )
    assert re.search(r"<th>physical figure</th><td>the physical figure (falls|follows).*" + followed, page)
    reloaded = load(tmp_path / "walk.bvh").clip
    np.testing.assert_allclose(pose_difference(reloaded.poses, made.clip.poses), 0.0, atol=1e-7)


@pytest.mark.slow
def test_preparation_makes_a_captured_cartwheel_feasible_on_feet_and_hands(mocap, tmp_path):
    outcome = prepare_file(mocap / "snu/cart.bvh", tmp_path / "cart.bvh")
    assert outcome.made.near
    assert outcome.made.hands.seconds > 0.5
    assert outcome.made.hands.moved < 0.12
    assert outcome.measures.residual < 0.05
    assert outcome.followed.stands
    assert "hands are loaded for" in str(outcome)


@pytest.mark.slow
def test_preparation_of_a_captured_dance_lets_feet_turn_without_skating(mocap, tmp_path):
    outcome = prepare_file(mocap / "deepmimic/humanoid3d_dance_a.txt", tmp_path / "dance.bvh")
    assert outcome.made.near
    assert outcome.made.fidelity.joints < MAX_JOINT_DISTANCE
    assert outcome.measures.skate < 0.005
    assert outcome.followed.stands


@pytest.mark.slow
def test_preparation_removes_root_drift_over_standing_feet(tmp_path):
    # Feet that drift with the root at up to 0.26 m/s count as standing, so the root is moved back over them.
    cheer = embedded("cheer")
    poses = np.concatenate((cheer.poses, cheer.poses[1:]))
    poses[:, 0] += 0.25 * np.sin(np.linspace(0.0, 2 * np.pi, len(poses)))
    write_bvh(Clip(poses, cheer.fps, "wanders"), tmp_path / "wanders.bvh")
    made = prepared(tmp_path / "wanders.bvh")
    assert made.near
    assert made.feasible.moved > 0.15
    assert np.rad2deg(made.fidelity.joints) < 0.5
    assert not well_formed(made.clip, clip_flights(made.clip)).faults()


@pytest.fixture
def long_walk(tmp_path):
    """More than two minutes of walking, open at its ends."""
    walk = resampled(embedded("walk"), 30.0)
    rows = [walk.poses[:-1]]
    while sum(map(len, rows)) < 130 * walk.fps:
        rows.append(walk.displacement.moved(rows[-1]))
    path = tmp_path / "long.bvh"
    write_bvh(Clip(np.concatenate(rows), walk.fps, "long"), path)
    return path


@pytest.mark.slow
def test_part_of_a_long_file_can_be_prepared(long_walk):
    made = prepared(long_walk, "10:12.2")
    assert made.captured.duration > 120.0
    assert made.clip.duration == pytest.approx(2.2, abs=0.01)


def test_whole_file_longer_than_120_s_is_refused(long_walk):
    with pytest.raises(
        ModelError, match=r"long.bvh: lasts 13\d.* at most 120 s, or a part of it by `hvf prepare --loop START:END`"
    ):
        prepared(long_walk, "open")


@pytest.mark.slow
def test_prepare_command_prints_missing_joints_and_dropped_frames(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("experiments.preparation.command.followed", lambda clip, seconds: followed(clip, 1.0))
    walk = embedded("walk")
    write_rig(Rig(without=("clavicle",), leading=1), Clip(walk.poses[::4], walk.fps / 4, "walk"), tmp_path / "r.bvh")
    assert main(["prepare", str(tmp_path / "r.bvh"), str(tmp_path / "out.bvh")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "missing: left_clavicle (follows chest), right_clavicle (follows chest)"
    assert lines[1] == "left out: the first frame, a pose that is not part of the motion"
    assert lines[2].startswith("r: ")
    assert all(line.startswith("  ") for line in lines[3:])


def test_cache_key_covers_the_module_that_prepares_clips():
    assert prepared.__module__ == prepared_clip._PREPARING_MODULE


def test_existing_target_is_not_overwritten(tmp_path):
    write_bvh(embedded("walk"), tmp_path / "walk.bvh")
    with pytest.raises(ModelError, match="--overwrite"):
        prepare_file(tmp_path / "walk.bvh", tmp_path / "walk.bvh")


@pytest.mark.parametrize(("degrees", "near"), [(10.0, True), (60.0, False)])
def test_motion_with_a_joint_far_beyond_its_range_is_not_near_the_capture(degrees, near, monkeypatch, tmp_path):
    """As when a run cut at full speed comes to rest. Without a last step it is solved again, then left as captured."""
    attempts = []

    def bent(clip, schedule, **options):
        attempts.append(clip)
        poses = clip.poses.copy()
        knee = 7 + 4 * JOINTS.index("right_knee")
        poses[10, knee : knee + 4] = np.cos(np.deg2rad(degrees) / 2), 0.0, -np.sin(np.deg2rad(degrees) / 2), 0.0
        return feasible(clip, schedule, **options)._replace(clip=Clip(poses, clip.fps, clip.name), residual=0.0)

    monkeypatch.setattr("models.mocap.preparation.prepare.feasible", bent)
    walk = embedded("walk")
    write_bvh(
        embedded("cheer") if near else Clip(walk.poses[: walk.n_frames // 2 + 7], walk.fps, "r"), tmp_path / "r.bvh"
    )
    made = prepared(tmp_path / "r.bvh", "0:1" if near else "open")
    assert made.near is near
    assert len(attempts) == (1 if near else 3)
    assert np.rad2deg(beyond_ranges(made.clip.poses).max()) < 30.0
    message = " ".join(infeasible(made))
    assert message == "" if near else re.search(r"takes a joint \d\d° beyond its range", message)
