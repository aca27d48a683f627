"""What a refined map says before a run."""

from dataclasses import replace

from experiments.config.words import run_config
from experiments.setups.setups import map_parts
from models.humanoid.skeleton import figure_model


def test_how_a_physical_figure_follows_is_said_of_a_physical_figure_only() -> None:
    parts = map_parts(run_config(clips=("walk",), seconds=1.0), figure_model())
    falls = replace(parts, refined=lambda: (parts.haptic_map, ("the physical figure falls",)))
    assert falls.refine(physical=True).remarks == (*parts.remarks, "the physical figure falls")
    assert falls.refine(physical=False).remarks == parts.remarks
