"""Remarks before a run on clips that cannot be blended or are off their pace, for every kind of map."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from controllers.haptic_map.lifted import Lifted
from controllers.haptic_map.river_clips import RiverClips
from controllers.motion.loops import checked_clip, closed_loop
from controllers.motion.strides import fit_to_lap, natural_lap
from experiments.config.options import run_config
from experiments.files.map_files import save_map
from experiments.fitting.blendable import going_round, lap_suits_blend, not_blendable, off_pace, timing_clip
from experiments.fitting.figure_legs import figure_legs
from experiments.setups.parts.governor import speeds_along
from experiments.setups.setups import map_parts
from experiments.setups.wiring import wire
from models.humanoid.skeleton import JOINTS, figure_model
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip


def test_clips_that_turn_over_or_fly_are_reported() -> None:
    walk, jump, flip = embedded("walk"), embedded("jump"), embedded("backflip")
    assert not_blendable((walk, walk)) == not_blendable((flip, flip)) == ()
    remarks = not_blendable((walk, flip, jump))
    assert len(remarks) == 2
    assert remarks[0].startswith("backflip turns over")
    assert remarks[1].startswith("jump is off the floor for 0.")


def test_clip_whose_wrist_goes_round_is_reported_and_one_whose_knee_does_or_that_raises_an_arm_is_not() -> None:
    walk, legs = embedded("walk"), figure_legs(figure_model())

    def with_turn(joint: str, degrees: float) -> Clip:
        poses, half = walk.poses.copy(), 0.5 * np.deg2rad(degrees) * np.sin(np.linspace(0.0, np.pi, walk.n_frames))
        at = 7 + 4 * JOINTS.index(joint)
        poses[:, at : at + 4] = 0.0
        poses[:, at], poses[:, at + 1] = np.cos(half), np.sin(half)
        poses[::3, at : at + 4] *= -1.0
        return Clip(poses, walk.fps, "capture")

    raised, wrist = with_turn("left_shoulder", 200.0), with_turn("left_wrist", 300.0)
    (remark,) = going_round((walk, wrist), legs)
    assert remark.startswith("capture turns left_wrist round")
    for clips in ((walk, raised), (walk, with_turn("left_knee", 300.0)), (wrist,)):
        assert going_round(clips, legs) == ()
    config = run_config(map="composite", clips=("walk", "walk", "walk"), lap=walk.duration, seconds=1.0)
    assert map_parts(config, figure_model(), (walk, wrist, walk)).remarks == (remark,)


def test_pace_tolerance_is_tighter_if_a_clip_flies() -> None:
    walk, angry, run = embedded("walk"), embedded("angry"), embedded("run")
    loops = [closed_loop(checked_clip(clip.poses, clip.fps, clip.name), clip.fps) for clip in (walk, angry, run)]
    slower = replace(loops[1], duration=0.8 * loops[0].duration)
    assert lap_suits_blend((walk, angry), (loops[0], slower), loops[0].duration)
    assert not lap_suits_blend((run, angry), (loops[2], slower), loops[2].duration)
    slowest = replace(loops[1], duration=0.7 * loops[0].duration)
    assert not lap_suits_blend((walk, angry), (loops[0], slowest), loops[0].duration)


def test_lap_is_timed_by_the_first_grounded_clip() -> None:
    run, walk, cheer = embedded("run"), embedded("walk"), embedded("cheer")
    assert [timing_clip(clips) for clips in ((walk, run), (run, walk, cheer), (run, run))] == [0, 1, 0]
    # At this lap the cheer is off its pace, so only arms are blended, and each clip keeps its own pace.
    parts = map_parts(run_config(clips=("run", "walk", "cheer"), lap=2.2, seconds=1.0), figure_model())
    assert parts.haptic_map.legs_of == 1
    assert not any("run at" in remark or "walk at" in remark for remark in parts.remarks)


def test_map_remarks_name_flying_and_off_pace_clips() -> None:
    config = run_config(map="composite", mode="follow", clips=("walk", "jump", "walk"), lap=1.2, seconds=1.0)
    flies, paced = map_parts(config, figure_model()).remarks
    assert flies.startswith("jump is off the floor for 0.")
    assert paced.startswith("a lap of 1.2 s plays jump at 2.00 times its recorded speed")


@pytest.mark.parametrize(
    ("clips", "lap", "laps", "paces"),
    [
        (("walk", "jump", "walk"), 1.2, 2, (0.92, 1.0, 0.92)),
        (("squat_dance", "cheer", "angry"), 4.0, 1, (0.9, 0.75, 0.9)),
        (("squat_dance", "squat_dance", "squat_dance"), 0.9, 1, (4.0, 4.0, 4.0)),
        (("squat_dance", "cheer", "walk"), 1.3, 3, (0.92, 0.77, 0.85)),
    ],
)
def test_river_clips_use_the_fewest_laps_that_keep_pace(clips, lap, laps, paces) -> None:
    config = run_config(map="rivers", mode="rivers", clips=clips, lap=lap, seconds=1.0)
    parts = map_parts(config, figure_model())
    assert parts.haptic_map.laps == laps
    played = [loop.duration / (laps * lap) for loop in parts.haptic_map.loops]
    np.testing.assert_allclose(played, paces, atol=0.01)
    assert any("a round of the clips takes" in remark for remark in parts.remarks) == (laps > 1)


def test_rivers_without_a_matching_period_are_reported() -> None:
    config = run_config(map="rivers", mode="rivers", clips=("spin", "angry", "squat_dance"), lap=0.5, seconds=1.0)
    parts = map_parts(config, figure_model())
    assert parts.haptic_map.laps == 4
    assert any("4 laps of 0.5 s play spin at" in remark for remark in parts.remarks)


def test_current_lap_is_not_advised() -> None:
    clips = embedded("angry"), embedded("jump")
    loops = [closed_loop(checked_clip(clip.poses, clip.fps, clip.name), clip.fps) for clip in clips]
    lap = natural_lap(loops)
    assert off_pace(clips, fit_to_lap(loops, 1.1 * lap), 1.1 * lap, 1, 0)[0].endswith(
        f"; --lap {lap:.1f} suits them best"
    )
    assert off_pace(clips, fit_to_lap(loops, lap), lap, 1, 0)[0].endswith("; no lap suits them all better")


def test_run_gets_one_lap_advice() -> None:
    session = wire(run_config(map="composite", figure="none", clips=("walk", "cheer", "cheer"), lap=1.2, seconds=1.0))
    assert sum("--lap" in remark for remark in session.remarks) == 1


def test_lifted_map_remarks_name_clips_that_turn_over(tmp_path: Path) -> None:
    clips = [embedded(name) for name in ("walk", "backflip")]
    angles = [2.0 * np.pi * np.linspace(0.0, 1.0, clip.n_frames) for clip in clips]
    sites = np.tile([[0.045, 0.0], [0.055, 0.0]], (16, 1, 1))
    haptic_map = Lifted(
        [(clip.poses, clip.fps) for clip in clips], [True] * 2, angles, sites, names=["walk", "backflip"]
    )
    save_map(haptic_map, tmp_path / "map.npz")
    remarks = map_parts(run_config(map=str(tmp_path / "map.npz"), seconds=1.0), figure_model()).remarks
    assert any(remark.startswith("backflip turns over") for remark in remarks)
    assert not any("walk" in remark and "flies" in remark for remark in remarks)


def test_two_lap_period_scales_admissible_speeds_like_one_lap() -> None:
    shares = []
    for lap in (2.4, 1.2):
        config = run_config(map="rivers", mode="rivers", clips=("walk", "jump", "walk"), lap=lap, seconds=1.0)
        parts = map_parts(config, figure_model())
        haptic_map = parts.haptic_map
        assert isinstance(haptic_map, RiverClips)
        assert haptic_map.laps == round(2.4 / lap)
        speeds = speeds_along(parts, haptic_map.curves[1], 1)
        # At the clip's own pace the hand is admitted; a flight bounds it from below.
        assert (speeds[:, 0].max() * lap, speeds[:, 1].min() * lap) == pytest.approx(
            (1.03 * haptic_map.curves[1].length, 1.04 * haptic_map.curves[1].length), rel=0.02
        )
        shares.append(np.mean(speeds[:, 0] > 0.0))
    # The flight lasts as long, of a lap half as long.
    assert shares[1] == pytest.approx(2.0 * shares[0], rel=0.05)


@pytest.mark.parametrize(("kind", "lap"), [("composite", 4.8), ("cylindrical", 4.0)])
def test_advised_lap_keeps_pace_of_the_leg_clip(kind: str, lap: float) -> None:
    """Two jumps of 2.4 s: a composite has the legs of its first clip, a cylinder those of one that does not fly."""
    config = run_config(map=kind, figure="none", clips=("jump", "ginga", "angry"), lap=1.4, seconds=1.0)
    assert any(f"--lap {lap:.1f} suits them best" in remark for remark in map_parts(config, figure_model()).remarks)
