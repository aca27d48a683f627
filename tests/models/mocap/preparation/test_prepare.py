"""Preparation of files: what it makes of a capture, what it refuses, what it reports."""

import re
from functools import partial

import numpy as np
import pytest

from experiments.cli import main
from experiments.flights.ballistics import clip_flights
from experiments.preparation import prepared_clip
from experiments.preparation.command import prepare_file
from experiments.preparation.prepared_file import infeasible
from experiments.preparation.tracking_trial import followed
from models.errors import ModelError
from models.humanoid.skeleton import CONTACT_RADIUS, JOINTS
from models.mocap.library import embedded, load
from models.mocap.motion.clip import Clip, pose_difference
from models.mocap.motion.kinematics import sole_points
from models.mocap.motion.ranges import beyond_ranges
from models.mocap.preparation.bounds import MAX_SKATE
from models.mocap.preparation.feasible import feasible
from models.mocap.preparation.fidelity import MAX_JOINT_DISTANCE
from models.mocap.preparation.poses import resampled
from models.mocap.preparation.prepare import prepared
from models.mocap.preparation.well_formed import well_formed
from models.mocap.readers.own_bvh import write_bvh
from tests.models.mocap.retargeting.rigs import Rig, write_rig


@pytest.mark.slow
def test_prepared_open_upright_motion_rests_on_both_feet(walks, tmp_path):
    """A stride of a walk with one foot in the air at both ends."""
    walk = walks[0]
    feet = sole_points(walk.poses)[:, :, 2].reshape(-1, 2, 4).min(axis=2).max(axis=1)
    n = walk.n_frames // 2
    start = int(np.argmax(feet[: n // 2]))
    assert feet[[start, start + n]].min() > CONTACT_RADIUS + 0.03
    write_bvh(Clip(walk.poses[start : start + n + 1], 120.0, "part"), tmp_path / "part.bvh")
    result = prepared(tmp_path / "part.bvh", "open")
    assert result.near
    np.testing.assert_allclose(sole_points(result.clip.poses)[[0, -1], :, 2], CONTACT_RADIUS, atol=5e-3)
    assert result.attempt.residual < 0.05


@pytest.mark.slow
def test_preparation_makes_a_captured_walk_well_formed(mocap, tmp_path):
    outcome = prepare_file(mocap / "snu/walk.bvh", tmp_path / "walk.bvh", report=tmp_path)
    result, after, follows, *_ = outcome
    before = well_formed(result.captured, clip_flights(result.captured))
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
    np.testing.assert_allclose(pose_difference(reloaded.poses, result.clip.poses), 0.0, atol=1e-7)


@pytest.mark.slow
def test_preparation_makes_a_captured_cartwheel_feasible_on_feet_and_hands(mocap, tmp_path):
    outcome = prepare_file(mocap / "snu/cart.bvh", tmp_path / "cart.bvh")
    assert outcome.prepared.near
    assert outcome.prepared.hands.seconds > 0.5
    assert outcome.prepared.hands.moved < 0.12
    assert outcome.measures.residual < 0.05
    assert outcome.followed.stands
    assert "hands are loaded for" in str(outcome)


@pytest.mark.slow
def test_preparation_of_a_captured_dance_lets_feet_turn(mocap, tmp_path):
    """With one heading a stance, joints are 10.2° from the capture instead of 4.8, and feet skate by 14 mm."""
    outcome = prepare_file(mocap / "deepmimic/humanoid3d_dance_a.txt", tmp_path / "dance.bvh")
    assert outcome.prepared.near
    assert outcome.prepared.fidelity.joints < MAX_JOINT_DISTANCE
    assert outcome.measures.skate < MAX_SKATE
    assert outcome.followed.stands


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    ["cmu_amc/02_01.amc", "cmu_amc/02_03.amc", "deepmimic/humanoid3d_walk.txt", "snu/walk.bvh", "xia/dme_example.bvh"],
)
def test_prepared_gaits_are_within_3_degrees_and_5_cm_of_their_captures(mocap, name):
    near = prepared(mocap / name).fidelity
    assert near.gait
    assert near.faults() == ()


@pytest.mark.slow
def test_a_leg_is_as_near_to_its_capture_as_an_arm(mocap):
    """With half the weights on legs and ankles, and none on height, they are 3.7°, the root 2.1 cm from it."""
    near = prepared(mocap / "cmu_amc/02_03.amc").fidelity
    assert np.rad2deg(near.joints) < 2.8
    assert near.root < 0.013


@pytest.mark.slow
def test_preparation_removes_root_drift_over_standing_feet(tmp_path):
    # Feet that drift with the root at up to 0.26 m/s count as standing, so the root is moved back over them.
    cheer = embedded("cheer")
    poses = np.concatenate((cheer.poses, cheer.poses[1:]))
    poses[:, 0] += 0.25 * np.sin(np.linspace(0.0, 2 * np.pi, len(poses)))
    write_bvh(Clip(poses, cheer.fps, "wanders"), tmp_path / "wanders.bvh")
    result = prepared(tmp_path / "wanders.bvh")
    assert result.near
    assert result.attempt.change.moved > 0.15
    assert np.rad2deg(result.fidelity.joints) < 0.5
    assert not well_formed(result.clip, clip_flights(result.clip)).faults()


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


@pytest.fixture
def one_step(monkeypatch):
    """The search for a feasible motion ends after one step."""
    monkeypatch.setattr("models.mocap.preparation.attempt.feasible", partial(feasible, iterations=1))


@pytest.mark.slow
@pytest.mark.usefixtures("one_step")
def test_part_of_a_long_file_can_be_prepared(long_walk):
    result = prepared(long_walk, "10:12.2")
    assert result.captured.duration > 120.0
    assert result.clip.duration == pytest.approx(2.2, abs=0.01)


@pytest.mark.parametrize(
    ("loop", "what"), [("open", r"it, at rest at both ends, lasts 13\d"), ("0:125", r"its cycle lasts 125\.00 s")]
)
def test_clip_longer_than_120_s_is_refused_with_what_lasts_so_long(long_walk, loop, what):
    expected = "at most 120 s, or a part of it by `hvf prepare --loop START:END`"
    with pytest.raises(ModelError, match=rf"long.bvh: {what}.* {expected}"):
        prepared(long_walk, loop)


@pytest.mark.slow
@pytest.mark.usefixtures("one_step")
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
@pytest.mark.slow
def test_motion_with_a_joint_far_beyond_its_range_is_not_near_the_capture(degrees, near, monkeypatch, tmp_path):
    """As when a run cut at full speed comes to rest. Without a last step it is solved again, then left as captured."""
    attempts = []

    def bent(clip, schedule, **options):
        attempts.append(clip)
        poses = clip.poses.copy()
        knee = 7 + 4 * JOINTS.index("right_knee")
        poses[10, knee : knee + 4] = np.cos(np.deg2rad(degrees) / 2), 0.0, -np.sin(np.deg2rad(degrees) / 2), 0.0
        return feasible(clip, schedule, iterations=1, **options)._replace(
            clip=Clip(poses, clip.fps, clip.name), residual=0.0
        )

    monkeypatch.setattr("models.mocap.preparation.attempt.feasible", bent)
    monkeypatch.setattr("models.mocap.preparation.attempt._contact_excess", lambda clip: np.zeros(3))  # one pass
    walk = embedded("walk")
    write_bvh(
        embedded("cheer") if near else Clip(walk.poses[: walk.n_frames // 2 + 7], walk.fps, "r"), tmp_path / "r.bvh"
    )
    result = prepared(tmp_path / "r.bvh", "0:1" if near else "open")
    assert result.near is near
    assert len(attempts) == (1 if near else 3)
    assert np.rad2deg(beyond_ranges(result.clip.poses).max()) < 30.0
    message = " ".join(infeasible(result))
    assert message == "" if near else re.search(r"takes a joint \d\d° beyond its range", message)
