"""The robot arm: seven joints, plausible link inertias, and motors that hold it outstretched."""

import mujoco
import numpy as np

from models.robot_arm.spec import ARM_JOINTS, arm_lengths, arm_limits, arm_model
from models.world.scene import PHANTOM, ROBOT, SceneConfig, robot_world_model


def test_arm_has_seven_joints_and_is_straight_at_zero():
    model = arm_model()
    assert (model.nq, model.nv, model.nu) == (7, 7, 7)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.site("tool").xpos, [0.0, 0.0, sum(arm_lengths(model))], atol=1e-12)
    assert np.all(arm_limits(model)[:, 0] == -arm_limits(model)[:, 1])


def test_link_inertias_satisfy_the_triangle_inequality_and_links_have_mass():
    model = arm_model()
    for body in range(1, model.nbody):
        a, b, c = np.sort(model.body_inertia[body])
        assert model.body_mass[body] > 0.05 or model.body_subtreemass[body] > 0.05
        assert a + b >= c - 1e-12


def test_motors_hold_the_outstretched_arm_against_gravity():
    model = arm_model()
    data = mujoco.MjData(model)
    data.qpos[1] = np.pi / 2.0
    mujoco.mj_forward(model, data)
    assert np.all(np.abs(data.qfrc_bias) < 0.6 * model.actuator_ctrlrange[:, 1])


def test_robot_world_contains_arm_and_phantom():
    model = robot_world_model(SceneConfig())
    assert model.nv == 8 + 7
    assert all(model.joint(ROBOT + name).id >= 0 for name in ARM_JOINTS)
    assert model.joint(PHANTOM + "theta1").id >= 0
