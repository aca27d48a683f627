"""Real motion capture beside the project: its folder, and a mark that skips tests where it is absent."""

from pathlib import Path

import pytest

MOCAP = Path(__file__).resolve().parents[2] / "shared" / "mocap"
needs_mocap = pytest.mark.skipif(not MOCAP.is_dir(), reason="no motion capture at ../shared/mocap")
