"""Hands that go from walk to run on a lifted map, or stay between them, begun at any angle of the lap."""

import numpy as np
import pytest

from controllers.haptic_map.lifted import Lifted
from controllers.haptic_map.lifting.room import Room
from experiments.lifting.lift import lift_clips
from experiments.studies.gait_changes import changed, held

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def haptic_map() -> Lifted:
    return lift_clips(["walk", "run"], Room()).haptic_map


@pytest.mark.parametrize("curves", [(0, 1), (1, 0)], ids=["walk to run", "run to walk"])
def test_figure_stands_when_the_pace_changes_within_a_second_whatever_the_phase(
    haptic_map: Lifted, curves: tuple[int, int]
) -> None:
    # A sixth of a lap is a step of one of the two feet.
    for begin in np.deg2rad([0.0, 15.0, 30.0, 45.0]):
        verdict = changed(haptic_map, curves, begin, (0.35, 1.0))
        assert verdict.fell is None
        # 0.09 to 0.25; a figure carried by the residual has 1.
        assert verdict.residual < 0.4


def test_figure_keeps_the_gait_half_way_between_walk_and_run(haptic_map: Lifted) -> None:
    verdict = held(haptic_map, (0, 1), 0.5)
    assert verdict.fell is None
    assert verdict.residual < 0.2
