"""The world model: its parts, frames, collisions and rates."""

import mujoco
import numpy as np
import pytest

from models.errors import ModelError
from models.humanoid.skeleton import BODIES, JOINTS, N_POSE, N_TANGENT, rest_pose
from models.phantom.kinematics import R_HP
from models.world.scene import FIGURE, P_WH, PHANTOM, R_WP, SceneConfig, world_model


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return world_model(SceneConfig())


def test_phantom_and_figure_are_in_one_model(model: mujoco.MjModel) -> None:
    assert model.nv == N_TANGENT + 8
    assert model.nq == N_POSE + 8
    assert model.nu == 3 + 51
    for name in (*BODIES,):
        assert model.body(FIGURE + name).id > 0
    for name in JOINTS:
        assert model.joint(FIGURE + name).type[0] == mujoco.mjtJoint.mjJNT_BALL
    for name in ("theta1", "theta2", "theta3"):
        assert model.joint(PHANTOM + name).type[0] == mujoco.mjtJoint.mjJNT_HINGE


def test_hand_frame_origin_is_the_tip_in_the_zero_configuration(model: mujoco.MjModel) -> None:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.site(PHANTOM + "tip").xpos, P_WH, atol=1e-9)
    np.testing.assert_allclose(data.body(PHANTOM + "base").xmat.reshape(3, 3), R_WP, atol=1e-12)


def test_scene_and_kinematics_agree_on_the_rotation_of_the_device_frame() -> None:
    """R_WP of the scene equals R_HP of the kinematics, since the hand frame has the axes of the world."""
    np.testing.assert_array_equal(R_WP, np.array(R_HP))
    np.testing.assert_allclose(R_WP @ R_WP.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(R_WP) == pytest.approx(1.0)


@pytest.mark.parametrize("seed", range(3))
def test_one_second_of_bounded_noise_gives_no_mujoco_warning(model: mujoco.MjModel, seed: int) -> None:
    data = mujoco.MjData(model)
    root = int(model.joint(FIGURE + "root").qposadr[0])
    data.qpos[root : root + N_POSE] = rest_pose()
    mujoco.mj_forward(model, data)
    rng = np.random.default_rng(seed)
    low, high = model.actuator_ctrlrange.T
    for _ in range(round(1.0 / model.opt.timestep / 20)):
        data.ctrl[:] = 0.3 * rng.uniform(low, high)
        mujoco.mj_step(model, data, nstep=20)
    assert [int(warning.number) for warning in data.warning] == [0] * len(data.warning)
    assert np.isfinite(data.qpos).all()


def test_every_enabled_collision_pair_involves_the_floor(model: mujoco.MjModel) -> None:
    """Only the figure collides, with the floor; device and table are visual."""
    floor = model.geom("floor").id
    pairs = [
        (a, b)
        for a in range(model.ngeom)
        for b in range(a + 1, model.ngeom)
        if (model.geom_contype[a] & model.geom_conaffinity[b]) or (model.geom_contype[b] & model.geom_conaffinity[a])
    ]
    assert pairs
    assert all(floor in pair for pair in pairs)


@pytest.mark.parametrize(
    ("period", "step", "message"),
    [
        (1e-3, 3e-4, "does not divide"),
        (1e-3, 2e-3, "expected 0 < physics_step"),
        (1e-3, 0.0, "expected 0 < physics_step"),
        (1e-3, 1e-9, r"into 1e\+06 steps; expected at most 1000, 1e-06 s or more"),
        (1e-3, 1e-300, "expected at most 1000"),
        (-1.0, 1e-3, "expected 0 < physics_step"),
        (float("nan"), 1e-3, "expected 0 < physics_step"),
    ],
)
def test_incompatible_servo_period_and_physics_step_are_refused(period: float, step: float, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        SceneConfig(servo_period=period, physics_step=step).substeps()


def test_physics_step_that_divides_up_to_rounding_is_accepted() -> None:
    assert SceneConfig(servo_period=1e-3, physics_step=1e-3 / 3).substeps() == 3
