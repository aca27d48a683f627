"""Stops of the figure's ball joints against the limits of its joints."""

import numpy as np
import pytest

from models.humanoid.skeleton import JOINTS, figure_model, joint_range


def test_ball_joint_stops_lie_at_the_corner_of_the_joint_limits() -> None:
    model, limits = figure_model(), joint_range()
    ankle = JOINTS.index("left_ankle")
    assert model.jnt_limited[1 + ankle]
    assert model.jnt_range[1 + ankle, 1] == pytest.approx(np.linalg.norm(np.abs(limits[ankle]).max(axis=1)))
    # No pose within the limits is beyond a stop.
    rng = np.random.default_rng(0)
    vectors = limits[..., 0] + rng.random((500, 17, 3)) * (limits[..., 1] - limits[..., 0])
    stops = np.where(model.jnt_limited[1:] == 1, model.jnt_range[1:, 1], np.inf)
    assert np.all(np.linalg.norm(vectors, axis=2) <= stops)
