"""The edited field V + U of a run on the simulated Phantom: its integral curve is the performed motion."""

import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from controllers.fields.edited import Edited, performance
from controllers.fields.river import River, integrate
from experiments.config.options import run_config
from sim.users.hand.actions import Push
from tests.loop_with_law import loop_with

CURVE = Trajectory.circle(0.0477, 4.0)


@pytest.mark.parametrize("direction", [(0.0, 0.0, 1.0), (0.6, -0.8, 0.2), (-1.0, 0.3, -0.5)])
def test_edited_field_reproduces_a_push_on_the_phantom(direction):
    river = River(CURVE, 0.08, 4.0 / 300.0, 4.0)
    config = run_config(clips=("cheer", "angry"), seconds=1.4, pushes=(Push(0.4, 0.5, 3.0, direction),))
    rows = []
    _, loop = loop_with(config, river.program(), lambda ticks, frames, n: rows.append(ticks.hand[:n, :4].copy()))
    loop.run(config.seconds)
    t, p = np.split(np.concatenate(rows), [1], axis=1)
    pushed = np.linalg.norm(p - CURVE.point(t[:, 0]), axis=1).max()
    assert pushed > 4e-3
    edited = Edited(river, (performance(t[:, 0], p),), (1.0,))
    points = integrate(edited.flow, edited.performed[0].point(0.0), t[::17, 0])
    assert np.sqrt(np.mean(np.sum((points - p[::17]) ** 2, axis=1))) < 1e-4
