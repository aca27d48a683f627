"""The folder of a run: what is not of a run stays as it is."""

from pathlib import Path

import pytest

import hvf
from experiments.results.folder import check_folder, clear_folder
from sim.errors import SimError


@pytest.mark.parametrize("name", ["config.json", "report.html", "summary.json", "edited.bvh", "figures/mine.tex"])
def test_files_of_somebody_else_are_not_replaced_unasked(name: str, tmp_path: Path) -> None:
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_text("mine")
    with pytest.raises(SimError, match=rf"holds {name.split('/')[0]} without a run; choose another --out"):
        check_folder(tmp_path, overwrite=False)
    check_folder(tmp_path, overwrite=True)


def test_a_folder_of_figures_goes_with_its_run_alone(tmp_path: Path) -> None:
    figures = tmp_path / "figures"
    figures.mkdir()
    (figures / "mine.tex").write_text("mine")
    clear_folder(tmp_path)
    assert (figures / "mine.tex").exists()
    (tmp_path / "run.h5").touch()
    clear_folder(tmp_path)
    assert not figures.exists()


def test_a_study_does_not_go_into_a_folder_with_other_results(tmp_path: Path) -> None:
    (tmp_path / "summary.json").write_text("mine")
    study = hvf.Study.load("examples/studies/quick.toml")
    with pytest.raises(SimError, match=r"holds summary\.json, not of a study"):
        study.run(tmp_path)
    assert not (tmp_path / "study.sqlite").exists()
