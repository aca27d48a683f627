"""Soles of feet that stand throughout: level, however bent the ankle is, unless their toes say that the heel is up."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from models.mocap.retargeting.sole_calibration import calibrated_foot

UP = np.array([0.0, 0.0, 1.0])


@pytest.mark.parametrize(("lean", "beneath", "level"), [(0.0, 21.0, True), (50.0, 33.0, True), (50.0, 60.0, False)])
def test_in_a_lunge_the_toes_tell_whether_the_heel_is_down(lean: float, beneath: float, level: bool) -> None:
    n = 40
    source = np.tile([1.0, 0.0, 0.0, 0.0], (n, 1))
    toes = np.tile([np.cos(np.deg2rad(beneath)), 0.0, -np.sin(np.deg2rad(beneath))], (n, 1))
    shank = np.tile(Rotation.from_euler("y", lean, degrees=True).as_quat(scalar_first=True), (n, 1))
    turned, used = calibrated_foot(source, toes, shank, UP, np.arange(n), np.ones(n))
    normal = Rotation.from_quat(turned, scalar_first=True).apply(UP)[0]
    assert used == (n if level else 0)
    assert (normal @ UP > 0.9999) == level
