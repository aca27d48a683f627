"""Remarks of a refined map before a run."""

from dataclasses import replace

import pytest

from experiments.config.options import run_config
from experiments.fitting.animation_trial import AnimationTrial
from experiments.preparation.followed import Followed
from experiments.setups.setups import map_parts
from models.humanoid.skeleton import figure_model
from models.mocap.library import embedded


def test_tracking_remarks_only_for_a_physical_figure() -> None:
    parts = map_parts(run_config(clips=("walk",), seconds=1.0), figure_model())
    falls = replace(parts, refined=lambda: (parts.haptic_map, ("the physical figure falls",)))
    assert falls.refine(physical=True).remarks == (*parts.remarks, "the physical figure falls")
    assert falls.refine(physical=False).remarks == parts.remarks


def test_single_clip_off_its_pace_is_tried_and_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    """The run has flights; 2.2 s and 1.47 s are whole numbers of its strides, 1.8 s is off both by 20 %."""
    monkeypatch.setattr(AnimationTrial, "followed", lambda _: Followed(0.2, 1.5))
    own = embedded("run").duration
    for lap, remarks in ((own, ()), (1.8, ("the physical figure falls at 1.5 s with run at this lap",))):
        parts = map_parts(run_config(clips=("run",) * 4, lap=lap, seconds=1.0), figure_model())
        assert parts.refine(physical=True).remarks[len(parts.remarks) :] == remarks
