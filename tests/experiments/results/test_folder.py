"""The folder of a run: foreign files are kept, and concurrent runs refused."""

import fcntl
import os
from pathlib import Path

import pytest

import hvf
from experiments.cli import main
from experiments.results.folder import check_folder, clear_folder
from sim.errors import SimError
from tests.experiments.refused_command import refused


@pytest.mark.parametrize("name", ["config.json", "report.html", "summary.json", "edited.bvh", "figures/mine.tex"])
def test_foreign_files_are_not_replaced_without_overwrite(name: str, tmp_path: Path) -> None:
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_text("mine")
    with pytest.raises(SimError, match=rf"holds {name.split('/')[0]} without a run; choose another --out"):
        check_folder(tmp_path, overwrite=False)
    check_folder(tmp_path, overwrite=True)


def test_figures_and_films_are_removed_only_with_their_run(tmp_path: Path) -> None:
    derived = [tmp_path / "figures" / "path.png", tmp_path / "film.mp4", tmp_path / "film.gif"]
    derived[0].parent.mkdir()
    for file in (*derived, tmp_path / "mine.mp4"):
        file.write_text("mine")
    clear_folder(tmp_path)
    assert all(file.exists() for file in derived)
    (tmp_path / "run.h5").touch()
    clear_folder(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.mp4"]


def test_study_refuses_a_folder_with_other_results(tmp_path: Path) -> None:
    (tmp_path / "summary.json").write_text("mine")
    study = hvf.Study.load("examples/studies/quick.toml")
    with pytest.raises(SimError, match=r"holds summary\.json, not of a study"):
        study.run(tmp_path)
    assert not (tmp_path / "study.sqlite").exists()


@pytest.mark.usefixtures("without_page")
def test_concurrent_run_into_one_folder_is_refused(run_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    descriptor = os.open(run_folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)  # as a run in another process would
        command = ["run", "--figure", "none", "--seconds", "1", "--out", str(run_folder), "--overwrite"]
        assert "another run is being written into it" in refused(command, capsys)
        assert (run_folder / "run.h5").exists()
    finally:
        os.close(descriptor)  # as at the end of a process that crashes
    assert main(command) == 0
