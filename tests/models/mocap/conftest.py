import pytest

from tests.captures import MOCAP


@pytest.fixture(scope="session")
def mocap():
    """Folder of real motion capture beside the project; tests that need it are skipped where it is absent."""
    if not MOCAP.is_dir():
        pytest.skip("no motion capture at ../shared/mocap")
    return MOCAP
