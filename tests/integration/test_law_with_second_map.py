"""A law may read another haptic map than the one that the figure follows."""

import numpy as np
import pytest

import hvf
from controllers.fields.soft_wall import SoftWall
from experiments.setups.maps.robot_arm import robot_arm_map
from models.robot_arm.spec import arm_model


@pytest.mark.parametrize("figure", ["kinematic", "none"])
def test_robot_arm_wall_acts_besides_a_clip_map(figure: str) -> None:
    curve = hvf.circle(lap=2.0)
    clips = hvf.Cylindrical(hvf.clips("walk", "cheer"), around=curve)
    elbow = np.array([[-0.05, 0.4]])
    wall = SoftWall(robot_arm_map(arm_model(), 1.5), (1,), (1,), (elbow,), 5.0, 0.05, 0.05, 5.0)
    river = hvf.Follow(curve, k_r=300, b_d=8)
    with_wall, without = (
        hvf.Simulation(field=field, haptic_map=clips, figure=hvf.Figure(kind=figure), seed=1).run(0.1).ticks
        for field in (river + wall, river)
    )
    hand = hvf.HandState(0.0, without["p"][0], without["quaternion"][0], without["v"][0], without["omega"][0])
    added = wall.wrench(hand).force
    assert np.linalg.norm(added) > 1.0
    np.testing.assert_allclose(with_wall["field"][0, :3] - without["field"][0, :3], added, rtol=1e-9)
