from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def mocap():
    """Folder of real motion capture beside the project; tests that need it are skipped where it is absent."""
    folder = Path(__file__).resolve().parents[3].parent / "shared" / "mocap"
    if not folder.is_dir():
        pytest.skip(f"no motion capture in {folder.parent.name}/{folder.name} beside the project")
    return folder
