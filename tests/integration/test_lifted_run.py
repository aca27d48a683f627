"""From clips to a map file to runs on it: FOLLOW on one curve, and a hand that changes over where lifting says."""

import json
from pathlib import Path

import numpy as np
import pytest

from experiments.cli import main
from experiments.config import RunConfig
from experiments.lifted_runs import carried_over
from experiments.map_files import load_figure_map
from experiments.run import run
from sim.recording import Recording

pytestmark = pytest.mark.slow

CLIPS = ("walk", "run", "jump", "backflip")


@pytest.fixture(scope="module")
def map_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("lifted") / "map.npz"
    assert main(["lift", *CLIPS, "--out", str(out)]) == 0
    return out


def test_the_file_holds_the_transitions_that_were_found(map_file: Path) -> None:
    haptic_map, clips = load_figure_map(map_file)
    assert tuple(clip.name for clip in clips) == CLIPS
    pairs = {(int(row[0]), int(row[1])) for row in haptic_map.transitions}  # pyright: ignore
    assert (0, 1) in pairs
    assert main(["lift", *CLIPS, "--out", str(map_file)]) == 2


@pytest.mark.parametrize(("curve", "seconds"), [("walk", 2.2), ("run", 2.2), ("jump", 2.4)])
def test_follow_keeps_a_clip_s_pace_and_its_figure_on_its_feet(
    map_file: Path, tmp_path: Path, curve: str, seconds: float
) -> None:
    out = tmp_path / "follow"
    command = ["run", "--map", str(map_file), "--curve", curve, "--seconds", "10", "--out", str(out)]
    assert main(command) == 0
    summary = json.loads((out / "summary.json").read_text())
    assert summary["path"]["deviation_rms_mm"] < 1.0
    assert summary["path"]["lap_seconds"] == pytest.approx(seconds, rel=0.01)
    assert summary["figure"]["fell_at"] is None
    assert summary["figure"]["root_error_max_cm"] < 5.0
    assert summary["figure"]["residual_force_rms"] < 0.1
    assert summary["figure"]["residual_in_flight_max"] == 0.0


def test_a_hand_changes_over_from_walk_to_run_where_lifting_found_a_transition(map_file: Path, tmp_path: Path) -> None:
    haptic_map, _ = load_figure_map(map_file)
    row = next(row for row in haptic_map.transitions if tuple(row[:2]) == (0.0, 1.0))  # pyright: ignore
    angle = float(row[2])
    alone = RunConfig(map=str(map_file), mode="rivers", curve="walk", seconds=9.0)
    run(alone, tmp_path / "alone", True, 0.0)
    with Recording(tmp_path / "alone" / "run.h5") as recording:
        river, p = recording.channel("ticks", "river")[:], recording.channel("ticks", "p")[:]
        t = recording.channel("ticks", "t")[:]
    # A hand that lets go stays with the walk, through the crossing.
    assert (river == 0.0).all()
    theta = np.unwrap(np.arctan2(p[:, 1], p[:, 0]))
    start = float(t[np.argmax(theta > 2.0 * np.pi * 2.0 + angle - 0.41)])
    grab = carried_over(haptic_map, 0, 1, angle, start)  # pyright: ignore
    carried = RunConfig(map=str(map_file), mode="rivers", curve="walk", seconds=9.0, grabs=(grab,))
    summary = run(carried, tmp_path / "carried", True, 0.0)
    assert any("walk → run" in line for line in summary.lines())
    with Recording(tmp_path / "carried" / "run.h5") as recording:
        river, p = recording.channel("ticks", "river")[:], recording.channel("ticks", "p")[:]
        distance = recording.channel("ticks", "distance")[:]
    changes = np.flatnonzero(np.diff(river))
    assert len(changes) == 1
    at = p[changes[0] + 1]
    away = np.remainder(np.arctan2(at[1], at[0]) - angle + np.pi, 2.0 * np.pi) - np.pi
    assert abs(away) < 0.5
    # And stays with the run when it is let go of.
    assert river[-1] == 1.0
    assert distance[-2000:].max() < 1e-3


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["lift", "walk", "--out", "map.txt"], "a map is written into a .npz file"),
        (["lift", "walk", "nobody"], "no embedded clip 'nobody'"),
        (["lift", "walk", "--cyclic", "run"], "cyclic names run; expected some of the clips"),
        (["lift", "walk", "--room.r-range", "0.02", "0.3"], "does not reach|beyond the Phantom's stops"),
        (["lift", "walk", "run", "--room.separation", "0.2"], "2 clips do not fit 200 mm apart"),
        (["run", "--curve", "walk"], "only a lifted map has curves by name"),
    ],
)
def test_what_cannot_be_lifted_is_one_line_and_exit_code_2(
    arguments: list[str], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import re

    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    error = capsys.readouterr().err
    assert re.search(says, error), error
    assert len(error.strip().splitlines()) == 1
