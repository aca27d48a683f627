"""Relative paths in a configuration file start at its folder, wherever the program runs."""

from pathlib import Path

import pytest

from experiments.cli import main
from experiments.config.options import run_config
from experiments.config.part import to_json
from experiments.config.paths import load_config
from experiments.config.run_config import RunConfig
from experiments.setups.parts.defaults import resolved
from experiments.trials.design.plan import file_digest, plan_trials
from experiments.trials.study import Study
from experiments.tuning.tune_config import read_tuning
from models.mocap.library import embedded
from models.mocap.readers.own_bvh import write_bvh


def _written(config: RunConfig, folder: Path) -> Path:
    folder.mkdir(exist_ok=True)
    (folder / "my.json").write_text(to_json(config), encoding="utf-8")
    return folder / "my.json"


def test_relative_paths_of_a_file_start_at_its_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    file = _written(run_config(clips=("walk", "../a.bvh", "/b.bvh"), device_file="arm.json"), Path("settings"))
    config = load_config(file)
    assert config.map.clips == ("walk", "a.bvh", "/b.bvh")
    assert config == run_config(clips=config.map.clips, device_file="settings/arm.json")
    replayed = run_config(map="m.npz", replay="../runs/mine")
    assert load_config(_written(replayed, Path("settings"))) == run_config(map="settings/m.npz", replay="runs/mine")


def test_resolved_configuration_can_be_used_from_any_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_bvh(embedded("walk"), tmp_path / "mine.bvh")
    config = resolved(run_config(map="composite", clips=("mine.bvh",), device_file="arm.json"))
    monkeypatch.chdir("/")
    assert load_config(_written(config, tmp_path / "run")) == config
    assert config.map.clips == (str(tmp_path / "mine.bvh"),)


def test_refused_replay_of_a_file_names_the_full_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = _written(run_config(figure="none", replay="../runs/mine", seconds=1.0), tmp_path / "settings")
    monkeypatch.chdir(tmp_path)
    assert main(["run", "--config", str(file.relative_to(tmp_path)), "--out", "x"]) == 2
    assert f"{tmp_path}/runs/mine/run.h5: cannot be opened" in capsys.readouterr().err


def test_paths_in_studies_and_tunings_start_at_their_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_bvh(embedded("walk"), tmp_path / "mine.bvh")
    study = tmp_path / "s.toml"
    study.write_text(
        'name = "s"\n[run]\nfigure = "none"\n[factors]\nclips = [["mine.bvh"], ["walk"]]\n[users]\nnumber = 1\n'
    )
    tuning = tmp_path / "t.toml"
    tuning.write_text(
        'name = "t"\n[run]\nfigure = "none"\nclips = ["mine.bvh"]\n[space]\nstiffness = {low = 100.0, high = 300.0}\n'
    )
    keys = list[list[str]]()
    for folder in ("/", tmp_path):
        monkeypatch.chdir(folder)
        file_digest.cache_clear()
        keys.append([trial.key for trial in plan_trials(Study.load(study.relative_to(folder)).config)])
        assert Path(read_tuning(tuning.relative_to(folder)).run["clips"][0]).samefile(tmp_path / "mine.bvh")
    assert keys[0] == keys[1]
    assert len(set(keys[0])) == 2
