"""`hvf reproduce` of recordings that this program cannot run again."""

import json
from pathlib import Path

import pytest

import hvf
from experiments.cli import main


@pytest.mark.slow
def test_recording_of_python_simulation_refers_to_its_script(
    sim: hvf.Simulation, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sim.run(0.1, record=tmp_path / "run")
    capsys.readouterr()
    assert main(["reproduce", str(tmp_path / "run")]) == 2
    stderr = capsys.readouterr().err
    assert "is of a simulation put together in Python" in stderr
    assert "run the script again" in stderr
    assert stderr.count("\n") == 1


@pytest.mark.usefixtures("without_page")
def test_recording_of_another_version_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
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
    stderr = capsys.readouterr().err
    assert "it was recorded by another version of the program, which can run it again" in stderr
    assert stderr.count("\n") == 1
