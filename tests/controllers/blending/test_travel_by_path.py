"""Travel integrates drift over the hand's path: moving aside changes the walking speed, not the position."""

import numpy as np
import pytest

from controllers.blending.combination import fresh_lap
from controllers.motion.lap import LAP_HEADING, LAP_X, LAP_Y, update_lap
from tests.controllers.clips_for_maps import stylus
from tests.controllers.example_maps import CYLINDRICAL, LIFTED

TURN = 2.0 * np.pi


def travelled(path):
    """Final x, y and heading of the figure after a path of pairs (angle, drift (3,))."""
    memory = fresh_lap()
    for angle, drift in path:
        update_lap(memory, np.mod(angle, TURN), drift)
    s, (x, y, turn) = np.mod(path[-1][0], TURN) / TURN, path[-1][1]
    assert turn == 0.0
    c, n = np.cos(memory[LAP_HEADING]), np.sin(memory[LAP_HEADING])
    return np.array([memory[LAP_X] + s * (c * x - n * y), memory[LAP_Y] + s * (n * x + c * y), memory[LAP_HEADING]])


def test_travel_is_the_integral_of_drift_over_the_path():
    angles = np.linspace(0.2, 15.0, 3000)
    drifts = np.column_stack([1.0 + np.sin(0.7 * angles), 0.3 * np.cos(angles), 0.0 * angles])
    expected = np.trapezoid(drifts, angles / TURN, axis=0) + 0.2 / TURN * drifts[0]
    np.testing.assert_allclose(travelled(list(zip(angles, drifts, strict=True))), expected, atol=1e-9)


def test_returning_along_the_path_restores_the_position():
    angles = np.concatenate([np.linspace(0.2, 9.0, 900), np.linspace(9.0, 0.2, 900)])
    drifts = np.column_stack([1.0 + np.sin(0.7 * angles), 0.3 * np.cos(angles), 0.0 * angles])
    np.testing.assert_allclose(
        travelled(list(zip(angles, drifts, strict=True)))[:2], 0.2 / TURN * drifts[0, :2], atol=1e-9
    )


def test_constant_turning_drift_accumulates_heading():
    memory, drift = fresh_lap(), np.array([0.4, 0.1, 1.0])
    for angle in np.mod(np.linspace(0.1, 4.0 * TURN + 0.1, 400), TURN):
        update_lap(memory, angle, drift)
    assert memory[LAP_HEADING] == pytest.approx(4.0)


@pytest.mark.parametrize(("haptic_map", "middle"), [(LIFTED, 0.05), (CYLINDRICAL, 0.045)])
def test_radial_hand_motion_late_in_a_lap_barely_moves_the_figure(haptic_map, middle):
    memory, angle = haptic_map.compiled().memory, 5.8
    stylus_poses = [
        stylus(middle + 0.008 * np.sin(s), angle, 0.006 * np.sin(s)) for s in np.linspace(0.0, 0.5 * np.pi, 200)
    ]
    with_memory = np.array([haptic_map.pose(x, memory)[:2] for x in stylus_poses])
    without_memory = np.array([haptic_map.pose(x)[:2] for x in stylus_poses])
    displacement_without_memory, displacement = (np.linalg.norm(p[-1] - p[0]) for p in (without_memory, with_memory))
    assert displacement_without_memory > 0.1
    assert displacement < 0.35 * displacement_without_memory
