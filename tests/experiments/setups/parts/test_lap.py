"""The lap of a run that does not state one: 4 s, or one that suits the motion files among its clips."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from experiments.config.maps import Led
from experiments.config.options import run_config
from experiments.config.run_config import RunConfig
from experiments.fitting.suitable_laps import pace_mismatch
from experiments.setups.parts.defaults import resolved
from experiments.setups.parts.lap import circle_of
from experiments.setups.setups import map_parts
from experiments.setups.wiring import wire
from models.humanoid.skeleton import figure_model
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip
from models.mocap.readers.own_bvh import write_bvh


@pytest.fixture
def slow_jump(tmp_path: Path) -> str:
    """A file of three jumps, of 7.2 s."""
    jump = embedded("jump")
    poses = np.concatenate([jump.poses[:-1], jump.poses[:-1], jump.poses])
    write_bvh(Clip(poses, jump.fps, "jumps"), tmp_path / "jumps.bvh")
    return str(tmp_path / "jumps.bvh")


def lap(config: RunConfig) -> float:
    filled = resolved(config).map
    assert not isinstance(filled, Led)
    return circle_of(filled).duration


@pytest.mark.parametrize("kind", ["cylindrical", "composite"])
def test_default_lap_plays_a_file_at_its_own_pace(kind: str, slow_jump: str) -> None:
    config = run_config(map=kind, clips=(slow_jump,), seconds=1.0)
    parts = map_parts(resolved(config), figure_model())
    assert pace_mismatch(parts.clips, parts.haptic_map.loops[:1], lap(config)) == 0.0
    assert not any("times its recorded speed" in remark for remark in parts.remarks)


@pytest.mark.slow
def test_default_lap_of_rivers_is_one_of_a_round(slow_jump: str) -> None:
    config = run_config(mode="rivers", map="rivers", clips=(slow_jump, "jump"), seconds=1.0)
    assert lap(config) == pytest.approx(3.6)
    parts = map_parts(resolved(config), figure_model())
    assert parts.haptic_map.laps == 2
    assert pace_mismatch((parts.clips * 2)[:3], parts.haptic_map.loops, 7.2) == 0.0


def test_given_lap_and_laps_of_embedded_clips_stay(slow_jump: str) -> None:
    assert lap(run_config(clips=(slow_jump,), lap=2.0)) == 2.0
    assert lap(run_config(clips=("jump",))) == 4.0
    assert lap(run_config(map="robot-arm")) == 4.0


@pytest.mark.slow
def test_chosen_lap_is_said_and_a_given_one_is_not(slow_jump: str) -> None:
    config = run_config(figure="none", map="composite", clips=(slow_jump, "walk", "walk"), seconds=1.0)
    session = wire(config)
    assert any(remark.startswith("a lap takes 7.2 s, which") for remark in session.remarks)
    assert any("this run of 1 s ends before it does" in remark for remark in session.remarks)
    assert not any("ends before it does" in remark for remark in wire(replace(config, seconds=8.0)).remarks)
    assert not any("the hand goes round" in remark for remark in session.remarks)
    narrow = run_config(figure="none", map="composite", clips=(slow_jump, "walk", "walk"), radius=0.012, reach=0.005)
    assert any("the hand goes round at 10 mm/s" in remark for remark in wire(narrow).remarks)
    assert session.config == resolved(config)
    assert not any("a lap takes" in remark for remark in wire(replace(config, map=resolved(config).map)).remarks)
