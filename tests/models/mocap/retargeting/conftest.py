import re

import numpy as np
import pytest

from models.errors import ModelError
from models.mocap.library import load
from models.mocap.retargeting import retarget
from models.mocap.retargeting.hints import Hints
from tests.models.mocap.retargeting.rig_comparison import CalibratedMotion, Motions, deviation_of
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


@pytest.fixture(scope="module")
def motions():
    return Motions()


@pytest.fixture
def load_calibrated(monkeypatch):
    """A function that loads a file as a CalibratedMotion."""
    on_the_floor, seen = retarget.put_on_floor, {}

    def spy(root, segments, *more):
        seen["found"] = (root, segments)
        return on_the_floor(root, segments, *more)

    monkeypatch.setattr(retarget, "put_on_floor", spy)

    def read(path, hints=None):
        clip, report, _ = load(path, hints)
        return CalibratedMotion(*seen["found"], clip, "; ".join(report.remarks))

    return read


@pytest.fixture(scope="module")
def plain_motions():
    """Cache of motions from plain rigs."""
    return {}


@pytest.fixture
def compare(load_calibrated, plain_motions, tmp_path):
    """A function that gives the deviation of a rig's motion, or the reason for which it is refused."""

    def deviation(rig, clip):
        write_rig(rig, clip, tmp_path / "r.bvh")
        try:
            ours = load_calibrated(tmp_path / "r.bvh")
        except ModelError as error:
            return str(error)
        plain_rig = Rig(without=rig.without, tips=None if rig.tips is None else 0.0)
        key = clip.name, clip.fps, clip.n_frames, plain_rig.without, plain_rig.tips
        if key not in plain_motions:
            write_rig(plain_rig, clip, tmp_path / "plain.bvh")
            # The up axis of a plain rig is known, so that a wrongly inferred one is a deviation.
            plain_motions[key] = load_calibrated(tmp_path / "plain.bvh", Hints(up="+Y"))
        return deviation_of(ours, plain_motions[key], clip)

    return deviation
