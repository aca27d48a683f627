"""Laps without their closing frame get it; motions that end elsewhere, and laps that have it, do not."""

import numpy as np
import pytest

from models.mocap.library import embedded, load
from models.mocap.motion.clip import Clip, PlanarDisplacement
from models.mocap.preparation.closing_frame import with_closing_frame
from models.mocap.preparation.prepare import prepared
from tests.models.mocap.retargeting.rigs import Rig, write_rig


def _lap(name: str, turn: float = 0.0) -> Clip:
    """A lap at 30 frames a second that turns evenly by an angle [rad], its closing frame included."""
    clip = embedded(name)
    frames = np.linspace(0, clip.n_frames - 1, round(30.0 * clip.duration) + 1).round().astype(int)
    shares = np.linspace(0.0, turn, len(frames))
    moved = [PlanarDisplacement(0.0, 0.0, a).moved(clip.poses[k]) for a, k in zip(shares, frames, strict=True)]
    return Clip(np.array(moved), 30.0, name)


@pytest.mark.parametrize(("name", "turn"), [("walk", 0.0), ("walk", 0.5), ("run", 0.0)])
def test_lap_without_its_closing_frame_gets_it(name, turn):
    lap = _lap(name, turn)
    completed = with_closing_frame(Clip(lap.poses[:-1], lap.fps, name))
    assert completed.n_frames == lap.n_frames
    assert completed.closes(1e-9)
    np.testing.assert_allclose(completed.poses[-1, :2], lap.poses[-1, :2], atol=0.03)
    assert completed.displacement.yaw == pytest.approx(lap.displacement.yaw, abs=np.deg2rad(1.5))


@pytest.mark.parametrize("left_out", [0, 3, 20])
def test_other_motions_are_left_as_they_are(left_out):
    lap = _lap("walk")
    part = Clip(lap.poses[: lap.n_frames - left_out], lap.fps, "walk")
    assert with_closing_frame(part) is part
    still = Clip(np.repeat(lap.poses[:1], 30, axis=0), 30.0, "still")
    assert with_closing_frame(still) is still


@pytest.mark.slow
def test_file_that_lacks_it_is_prepared_as_one_cycle_and_says_so(tmp_path):
    lap = _lap("walk")
    write_rig(Rig(), Clip(lap.poses[:-1], lap.fps, "walk"), tmp_path / "r.bvh")
    made = prepared(tmp_path / "r.bvh")
    assert made.looped.kind == "cycle"
    assert made.looped.end - made.looped.start == pytest.approx(lap.duration, abs=0.02)
    assert any("its closing frame: it is appended" in line for line in made.report.remarks)
    assert len(load(tmp_path / "r.bvh").clip.poses) == made.captured.n_frames - 1
