"""The residual wrench against the bounds of Hicks et al. (2015)."""

import numpy as np
import pytest

from models.humanoid.skeleton import standing_com
from sim.body.residual import Residual, ResidualMeasure


def test_missed_bounds_of_force_and_moment_rms_and_peak_are_named() -> None:
    weight, height = 700.0, standing_com()
    assert height == pytest.approx(0.56 * 1.75, rel=0.05)  # as of a standing man, de Leva
    measure = ResidualMeasure(weight, height, 0.5)
    measure.add(np.array([[0.049 * weight, 0.0, 0.0, 0.0, 0.009 * weight * height, 0.0]]))
    assert measure.summary().missed() == ()
    assert measure.summary().verdict().endswith("all met")
    measure.add(np.array([[0.0, 0.0, 0.06 * weight, 0.02 * weight * height, 0.0, 0.0]]))
    summary = measure.summary()
    assert summary.seconds == 1.0
    assert summary.force_rms == pytest.approx(np.sqrt((0.049**2 + 0.06**2) / 2))
    assert summary.missed() == ("RMS force", "peak force", "RMS moment", "peak moment")
    assert Residual(1.0, 0.01, 0.06, 0.001, 0.002).missed() == ("peak force",)
    brief = Residual(1.0, 0.01, 0.0504, 0.001, 0.0101).brief()  # a peak that misses its bound is printed beyond it
    assert "1.0 % and 5.04 % of weight" in brief
    assert "0.1 % and 1.01 % of weight ×" in brief
