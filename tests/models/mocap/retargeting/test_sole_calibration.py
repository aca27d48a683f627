"""Soles of standing feet are levelled at any ankle angle, unless the toes show a raised heel."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from models.mocap.retargeting.sole_calibration import calibrated_foot

UP = np.array([0.0, 0.0, 1.0])


@pytest.mark.parametrize(("lean", "toe_slope", "level"), [(0.0, 21.0, True), (50.0, 33.0, True), (50.0, 60.0, False)])
def test_sole_in_a_lunge_is_levelled_unless_the_toes_show_a_raised_heel(
    lean: float, toe_slope: float, level: bool
) -> None:
    n = 40
    source = np.tile([1.0, 0.0, 0.0, 0.0], (n, 1))
    toes = np.tile([np.cos(np.deg2rad(toe_slope)), 0.0, -np.sin(np.deg2rad(toe_slope))], (n, 1))
    shank = np.tile(Rotation.from_euler("y", lean, degrees=True).as_quat(scalar_first=True), (n, 1))
    calibrated, n_used, *_ = calibrated_foot(source, toes, shank, UP, np.arange(n), np.ones(n))
    normal = Rotation.from_quat(calibrated, scalar_first=True).apply(UP)[0]
    assert n_used == (n if level else 0)
    assert (normal @ UP > 0.9999) == level
