"""A run that begins in motion: stylus and figure move from the first moment as they are told to."""

import mujoco
import numpy as np
import pytest

from models.humanoid.skeleton import N_TANGENT, rest_pose
from models.scene import FIGURE, PHANTOM
from sim.devices.phantom_port import phantom_port, true_motion
from sim.world import World


@pytest.mark.parametrize("v_H", [(0.1, 0.0, 0.0), (-0.05, 0.12, 0.03)])
def test_the_stylus_has_the_velocity_that_it_was_given(v_H):
    world, p = World(), np.array([0.03, -0.02, 0.02])
    world.reset(p, rest_pose(), None, np.array(v_H))
    port = phantom_port(world.model, world.data, 0.001, 150.0)
    place, velocity = np.empty(3), np.empty(3)
    true_motion(port, place, velocity, np.empty((3, 3)))
    np.testing.assert_allclose(place, p, atol=1e-12)
    np.testing.assert_allclose(velocity, v_H, atol=1e-12)
    # The loop of the linkage moves with it, or MuJoCo's constraint would pull at once.
    rate = {name: world.data.qvel[world.model.joint(PHANTOM + name).dofadr[0]] for name in ("theta2", "theta3")}
    for name, sign in (("elbow", 1.0), ("twin", -1.0)):
        got = world.data.qvel[world.model.joint(PHANTOM + name).dofadr[0]]
        assert got == pytest.approx(sign * (rate["theta3"] - rate["theta2"]), abs=1e-15)


def test_the_figure_has_its_velocity_and_after_a_step_has_gone_on_by_it():
    world, rng = World(), np.random.default_rng(2)
    velocity = rng.normal(scale=0.1, size=N_TANGENT)
    pose = rest_pose()
    pose[2] += 1.0
    world.reset(np.array([0.03, 0.0, 0.0]), pose, None, None, velocity)
    root = world.model.joint(FIGURE + "root")
    first = int(root.qposadr[0])
    mujoco.mj_step(world.model, world.data)
    moved = np.empty(N_TANGENT)
    mujoco.mj_differentiatePos(
        world.figure, moved, world.model.opt.timestep, pose, world.data.qpos[first : first + len(pose)].copy()
    )
    # Gravity and passive joints change it by no more than a step's share.
    np.testing.assert_allclose(moved[:3], velocity[:3], atol=2e-2)
    assert np.corrcoef(moved, velocity)[0, 1] > 0.9


def test_without_velocities_both_rest():
    world = World()
    world.reset(np.array([0.03, 0.0, 0.0]), rest_pose())
    assert not world.data.qvel.any()
