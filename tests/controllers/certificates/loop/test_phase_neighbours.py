"""Differences of a quantity between neighbouring phases of a curve."""

import numpy as np

from controllers.certificates.loop.stability import neighbours


def test_last_phase_of_closed_curve_neighbours_the_first():
    here, following = neighbours(np.array([[1.0, 2.0, 7.0]]), periodic=True)
    assert np.abs(following - here).max() == 6.0
    here, following = neighbours(np.array([[1.0, 2.0, 7.0]]), periodic=False)
    assert np.abs(following - here).max() == 5.0
