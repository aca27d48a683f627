import re

import numpy as np
import pytest

from models.mocap.library import load
from tests.models.mocap.retargeting.rigs import Rig, at_rate, write_rig


@pytest.fixture
def walk_rows(tmp_path):
    """Motion rows of a walk's BVH file at 30 frames per second, and a function that loads a file with changed rows."""
    write_rig(Rig(), at_rate("walk", 30.0), tmp_path / "r.bvh")
    head, rows = (tmp_path / "r.bvh").read_text().split("Frame Time: ")
    seconds, *rows = rows.strip().splitlines()
    table = np.array([row.split() for row in rows], dtype=float)

    def load_rows(rows):
        text = "\n".join(" ".join(map(str, row)) for row in rows)
        counted = re.sub(r"Frames: \d+", f"Frames: {len(rows)}", head)
        (tmp_path / "b.bvh").write_text(f"{counted}Frame Time: {seconds}\n{text}\n")
        return load(tmp_path / "b.bvh")

    return table, load_rows
