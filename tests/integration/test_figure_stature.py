"""A figure of another stature moves in proportion, and so do its files."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.cli import main
from experiments.config.options import run_config
from experiments.setups.modes.lead import walker_argument
from experiments.setups.parts.led_figure import led_map
from experiments.setups.wiring import wire
from geometry.arrays import Array
from models.humanoid.skeleton import figure_model
from models.mocap.library import embedded, load_clip
from models.mocap.readers.formats import read_motion
from sim.loop.loop import Loop

SMALL, SIZE = 1.4, 0.8


def animation(**words: Any) -> Array:
    """References of a run with a kinematic figure, shape (n, 75)."""
    references: list[Array] = []
    session = wire(run_config(figure="kinematic", **words))
    keep = lambda ticks, frames, n: references.append(frames.reference[: -(-n // 2)].copy())  # noqa: E731
    Loop(session.servo, session.world, keep).run(words["seconds"])
    return np.concatenate(references)


def test_motion_scales_with_stature() -> None:
    default, small = (animation(seconds=1.0, clips=("walk",), stature=stature) for stature in (1.75, SMALL))
    np.testing.assert_allclose(small[:, :3], SIZE * default[:, :3], atol=1e-12)
    np.testing.assert_array_equal(small[:, 3:], default[:, 3:])


@pytest.mark.slow
@pytest.mark.parametrize("stature", [1.75, SMALL])
def test_expressive_rivers_move_the_root_continuously(stature: float) -> None:
    words = {"mode": "rivers", "map": "rivers", "user": "push", "clips": ("walk", "cheer", "run")}
    poses = animation(seconds=3.0, expressive=True, stature=stature, **words)
    assert np.linalg.norm(np.diff(poses[:, :2], axis=0), axis=1).max() * 500.0 < 4.0


def test_stride_of_led_figure_scales_with_stature() -> None:
    walk = embedded("walk")
    (default, gait), (small, shorter) = (led_map(walk, figure_model(stature)) for stature in (1.75, SMALL))
    assert shorter.stride == pytest.approx(SIZE * gait.stride)
    start = walker_argument(np.zeros(1))[0]
    assert small.pose(start)[2] == pytest.approx(SIZE * default.pose(start)[2], abs=1e-3)


@pytest.mark.usefixtures("without_page")
def test_bvh_offsets_scale_with_stature_and_poses_are_equal(tmp_path: Path) -> None:
    poses = []
    for stature in (1.75, SMALL):
        out = tmp_path / f"{stature}"
        words = f"run --figure kinematic --clips walk --seconds 0.5 --stature {stature} --out {out}"
        assert main(words.split()) == 0
        poses.append(load_clip(out / "edited.bvh").poses)
    default, small = (read_motion(tmp_path / f"{stature}" / "edited.bvh").offsets for stature in (1.75, SMALL))
    np.testing.assert_allclose(small[1:], SIZE * default[1:], atol=2e-6)
    np.testing.assert_allclose(poses[1], poses[0], atol=1e-7)
