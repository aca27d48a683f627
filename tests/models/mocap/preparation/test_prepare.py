import re

import numpy as np
import pytest

from experiments.cli import main
from experiments.flights.ballistics import clip_flights
from experiments.preparation import prepared_clip
from experiments.preparation.command import prepare_file
from experiments.preparation.prepared_file import advice, summary
from models.errors import ModelError
from models.humanoid.skeleton import CONTACT_RADIUS, JOINTS
from models.mocap.library import embedded, load
from models.mocap.motion.clip import Clip, PlanarDisplacement, pose_difference
from models.mocap.motion.ranges import beyond_ranges
from models.mocap.preparation.feasible import borne, feasible
from models.mocap.preparation.fidelity import OTHERWISE
from models.mocap.preparation.looping import looped, mirrored
from models.mocap.preparation.poses import plus, resampled, sole_points
from models.mocap.preparation.prepare import prepared
from models.mocap.preparation.skate import stance_slides
from models.mocap.preparation.stances import rested, stances
from models.mocap.preparation.well_formed import outliers, well_formed
from models.mocap.readers.own_bvh import write_bvh
from tests.models.mocap.retargeting.rigs import Rig, write_rig


@pytest.fixture(scope="module")
def walks():
    """Two and a half laps of the embedded walk, cut where it happens."""
    walk = resampled(embedded("walk"), 120.0)
    rows = [walk.poses[:-1]]
    for _ in range(2):
        rows.append(walk.displacement.moved(rows[-1]))
    return walk, Clip(np.concatenate(rows)[37 : 37 + round(2.5 * walk.n_frames)], walk.fps, "walks")


def test_the_lap_of_a_walk_is_found_and_closed(walks):
    walk, several = walks
    found = looped(several)
    assert found.kind == "cycle"
    assert found.clip.closes()
    # The embedded walk is two strides.
    assert found.clip.duration == pytest.approx(walk.duration / 2, abs=0.03)


def test_a_closed_clip_is_left_as_it_is(walks):
    assert looped(walks[0]).clip is walks[0]


def test_a_lap_that_was_written_with_few_digits_is_closed(walks):
    """As files of libraries of motions are: taken for open, a walk in a circle lacked 8 % for 2."""
    walk, _ = walks
    poses = walk.poses.copy()
    poses[-1, 7:] += 3e-5 * np.random.default_rng(3).standard_normal(68)
    poses[-1, 3:] /= np.repeat(np.linalg.norm(poses[-1, 3:].reshape(18, 4), axis=1), 4)
    written = Clip(poses, walk.fps, "few digits")
    assert not written.closes()
    found = looped(written)
    assert (found.kind, found.clip.closes()) == ("cycle", True)
    assert np.abs(pose_difference(found.clip.poses, written.poses)).max() < 2e-4


def test_a_lap_on_a_foot_that_stands_ends_where_it_began():
    """A cheer whose capture turns by 4° and goes 2 cm aside in a lap, away from the origin."""
    cheer = resampled(embedded("cheer"), 120.0)
    n = cheer.n_frames - 1
    frames, share = np.arange(int(2.4 * n)), np.arange(int(2.4 * n)) / n
    poses = np.array([PlanarDisplacement(3.0, -2.0, 0.0).moved(cheer.poses[k % n]) for k in frames])
    drift = [PlanarDisplacement(0.02 * s, 0.0, np.deg2rad(4.0) * s) for s in share]
    for k, there in enumerate(drift):
        poses[k, :2] -= 3.0, -2.0
        poses[k] = there.moved(poses[k])
        poses[k, :2] += 3.0, -2.0
    found = looped(Clip(poses, 120.0, "drifting"))
    assert found.kind == "cycle"
    np.testing.assert_allclose(found.clip.poses[-1], found.clip.poses[0], atol=1e-12)
    feet = sole_points(found.clip.poses)[:, :, :2]
    without = sole_points(cheer.poses)[:, :, :2]
    assert np.ptp(feet, axis=0).max() < np.ptp(without, axis=0).max() + 2e-3
    np.testing.assert_allclose(np.linalg.norm(found.clip.poses[:, 3:7], axis=1), 1.0, atol=1e-9)


def test_what_does_not_repeat_rests_at_both_ends(walks):
    part = Clip(walks[1].poses[: walks[0].n_frames // 6], 120.0, "part")
    found = looped(part)
    assert found.kind == "open"
    speeds = np.abs(found.clip.velocities())
    assert max(speeds[0].max(), speeds[-1].max()) < 0.2


def test_noise_in_the_first_frame_does_not_throw_a_limb(walks):
    """An elbow that is 8° off in the first frame moves at 17 rad/s there, by the difference of two frames: it turned
    on by 176° before it came to rest, by the low-passed motion by 66°."""
    opened = Clip(walks[1].poses[: walks[0].n_frames // 4], walks[1].fps, "opened")
    off = np.zeros((1, 57))
    off[0, 6 + 3 * JOINTS.index("left_elbow") + 1] = np.deg2rad(8.0)
    poses = opened.poses.copy()
    poses[0] = plus(poses[:1], off)[0]
    noisy, plain = (looped(clip, "open").clip for clip in (Clip(poses, opened.fps, "noisy"), opened))
    elbow = slice(6 + 3 * JOINTS.index("left_elbow"), 9 + 3 * JOINTS.index("left_elbow"))
    thrown = pose_difference(plain.poses[:1], noisy.poses[:1])[0, elbow]
    assert np.linalg.norm(thrown) < np.deg2rad(75.0)


def test_a_knee_that_would_pass_its_range_stops_within_it_if_that_is_asked_for(walks):
    """The shank of the first half of a stride, thrown forward at 15 rad/s in its last frames."""
    opened = Clip(walks[1].poses[: walks[0].n_frames // 2], walks[1].fps, "opened")
    n, knee = opened.n_frames, 6 + 3 * JOINTS.index("left_knee")
    poses = opened.poses.copy()
    for k in range(12):
        thrown = np.zeros((1, 57))
        thrown[0, knee + 1] = -15.0 * (12 - k) / opened.fps
        poses[n - 1 - k] = plus(poses[n - 1 - k : n - k], -thrown)[0]
    worst = [
        beyond_ranges(looped(Clip(poses, opened.fps, "thrown"), "open", within=within).clip.poses[n:]).max()
        for within in (False, True)
    ]
    captured = max(beyond_ranges(poses).max(), 0.0)
    assert worst[0] > captured + np.deg2rad(20.0)
    assert worst[1] < captured + np.deg2rad(1.01)


def test_what_ends_in_the_air_comes_down_to_rest():
    jump = resampled(embedded("jump"), 120.0)
    flying = np.flatnonzero(sole_points(jump.poses)[:, :, 2].min(axis=1) > CONTACT_RADIUS + 0.05)
    found = looped(Clip(jump.poses[: int(np.median(flying))], 120.0, "up"), "open")
    assert sole_points(found.clip.poses[[0, -1]])[:, :, 2].min(axis=1) == pytest.approx(CONTACT_RADIUS, abs=1e-6)


@pytest.mark.slow
def test_an_upright_motion_that_ends_rests_on_both_feet(walks, tmp_path):
    """A stride cut out of a walk, one foot in the air at both ends."""
    walk = walks[0]
    write_bvh(Clip(walk.poses[: walk.n_frames // 2], 120.0, "part"), tmp_path / "part.bvh")
    made = prepared(tmp_path / "part.bvh", "open")
    ends = sole_points(made.looped.clip.poses)[[0, -1], :, 2]
    assert ends.reshape(2, 2, 4).min(axis=2).max(axis=1).min() > CONTACT_RADIUS + 0.03
    assert made.near
    np.testing.assert_allclose(sole_points(made.clip.poses)[[0, -1], :, 2], CONTACT_RADIUS, atol=5e-3)
    assert made.feasible.residual < 0.05


def test_who_lies_at_the_end_is_not_stood_on_his_feet():
    dance = resampled(embedded("cheer"), 120.0)
    low = Clip(dance.poses[:60] - np.eye(dance.poses.shape[1])[2] * 0.6, 120.0, "low")
    np.testing.assert_array_equal(rested(stances(low, low), low).standing, stances(low, low).standing)


def test_half_a_stride_goes_on_in_the_mirror(walks):
    walk, several = walks
    found = looped(Clip(several.poses[: round(0.4 * walk.n_frames)], 120.0, "steps"), mirror=True)
    assert found.kind == "half stride"
    assert found.clip.closes()
    assert found.clip.duration == pytest.approx(walk.duration / 2, abs=0.03)
    half = round(found.clip.n_frames / 2)
    image = mirrored(found.clip)
    ours, theirs = (np.abs(c.velocities()[:, 6:]).mean(axis=1) for c in (found.clip, image))
    np.testing.assert_allclose(ours[: half - 2], np.roll(theirs, -half + 1)[: half - 2], rtol=0.1, atol=0.05)


def test_no_half_stride_in_the_mirror_is_told(walks):
    standing = Clip(np.repeat(embedded("cheer").poses[:1], 12, axis=0), 120.0, "still")
    with pytest.raises(ModelError, match=r"--mirror.*expected a gait"):
        looped(standing, mirror=True)


def test_of_a_minute_of_walking_a_lap_is_taken(walks):
    walk = walks[0]
    rows = [walk.poses[:-1]]
    for _ in range(27):
        rows.append(walk.displacement.moved(rows[-1]))
    minute = Clip(np.concatenate(rows), 120.0, "minute")
    found = looped(minute)
    assert minute.duration > 59.0
    assert found.kind == "cycle"
    laps = found.clip.duration / (walk.duration / 2)
    assert laps == pytest.approx(round(laps), abs=0.05)


def test_feet_in_the_air_bear_nothing():
    flip = resampled(embedded("backflip"), 120.0)
    rough = Clip(flip.poses + 1e-3 * np.random.default_rng(0).normal(size=flip.poses.shape), 120.0, "rough")
    schedule = stances(flip, rough)
    high = sole_points(flip.poses)[:, :, 2] > CONTACT_RADIUS + 0.15
    assert high.any()
    assert not (schedule.pushing & high).any()


@pytest.mark.parametrize("wish", ["1:9", "two", "2:1"])
def test_a_wrong_loop_is_told_in_one_line(walks, wish):
    with pytest.raises(ModelError, match=r"--loop .*expected"):
        looped(walks[1], wish)


def test_a_mirrored_mirror_is_the_motion(walks):
    np.testing.assert_allclose(pose_difference(mirrored(mirrored(walks[0])).poses, walks[0].poses), 0.0, atol=1e-12)
    ours, theirs = sole_points(walks[0].poses), sole_points(mirrored(walks[0]).poses)
    np.testing.assert_allclose(ours[:, :4] * (1, -1, 1), theirs[:, 4:], atol=1e-9)


def test_the_walks_feet_stand_by_turns(walks):
    schedule = stances(walks[0], walks[0])
    left, right = schedule.standing[:, :4].any(axis=1), schedule.standing[:, 4:].any(axis=1)
    assert 0.5 < left.mean() < 0.75
    assert (left | right).all()
    assert not (left & right).all()


@pytest.fixture(scope="module")
def hop():
    """Four seconds that close, in which the standing body hops once at 1 s and drifts by 2 cm and back."""
    still = resampled(embedded("cheer"), 120.0).poses[0]
    poses = np.repeat(still[None], 480, axis=0)
    t = np.arange(480) / 479.0
    poses[:, 0] += 0.02 * np.sin(2.0 * np.pi * t)
    poses[:, 2] += 0.3 * np.maximum(0.0, 1.0 - ((t - 0.25) / 0.05) ** 2)
    return Clip(poses, 120.0, "hop")


def test_a_stance_over_the_seam_has_one_place_however_long(hop):
    schedule = stances(hop, hop)
    assert hop.closes()
    assert schedule.standing[[0, -1]].all()
    assert not schedule.standing.all(axis=1).all()
    np.testing.assert_allclose(schedule.places[0], schedule.places[-1], atol=1e-9)


def test_a_sphere_keeps_its_place_ever_less_beside_a_stance(walks):
    schedule = stances(walks[0], walks[0])
    share, standing = schedule.kept[:, 0], schedule.standing[:, 0]
    lands = int(np.flatnonzero(np.diff(standing.astype(int)) > 0)[0]) + 1
    rising = share[lands - 7 : lands + 1]
    np.testing.assert_allclose(rising, np.arange(8) / 7.0, atol=1e-12)
    np.testing.assert_array_equal(schedule.places[lands - 6 : lands, 0], np.tile(schedule.places[lands, 0], (6, 1)))
    assert (share[standing] == 1.0).all()


def test_nothing_keeps_a_place_in_flight(hop):
    schedule = stances(hop, hop)
    flies = ~schedule.standing.any(axis=1)
    assert flies.any()
    assert (schedule.kept[flies] == 0.0).all()


def test_skate_is_the_way_from_the_median_place_of_each_stance():
    points = np.zeros((10, 2, 3))
    points[:4, 0, 0] = 0.0, 0.0, 0.0, 0.03
    points[6:, 0, 1] = 0.1, 0.1, 0.1, 0.14
    points[:, 1, 2] = 0.01 * np.arange(10)
    standing = np.ones((10, 2), dtype=bool)
    standing[4:6, 0] = False
    np.testing.assert_allclose(stance_slides(points, standing), [0.03, 0.04, 0.0])
    np.testing.assert_allclose(stance_slides(points, ~np.ones((10, 2), dtype=bool)), [0.0])


def test_the_standing_body_bears_its_weight(walks):
    walk = walks[0]
    loads = borne(walk, stances(walk, walk)).loads.sum(axis=1)
    assert loads.mean() == pytest.approx(1.0, abs=0.05)


def test_a_low_part_of_a_sole_that_bears_nothing_and_moves_does_not_skate(walks):
    """A toe that rolls off is as low as one that stands."""
    walk = walks[0]
    schedule = stances(walk, walk)
    points = sole_points(walk.poses)
    every = stance_slides(points, schedule.standing)
    assert well_formed(walk, ()).slid < every.max()


def test_the_embedded_walk_is_well_formed(walks):
    assert well_formed(walks[0], ()).faults() == ()


def test_a_pose_that_does_not_belong_stands_out(walks):
    poses = walks[0].poses.copy()
    poses[20, 3:] = np.tile([1.0, 0, 0, 0], 18)
    assert outliers(walks[0]) == 0
    assert outliers(Clip(poses, 120.0, "popped")) >= 1


@pytest.mark.slow
def test_a_captured_walk_is_made_well_formed(mocap, tmp_path):
    outcome = prepare_file(mocap / "snu/walk.bvh", tmp_path / "walk.bvh", report=tmp_path)
    made, after, follows, *_ = outcome
    before = well_formed(made.captured, clip_flights(made.captured))
    assert after.closed
    assert after.residual < 0.05 < before.residual
    assert after.skate < 0.005 < before.skate
    assert after.slid < 0.01
    assert follows.stands
    assert "the physical figure follows it for 20 s" in summary(outcome)
    page = (tmp_path / "prepare-walk.html").read_text(encoding="utf-8")
    assert re.search(r"<th>loop</th><td>ends [1-9]\d*\.\d° apart, .* s</td><td>ends 0\.0° apart</td>", page)
    followed = (
        rf"<td>the physical figure follows it for 20 s with a residual of {100 * follows.residual:.1f} % of weight"
    )
    assert re.search(r"<th>physical figure</th><td>the physical figure (falls|follows).*" + followed, page)
    again = load(tmp_path / "walk.bvh").clip
    np.testing.assert_allclose(pose_difference(again.poses, made.clip.poses), 0.0, atol=1e-7)


@pytest.mark.slow
def test_a_captured_cartwheel_is_made_feasible_on_feet_and_hands(mocap, tmp_path):
    outcome = prepare_file(mocap / "snu/cart.bvh", tmp_path / "cart.bvh")
    assert outcome.made.near
    assert outcome.made.hands.seconds > 0.5
    assert outcome.made.hands.moved < 0.12
    assert outcome.measures.residual < 0.05
    assert outcome.followed.stands
    assert "hands bear load for" in summary(outcome)


@pytest.mark.slow
def test_a_captured_dance_turns_on_its_feet(mocap, tmp_path):
    outcome = prepare_file(mocap / "deepmimic/humanoid3d_dance_a.txt", tmp_path / "dance.bvh")
    assert outcome.made.near
    assert outcome.made.fidelity.joints < OTHERWISE
    assert outcome.measures.skate < 0.005
    assert outcome.followed.stands


@pytest.mark.slow
def test_a_body_whose_root_wanders_over_standing_feet_has_a_feasible_motion_near(tmp_path):
    # Feet that drift with the root at up to 0.26 m/s stand, so the root is brought back over them.
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
def test_a_part_of_a_long_file_can_be_prepared(long_walk):
    made = prepared(long_walk, "10:12.2")
    assert made.captured.duration > 120.0
    assert made.clip.duration == pytest.approx(2.2, abs=0.01)


def test_the_whole_of_a_long_file_is_refused(long_walk):
    with pytest.raises(
        ModelError, match=r"long.bvh: lasts 13\d.* at most 120 s, or a part of it by `hvf prepare --loop START:END`"
    ):
        prepared(long_walk, "open")


@pytest.mark.slow
def test_what_a_file_lacks_is_said_in_the_terminal(tmp_path, capsys):
    walk = embedded("walk")
    write_rig(Rig(without=("clavicle",), leading=1), Clip(walk.poses[::4], walk.fps / 4, "walk"), tmp_path / "r.bvh")
    assert main(["prepare", str(tmp_path / "r.bvh"), str(tmp_path / "out.bvh")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "missing: left_clavicle (follows chest), right_clavicle (follows chest)"
    assert lines[1] == "left out: the first frame, a pose that is not of the motion"
    assert lines[-1].startswith("r: ")


def test_prepared_clips_are_kept_by_the_code_that_prepares_them():
    assert prepared.__module__ == prepared_clip._PREPARING_MODULE


def test_a_target_that_exists_is_left(tmp_path):
    write_bvh(embedded("walk"), tmp_path / "walk.bvh")
    with pytest.raises(ModelError, match="--overwrite"):
        prepare_file(tmp_path / "walk.bvh", tmp_path / "walk.bvh")


@pytest.mark.parametrize(("degrees", "near"), [(10.0, True), (60.0, False)])
def test_a_motion_that_takes_a_joint_far_beyond_its_range_is_not_near(degrees, near, monkeypatch, tmp_path):
    """As a run that is cut at full speed came to rest: it is tried again within the ranges, then kept as captured."""
    tried = []

    def bent(clip, schedule, **options):
        tried.append(clip)
        poses = clip.poses.copy()
        knee = 7 + 4 * JOINTS.index("right_knee")
        poses[10, knee : knee + 4] = np.cos(np.deg2rad(degrees) / 2), 0.0, -np.sin(np.deg2rad(degrees) / 2), 0.0
        return feasible(clip, schedule, **options)._replace(clip=Clip(poses, clip.fps, clip.name), residual=0.0)

    monkeypatch.setattr("models.mocap.preparation.prepare.feasible", bent)
    write_bvh(embedded("cheer"), tmp_path / "r.bvh")
    made = prepared(tmp_path / "r.bvh", "0:1" if near else "open")
    assert made.near is near
    assert len(tried) == (1 if near else 2)
    assert np.rad2deg(beyond_ranges(made.clip.poses).max()) < 30.0
    said = " ".join(advice(made))
    assert said == "" if near else re.search(r"takes a joint \d\d° beyond its range", said)
