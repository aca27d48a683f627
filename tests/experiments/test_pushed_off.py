"""What is said before a run of a lifted map whose hand pushes: the hand is pushed off its curve, and back."""

from pathlib import Path

import numpy as np
import pytest

from controllers.haptic_map.lifted import Lifted
from controllers.haptic_map.lifting.room import Room
from experiments.config.words import run_config
from experiments.files.map_files import save_map
from experiments.lifting.lift import lift_clips
from experiments.setups import pushed_off
from experiments.setups.setups import map_parts
from experiments.setups.verdict import Verdict
from models.humanoid.skeleton import figure_model
from models.mocap.clip import pose_difference


@pytest.fixture(scope="module")
def lifted() -> Lifted:
    return lift_clips(("squat_dance", "cheer"), Room()).haptic_map


def test_a_hand_is_pushed_out_and_in_and_has_its_clip_between(lifted: Lifted, monkeypatch: pytest.MonkeyPatch) -> None:
    curve = lifted.curve(0)
    shown = pushed_off.toured(lifted, curve).poses
    monkeypatch.setattr(pushed_off, "_PUSHED", 0.0)
    alone = pushed_off.toured(lifted, curve).poses
    apart = np.abs(pose_difference(alone, shown)[:, 6:]).max(axis=1)
    times = np.arange(len(shown)) / 120.0
    assert apart[times < 1.69].max() < 1e-9
    assert apart[(times > 2.1) & (times < 4.7)].min() > 1e-3
    assert apart.max() > 0.05


@pytest.mark.parametrize(
    ("verdict", "said"),
    [
        (Verdict(0.05, np.inf), ()),
        (Verdict(0.2, np.inf), ("pushed off its curve to those beside it, the physical figure lacks 20 % of weight",)),
        (Verdict(0.2, 3.0), ("pushed off its curve to those beside it, the physical figure falls at 3.0 s",)),
    ],
)
def test_what_a_pushed_figure_does_not_follow_is_said(
    verdict: Verdict, said: tuple[str, ...], lifted: Lifted, monkeypatch: pytest.MonkeyPatch
) -> None:
    def tried(*_: object) -> Verdict:
        return verdict

    monkeypatch.setattr(pushed_off, "tried", tried)
    assert pushed_off.not_followed(lifted, lifted.curve(0)) == said


def test_a_curve_plays_its_clip_at_that_clips_pace_and_nobody_is_told_of_a_lap(lifted: Lifted, tmp_path: Path) -> None:
    save_map(lifted, tmp_path / "map.npz")
    parts = map_parts(run_config(map=str(tmp_path / "map.npz"), curve="cheer"), figure_model())
    assert parts.lap_seconds == parts.curve.duration == pytest.approx(lifted.curve(1).duration)
    assert lifted.lap_seconds != pytest.approx(lifted.curve(1).duration, rel=0.01)
