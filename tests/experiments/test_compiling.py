"""Compilation before a run: in a process of its own, once, and only when a part is missing."""

import pickle
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from controllers.curves.trajectory import Trajectory
from controllers.fields.bunny import Bunny
from controllers.fields.follow import Follow
from controllers.fields.own_law import law
from controllers.haptic_map.base import CompiledMap
from controllers.haptic_map.expressive import EXPRESSIVE
from experiments import compiling
from experiments.compiling import compile_once, compiled_parts
from experiments.config.run_config import ArmConfig, RunConfig
from experiments.setups.robot_arm import wire_arm


@pytest.fixture
def started(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """Configurations that a process was started with."""
    configs: list[object] = []
    monkeypatch.setattr(compiling, "CACHE_FOLDER", tmp_path)
    monkeypatch.setattr(compiling.subprocess, "run", lambda command, input, **_: configs.append(pickle.loads(input)))
    return configs


def test_parts_are_the_loop_the_maps_and_the_laws():
    expressive = CompiledMap(EXPRESSIVE, np.array([1.0, 0.0]), np.zeros(1))
    assert compiled_parts("figure", expressive) == ("figure", "map-6", "map-1")
    curve = Trajectory.circle(0.05, 4.0)
    follow, bunny = Follow(curve, 200.0, 4.0), Bunny(curve, 200.0, 4.0, 0.02)
    own = law(compiled=True)(lambda hand: (0.0, 0.0, 1.0))
    laws = ("law-bunny_wrench", "law-follow_wrench")
    assert compiled_parts("figure", expressive, bunny + follow + own + follow) == ("figure", "map-6", "map-1", *laws)


def test_a_process_is_started_when_a_part_is_missing_and_with_the_run_s_configuration(started, tmp_path, capsys):
    config = RunConfig(seconds=3.0, mode="bunny")
    (tmp_path / "figure.compiled").touch()
    compile_once(Console(), config, ("figure", "law-1"))
    assert started == [config]
    assert "Compiling" in capsys.readouterr().out
    (tmp_path / "law-1.compiled").touch()
    compile_once(Console(), config, ("figure", "law-1"))
    assert started == [config]
    assert not capsys.readouterr().out


def test_a_robot_arm_says_what_it_needs_before_it_is_made():
    told: list[tuple[str, ...]] = []
    wire_arm(ArmConfig(), told.append)
    assert told == [("arm", "map-4", "law-follow_wrench")]
