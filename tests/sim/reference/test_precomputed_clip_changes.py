"""Clip changes computed before a run: they begin at a gate and end in the other clip, without jumps."""

import json
from pathlib import Path
from subprocess import CompletedProcess
from types import SimpleNamespace

import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from controllers.haptic_map.clip_change import ClipChange
from controllers.haptic_map.river_clips import RiverClips
from controllers.haptic_map.river_memory import ACTIVE_RIVER, TIMING_RIVER, TRANSITION
from controllers.state import stylus_path
from experiments.config.options import run_config
from experiments.config.run_config import Figure
from experiments.files import array_cache
from experiments.fitting import hand_tours, river_changes
from experiments.fitting.animation_trial import AnimationTrial
from experiments.fitting.figure_legs import figure_legs, packed_legs
from experiments.fitting.rest_phases import with_rests
from experiments.preparation.followed import Followed
from experiments.setups.modes.rivers import river_bundle
from experiments.setups.parts.clips import load_clips
from experiments.setups.setups import map_parts
from models.humanoid.skeleton import figure_model
from models.mocap.motion.clip import Clip, pose_difference
from sim.recording.recording import Recording
from sim.reference.reference import make_reference, map_poses, reference_along
from tests.experiments.own_process import COMMAND, LISTENER, compiled_names, run_python
from tests.sim.gliding_hand import gliding_hand

LAP, PERIOD = 3.4, 2e-3
FIGURE = figure_model()
CURVES = [river.curve for river in river_bundle(Trajectory.circle(0.0477, LAP), 0.025, 0.02, 4.0, 0.015).rivers]
NAMES = ("squat_dance", "walk", "angry")
DISTINCT_CLIPS = ("walk", "squat_dance", "angry")


@pytest.fixture(scope="module")
def map_with_offsets() -> RiverClips:
    clips = [(clip.poses, clip.fps) for clip in load_clips(NAMES)[0]]
    return RiverClips(CURVES, clips, 0.015, figure_legs(FIGURE), LAP)


@pytest.fixture(scope="module")
def map_with_changes(map_with_offsets: RiverClips) -> RiverClips:
    """With a change from the first clip to the second, taken from where the search starts."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(river_changes, "feasible", lambda clip, *rest, **more: SimpleNamespace(clip=clip, costs=(0.0,)))
        gate, *rows = river_changes._change(map_with_offsets.on_one_river(), 0.4, FIGURE, 0, 1, LAP / 8 * np.arange(8))
    return map_with_offsets.with_changes([ClipChange(0, 1, gate[:1], np.array(rows))])


def _played(clips: RiverClips, rivers: tuple[tuple[float, int], ...], seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Poses and memory rows of a hand that changes to each river at a given moment."""
    t = np.arange(round(seconds / PERIOD)) * PERIOD
    stylus, traces = gliding_hand(CURVES, LAP, rivers, t)
    reference = make_reference(FIGURE, clips.compiled(), PERIOD, 6.0, 0.4, packed_legs(FIGURE))
    poses, memory = np.empty((len(t), 75)), np.empty((len(t), len(reference.memory)))
    for k in range(0, len(t), 5):
        rows = slice(k, k + 5)
        reference_along(reference, stylus[rows], traces[rows], poses[rows])
        memory[rows] = reference.memory
    return poses, memory


@pytest.mark.slow
def test_change_begins_at_its_gate_ends_in_the_other_clip_without_jumps(map_with_changes: RiverClips) -> None:
    (change,) = map_with_changes.changes
    gate, begins = change.gates[0], 0.3
    poses, memory = _played(map_with_changes, ((begins, 1),), 2.0 * LAP)
    t = np.arange(len(poses)) * PERIOD
    # The course of the hand changes at once, while the clip plays on to the gate.
    assert t[memory[:, TIMING_RIVER] == 1.0][0] < begins + 0.1
    assert t[memory[:, ACTIVE_RIVER] == 1.0][0] == pytest.approx(gate if gate > begins + 0.05 else gate + LAP, abs=0.05)
    passing = t[memory[:, TRANSITION] >= 0.0]
    assert passing[-1] - passing[0] == pytest.approx(change.seconds, abs=0.1)
    rate = pose_difference(poses[:-1], poses[1:]) / PERIOD
    velocity_steps = np.abs(np.diff(rate, axis=0))[round(0.5 / PERIOD) :]
    # Changes within 2 ms: without the offset 100 rad/s and more, and 1 m/s.
    assert velocity_steps[:, 6:].max() < 1.5
    assert velocity_steps[:, :3].max() < 0.05
    after = round((passing[-1] + 0.2) / PERIOD)
    own = map_with_changes.compiled().memory
    own[ACTIVE_RIVER] = own[TIMING_RIVER] = 1.0
    alone = map_poses(map_with_changes, stylus_path(CURVES[1].point(t[after : after + 1] % LAP)), own)
    assert np.abs(pose_difference(alone, poses[after : after + 1])[0, 6:]).max() < 0.02


def test_hand_that_returns_before_the_gate_causes_no_change(map_with_changes: RiverClips) -> None:
    gate = map_with_changes.changes[0].gates[0]
    leaves = (gate + 0.3) % LAP
    poses, memory = _played(map_with_changes, ((LAP + leaves, 1), (LAP + leaves + 0.6, 0)), 2.6 * LAP)
    assert np.all(memory[:, ACTIVE_RIVER] == 0.0)
    assert np.any(memory[:, TIMING_RIVER] == 1.0)
    assert memory[-1, TIMING_RIVER] == 0.0
    rate = pose_difference(poses[:-1], poses[1:]) / PERIOD
    assert np.abs(np.diff(rate, axis=0))[round(0.5 / PERIOD) :, 6:].max() < 1.5


def test_change_without_precomputed_passage_goes_by_offsets(
    map_with_offsets: RiverClips, map_with_changes: RiverClips
) -> None:
    rivers = ((1.4, 2), (4.3, 0))
    np.testing.assert_array_equal(_played(map_with_changes, rivers, 6.0)[0], _played(map_with_offsets, rivers, 6.0)[0])


def test_map_is_unchanged_where_no_change_is_found(
    map_with_offsets: RiverClips, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(array_cache, "results_folder", lambda module: tmp_path)
    # Other processes would not see the patched `_make_passage`.
    monkeypatch.setattr(river_changes, "run_in_workers", lambda calls: [call(*given) for call, given in calls])
    monkeypatch.setattr(river_changes, "_make_passage", lambda *rest: None)
    for _ in range(2):  # computed, and loaded from the cache
        haptic_map = river_changes.with_changes(map_with_offsets, 0.4, FIGURE)
        assert haptic_map.changes == ()
        np.testing.assert_array_equal(haptic_map.compiled().params, map_with_offsets.compiled().params)


def test_change_found_in_a_two_lap_round_equals_that_of_a_doubled_lap(
    map_with_offsets: RiverClips, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(river_changes, "feasible", lambda clip, *rest, **more: SimpleNamespace(clip=clip, costs=(0.0,)))
    half = [river.curve for river in river_bundle(Trajectory.circle(0.0477, LAP / 2), 0.025, 0.02, 4.0, 0.015).rivers]
    clips = [(clip.poses, clip.fps) for clip in load_clips(NAMES)[0]]
    twice = RiverClips(half, clips, 0.015, figure_legs(FIGURE), LAP, laps=2)
    moments = LAP * np.array([0.75, 0.85])
    for first, second in ((0, 1), (2, 0)):
        once, again = (
            river_changes._change(haptic_map.on_one_river(), 0.4, FIGURE, first, second, moments)
            for haptic_map in (map_with_offsets, twice)
        )
        assert once[0, 0] > 0.5 * LAP
        assert once.shape == again.shape
        # The stylus filter lags twice as far behind a hand that is twice as fast.
        np.testing.assert_allclose(again, once, atol=0.02)


def test_common_stride_count_of_two_clips_is_found(map_with_offsets: RiverClips) -> None:
    walk, run = (load_clips((name,))[0][0] for name in ("walk", "run"))
    clips = RiverClips(CURVES[:2], [(clip.poses, clip.fps) for clip in (walk, run)], 0.015, figure_legs(FIGURE), 4.4)
    alike = clips.on_one_river()
    strides = river_changes._stride_count(alike, 0, 1)
    lap = np.arange(840) * LAP / 840
    for river in (0, 1):
        joints = river_changes._clip_poses(alike, river, lap)[:, 7:]
        assert np.abs(joints - np.roll(joints, 840 // strides, axis=0)).max() < 0.02
    assert strides > 1
    assert river_changes._stride_count(map_with_offsets.on_one_river(), 0, 2) == 1


@pytest.mark.parametrize(
    ("result", "remarks"),
    [
        (Followed(0.05), ()),
        (Followed(0.2), ("from river to river the physical figure has a residual of 20 % of weight",)),
        (
            Followed(0.2, 6.5),
            (
                "from river to river the physical figure falls at 6.5 s, "
                "1.0 s after the change from squat_dance to walk",
            ),
        ),
        (Followed(0.2, 2.0), ("from river to river the physical figure falls at 2.0 s, before any river changes",)),
    ],
)
def test_remark_names_the_change_before_a_fall_or_the_missing_support(
    map_with_offsets: RiverClips, monkeypatch: pytest.MonkeyPatch, result: Followed, remarks: tuple[str, ...]
) -> None:
    def followed(trial: AnimationTrial) -> Followed:
        return result if trial.seconds == hand_tours._RIVERS_DURATION else Followed(0.05)

    monkeypatch.setattr(AnimationTrial, "followed", followed)
    assert hand_tours.river_remarks(map_with_offsets, NAMES, Figure(), FIGURE) == remarks


def test_each_clip_that_is_not_followed_through_its_round_is_named_with_its_pace(
    map_with_offsets: RiverClips, monkeypatch: pytest.MonkeyPatch
) -> None:
    def followed(trial: AnimationTrial) -> Followed:
        return Followed(0.05) if trial.seconds == hand_tours._RIVERS_DURATION else Followed(0.2, 3.0)

    def remarks(*names: str) -> tuple[str, ...]:
        return hand_tours.river_remarks(map_with_offsets, names, Figure(), FIGURE)

    monkeypatch.setattr(AnimationTrial, "followed", followed)
    first, second, third = (f"{loop.duration / LAP:.2f}" for loop in map_with_offsets.loops)
    assert first == third != second
    told = "at {} times its recorded speed, the physical figure falls at 3.0 s"
    dance, walk = f"with dance alone, {told.format(first)}", f"with walk alone, {told.format(second)}"
    assert remarks("dance", "walk", "dance") == (dance, walk)
    # Files of two folders may have one name.
    assert remarks("walk", "walk", "dance") == (dance.replace("dance", "walk"), walk, dance)


def test_trial_of_a_river_shows_its_clip_through_a_whole_round(map_with_offsets: RiverClips) -> None:
    once = RiverClips(CURVES, [(clip.poses, clip.fps) for clip in load_clips(NAMES)[0]], 0.015, (), 3 * LAP, True, 3)
    for river in (0, 2):
        shown = hand_tours.round_of_river(once, river)
        assert shown.duration > 3 * LAP + 5.0
        again = round(3 * LAP * shown.fps)
        np.testing.assert_allclose(np.abs(shown.poses[again, 7:]), np.abs(shown.poses[0, 7:]), atol=1e-6)
        own = once.on_one_river().compiled().memory
        own[ACTIVE_RIVER] = river
        points = CURVES[0].point(CURVES[0].start + np.arange(shown.n_frames) / shown.fps % LAP)
        alike = map_poses(once.on_one_river(), stylus_path(points), own)
        np.testing.assert_allclose(shown.poses[:, 7:], alike[:, 7:], atol=2e-3)


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("rivers") / "run"


@pytest.fixture(scope="module")
def run_with_changes(run_folder: Path) -> CompletedProcess[str]:
    """A pushed hand among the rivers of three clips: a separate process computes the changes and caches them."""
    rivers = ("--mode", "rivers", "--map", "rivers", "--clips", *DISTINCT_CLIPS, "--lap", f"{LAP}")
    return run_python(LISTENER + COMMAND, "run", *rivers, "--user", "push", "--seconds", "6", "--out", str(run_folder))


@pytest.mark.slow
def test_run_with_changes_compiles_nothing_in_its_own_process(run_with_changes: CompletedProcess[str]) -> None:
    assert "The stylus ran" in run_with_changes.stdout
    assert compiled_names(run_with_changes) == []


@pytest.mark.slow
@pytest.mark.usefixtures("run_with_changes")
def test_river_switch_is_recorded_at_its_time(run_folder: Path) -> None:
    summary = json.loads((run_folder / "summary.json").read_text())
    level, wave = DISTINCT_CLIPS[:2]
    assert f"level ({level}) → wave ({wave})" in "\n".join(summary["lines"])
    with Recording(run_folder / "run.h5") as recording:
        river, t = recording.channel("ticks", "river")[:], recording.channel("ticks", "t")[:]
    first = int(np.flatnonzero(np.diff(river))[0])
    assert (river[first], river[first + 1]) == (0.0, 1.0)
    # Half way round the level river.
    assert LAP / 2 - 0.1 < t[first] < LAP / 2 + 0.5


@pytest.mark.slow
@pytest.mark.usefixtures("run_with_changes")
def test_animation_has_no_jump_and_the_figure_stands(run_folder: Path) -> None:
    summary = json.loads((run_folder / "summary.json").read_text())
    with Recording(run_folder / "run.h5") as recording:
        reference = recording.channel("frames", "reference")[:]
        period = 1.0 / recording.rates["frames"]
    rate = pose_difference(reference[:-1], reference[1:]) / period
    # Within what a clip does: without inertialisation a joint turns by more than 100 rad/s at a change.
    assert np.abs(rate[:, 6:]).max() < 20.0
    assert np.abs(rate[:, :3]).max() < 2.5
    assert summary["figure"]["fell_at"] is None
    assert summary["figure"]["joint_error_rms_deg"] < 4.0


@pytest.mark.slow
@pytest.mark.usefixtures("run_with_changes")
def test_figure_follows_all_changes_between_three_clips_better_than_offsets() -> None:
    from experiments.preparation.tracking_trial import followed

    haptic_map = map_parts(run_config("rivers", "rivers", clips=DISTINCT_CLIPS, lap=LAP), FIGURE).haptic_map
    map_with_offsets = with_rests(haptic_map, FIGURE)
    found = river_changes.with_changes(map_with_offsets, Figure().blend, FIGURE)
    assert {(change.first, change.second) for change in found.changes} == {
        (a, b) for a in range(3) for b in range(3) if a != b
    }
    seconds = hand_tours._RIVERS_DURATION
    by_offsets, by_changes = (
        followed(hand_tours.tour_of_rivers(made, Figure(), FIGURE), seconds) for made in (map_with_offsets, found)
    )
    # Measured: 4 and 16 %.
    assert by_changes.fell is None
    assert by_changes.residual < min(0.08, 0.5 * by_offsets.residual)
    assert isinstance(hand_tours.tour_of_rivers(found, Figure(), FIGURE), Clip)
