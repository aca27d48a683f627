"""The camera's heading of a film."""

import numpy as np
import pytest

from experiments.render.timeline import _averaged_heading


@pytest.mark.parametrize("frames", [1, 2, 90])
def test_heading_of_turned_standing_figure_in_degrees(frames: int) -> None:
    quarter = np.tile([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)], (frames, 1))
    np.testing.assert_allclose(_averaged_heading(quarter, 30.0), 90.0)


def test_heading_of_pirouette_is_its_initial_heading() -> None:
    half = np.pi * np.arange(90) / 30.0
    spins = np.stack((np.cos(half), 0.0 * half, 0.0 * half, np.sin(half)), axis=1)  # once round a second
    np.testing.assert_allclose(_averaged_heading(spins, 30.0), 0.0, atol=1e-12)
