"""Golden trajectories of a mass, pushed once, for each mode that is a field over a fixed curve.

``python tests/golden/test_golden_fields.py`` rewrites the file after an intended change of a law.
"""

from pathlib import Path

import numpy as np
import pytest
from numba import njit

from controllers.curves.trajectory import Trajectory
from controllers.fields.algebra.program import evaluate
from controllers.fields.edited import Edited, performance
from controllers.fields.river import River
from experiments.config.options import run_config
from experiments.setups.setups import map_parts, parts_of
from models.humanoid.skeleton import figure_model

GOLDEN = Path(__file__).with_name("fields.csv")
CURVE = Trajectory.circle(0.0477, 4.0)
MODES = ("follow", "bunny", "rivers discrete", "rivers smooth", "rivers sum", "edited")


# Explicit, so that the golden paths do not depend on defaults.
PARAMETERS = {
    "follow": {"stiffness": 300.0, "damping": 4.0, "tube": 0.25},
    "bunny": {
        "stiffness": 300.0, "damping": 4.0, "bunny_width": 0.02, "bunny_attraction": "point", "bunny_pace": "wait",
    },
    "rivers": {"stiffness": 150.0, "damping": 16.0, "river_tube": 0.015},
}  # fmt: skip


@njit
def _glide(units, ops, params, memory, push, path):
    hand, wrench, p, v = np.zeros(15), np.zeros(6), path[0].copy(), np.zeros(3)
    hand[4] = 1.0
    for k in range(10 * len(path)):
        if k % 10 == 0:
            path[k // 10] = p
        hand[0], hand[1:4], hand[8:11] = k * 1e-3, p, v
        evaluate(units, ops, params, memory, hand, wrench)
        v += 1e-2 * (wrench[:3] + push[k])
        p += 1e-3 * v


def _field(mode):
    if mode == "edited":
        times = np.linspace(0.0, 4.0, 401)
        scale = 1.0 + 0.2 * np.sin(np.pi * np.clip(times - 1.0, 0.0, 1.0)) ** 2
        performed = performance(times, CURVE.point(times) * scale[:, None])
        return Edited(River(CURVE, 0.04), (performed,), (1.0,))
    name, _, crossing = mode.partition(" ")
    parameters = PARAMETERS[name] | ({"crossing": crossing} if crossing else {})
    config = run_config(name, "composite", radius=0.0477, lap=4.0, reach=0.025, **parameters)
    return parts_of(config, map_parts(config, figure_model())).field


def _trajectory(mode):
    """Positions every 10 ms for 3 s, from rest 2 mm beside the curve, pushed for 0.3 s."""
    program, push, path = _field(mode).program(), np.zeros((3000, 3)), np.zeros((300, 3))
    push[1300:1500] = [0.0, 0.05, 0.1]
    # Away from where rivers meet, since there the smooth field is sensitive to rounding.
    path[0] = CURVE.point(0.25) + np.array([0.002, 0.0, 0.001])
    _glide(*program.compiled(), program.fresh_memory(), push, path)
    return path


@pytest.mark.parametrize("mode", MODES)
def test_field_trajectories_match_golden_values(mode):
    rows = np.loadtxt(GOLDEN, delimiter=",", skiprows=1)
    golden = rows[:, 3 * MODES.index(mode) : 3 * MODES.index(mode) + 3]
    path = _trajectory(mode)
    # Rounding differs between machines, and attracting fields hardly amplify it: 1 nm becomes 2 nm.
    np.testing.assert_allclose(path, golden, atol=1e-8)
    assert np.ptp(path, axis=0).max() > 0.05


if __name__ == "__main__":
    header = ",".join(f"{mode} {axis}" for mode in MODES for axis in "xyz")
    np.savetxt(GOLDEN, np.hstack([_trajectory(mode) for mode in MODES]), fmt="%.12g", delimiter=",", header=header)
