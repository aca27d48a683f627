"""The public face: what a script may say, word for word, and how short its answers are."""

import json
from pathlib import Path

import numpy as np
import pytest

import hvf
from experiments.cli import main, parsed
from experiments.config.modes import MODES
from experiments.config.run_config import RunConfig, load_config
from experiments.config.words import config_of_options

PROMISED = (Path(__file__).parent / "promised.py").read_text(encoding="utf-8")


@pytest.mark.slow
def test_what_was_promised_runs_word_for_word(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(compile(PROMISED, "promised", "exec"), names)
    run = names["run"]
    assert isinstance(run, hvf.Run)
    assert run.summary.path.deviation_rms < 1e-3
    assert run.ticks["force"].shape == (20000, 3)
    assert hvf.load("edited.bvh").duration == pytest.approx(20.0, abs=0.1)
    assert {"force_0", "p_2"} <= set(run.frame().columns)
    last = names["r"]
    assert isinstance(last, hvf.Swept)
    assert last.values == {"field.k_r": 800}
    assert "so is any switching between them" in capsys.readouterr().out  # of the cases of the floor


@pytest.fixture(scope="module")
def sim() -> hvf.Simulation:
    curve = hvf.circle(lap=2.0)
    return hvf.Simulation(
        field=hvf.Follow(curve, k_r=300, b_d=8), haptic_map=hvf.Cylindrical(hvf.clips("cheer"), around=curve),
        figure=hvf.Figure(kind="none"),
    )  # fmt: skip


@pytest.fixture(scope="module")
def run(sim: hvf.Simulation) -> hvf.Run:
    return sim.run(0.5)


def test_what_is_printed_is_short(sim: hvf.Simulation, run: hvf.Run) -> None:
    shown = [sim, sim.field, sim.haptic_map, run, run.ticks, hvf.circle(), hvf.clips("walk")[0], hvf.persona("median")]
    for value in shown:
        assert len(repr(value)) < 600, repr(value)
        assert "array(" not in repr(value), repr(value)
        assert "0x" not in repr(value), repr(value)


def test_channels_of_a_run_that_is_not_kept_can_be_read(sim: hvf.Simulation) -> None:
    assert sim.run(0.1).ticks["p"].shape == (100, 3)


def test_a_run_that_fails_leaves_no_temporary_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Failing(hvf.HapticMap):
        def pose(self, x: np.ndarray) -> np.ndarray:
            if x[1] > 1e-3:
                raise ValueError("beyond what this map was made for")
            return hvf.rest_pose()

    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    moves = hvf.Simulation(
        field=hvf.Follow(hvf.circle(lap=2.0), k_r=300, b_d=8), haptic_map=Failing(),
        figure=hvf.Figure(kind="kinematic"),
    )  # fmt: skip
    with pytest.raises(Exception, match="beyond what this map"):
        moves.run(0.5)
    assert not list(tmp_path.iterdir())


def test_a_notebook_shows_the_replay(run: hvf.Run) -> None:
    page = run._repr_html_()
    assert page.startswith("<iframe srcdoc=")
    assert "Replay in 3D" in page


def test_a_simulation_is_stepped_tick_by_tick(sim: hvf.Simulation) -> None:
    times = []
    for tick in sim:
        times.append(tick.hand.t)
        if len(times) == 5:
            break
    np.testing.assert_allclose(np.diff(times), 1e-3, atol=1e-12)


def test_errors_of_a_map_of_ones_own_end_the_run() -> None:
    class Fails(hvf.HapticMap):
        def pose(self, x):
            if x[1] > 0.0:
                raise ValueError("no such place")
            return hvf.rest_pose()

    curve = hvf.circle(lap=1.0)
    field = hvf.Follow(curve, k_r=300, b_d=8)
    made = hvf.Simulation(field=field, haptic_map=Fails(), figure=hvf.Figure(kind="kinematic"))
    with pytest.raises(ValueError, match="no such place"):
        made.run(0.5)

    class Small(hvf.HapticMap):
        def pose(self, x):
            return np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])

    with pytest.raises(hvf.ParameterError, match="poses of Small have 7 numbers; the figure's have 75"):
        hvf.Simulation(field=field, haptic_map=Small()).run(0.5)


@pytest.mark.parametrize("mode", [cls().kind for cls in MODES])
def test_a_configuration_of_every_mode_goes_through_its_file(mode: str, tmp_path: Path) -> None:
    from experiments.config.part import to_json

    config = config_of_options(parsed(["run", "--mode", mode, "--seconds", "3"]).options)
    file = tmp_path / "config.json"
    file.write_text(to_json(config))
    assert config_of_options(parsed(["run", "--config", str(file)]).options) == config == load_config(file)


def test_a_recording_of_parts_in_python_says_that_its_script_makes_it_again(
    sim: hvf.Simulation, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sim.run(0.1, record=tmp_path / "run")
    capsys.readouterr()
    assert main(["reproduce", str(tmp_path / "run")]) == 2
    said = capsys.readouterr().err
    assert "is of a simulation put together in Python" in said
    assert "run the script again" in said
    assert said.count("\n") == 1


def test_a_recording_of_another_version_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import h5py

    out = tmp_path / "run"
    assert main(["run", "--figure", "none", "--seconds", "0.1", "--out", str(out)]) == 0
    with h5py.File(out / "run.h5", "r+") as file:
        config = json.loads(file["config"][()])
        config["figure_ticks"] = 4  # as a configuration of the first version had it
        del file["config"]
        file["config"] = json.dumps(config)
    capsys.readouterr()
    assert main(["reproduce", str(out)]) == 2
    said = capsys.readouterr().err
    assert "it was recorded by another version of the program, which can run it again" in said
    assert said.count("\n") == 1
    assert RunConfig()
