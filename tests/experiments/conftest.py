from pathlib import Path

import pytest

from experiments.cli import main


@pytest.fixture(scope="session")
def run_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a run of 1 s without figure and page, shared by tests that only read it."""
    out = tmp_path_factory.mktemp("runs") / "run"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("experiments.results.pages.report.write_report_of", lambda folder: None)
        assert main(["run", "--figure", "none", "--seconds", "1", "--out", str(out)]) == 0
    return out
