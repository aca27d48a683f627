"""Remarks before a run on clips that cannot be blended, for every kind of map."""

from pathlib import Path

import numpy as np
import pytest

from controllers.haptic_map.lifted import Lifted
from controllers.haptic_map.river_clips import RiverClips
from experiments.config.options import run_config
from experiments.files.map_files import save_map
from experiments.fitting.blendable import going_round, not_blendable
from experiments.fitting.figure_legs import figure_legs
from experiments.setups.parts.governor import speeds_along
from experiments.setups.setups import map_parts
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


def test_map_remarks_name_flying_and_off_pace_clips() -> None:
    config = run_config(map="composite", mode="follow", clips=("walk", "jump", "walk"), lap=1.2, seconds=1.0)
    flies, paced = map_parts(config, figure_model()).remarks
    assert flies.startswith("jump is off the floor for 0.")
    assert paced.startswith("a lap of 1.2 s plays jump at 2.00 times its recorded speed")


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
