import warnings

import mujoco
import numpy as np
import pytest

from models.phantom.dynamics import gravity_torques
from models.phantom.kinematics import R_HP, forward_kinematics, joint_torques, linkage_angles
from models.phantom.parameters import PREMIUM_1_5
from models.phantom.spec import GIMBAL_JOINTS, LINKAGE_JOINTS, MOTOR_JOINTS, MOTORS, phantom_spec


def _loop_gap(data):
    return np.linalg.norm(data.site("a_at_c").xpos - data.site("c_at_a").xpos)


def test_motor_torques_give_the_specified_continuous_and_peak_tip_force(linkage):
    assert np.array(PREMIUM_1_5.continuous_torque)[1] / PREMIUM_1_5.l1 == pytest.approx(1.5, abs=0.02)
    assert np.array(PREMIUM_1_5.peak_torque)[2] / PREMIUM_1_5.l2 == pytest.approx(8.5, abs=0.02)
    for motor, joint, peak in zip(MOTORS, MOTOR_JOINTS, PREMIUM_1_5.peak_torque, strict=True):
        actuator = linkage.model.actuator(motor)
        assert actuator.trnid[0] == linkage.model.joint(joint).id
        assert actuator.ctrlrange == pytest.approx([-peak, peak])


def test_bar_inertias_satisfy_the_triangle_inequality(linkage):
    for name in ("turret", "be", "df", "a", "c"):
        xx, yy, zz = linkage.model.body(name).inertia
        assert xx <= yy + zz
        assert yy <= xx + zz
        assert zz <= xx + yy


def test_device_geoms_have_no_collisions(linkage):
    assert not linkage.model.geom_contype.any()
    assert not linkage.model.geom_conaffinity.any()


def test_parallelogram_closes_in_every_configuration(linkage, configurations):
    for theta in configurations[:200]:
        data = linkage.place(theta)
        assert _loop_gap(data) < 1e-12
        assert [data.joint(name).qpos[0] for name in LINKAGE_JOINTS] == list(linkage_angles(theta))


@pytest.mark.parametrize("step", [1e-3, *(pytest.param(step, marks=pytest.mark.slow) for step in (5e-4, 2.5e-4))])
def test_loop_gap_stays_below_1_um_in_a_minute_of_driven_motion_under_8_n(linkage, step):
    model, data = linkage.model, linkage.data
    model.opt.timestep = step
    stylus = model.body("stylus").id
    target = np.empty(3)
    largest_gap, path = 0.0, []
    for tick in range(round(60.0 / step)):
        t = tick * step
        target[:] = 0.6 * np.sin(4.4 * t), 0.4 + 0.5 * np.sin(5.7 * t + 1), 0.5 + 0.5 * np.sin(6.9 * t)
        data.ctrl[:] = 6.0 * (target - linkage.theta()) - 0.06 * linkage.theta_dot()
        angle, azimuth = 3.1 * t, 1.7 * t
        sine = np.sin(angle)
        data.xfrc_applied[stylus, :3] = 8.0 * sine * np.cos(azimuth), 8.0 * np.cos(angle), 8.0 * sine * np.sin(azimuth)
        mujoco.mj_step(model, data)
        largest_gap = max(largest_gap, _loop_gap(data))
        if tick % 100 == 0:
            path.append(data.site("tip").xpos.copy())
    assert (np.ptp(path, axis=0) > 0.15).all(), "it is driven"
    assert largest_gap < 1e-6
    assert not data.warning.number.any()


def test_tip_position_matches_closed_form_kinematics_under_load(linkage):
    linkage.model.opt.timestep = 5e-4
    linkage.data.ctrl[:] = 0.05, 0.08, -0.03
    for _ in range(400):
        mujoco.mj_step(linkage.model, linkage.data)
    mujoco.mj_forward(linkage.model, linkage.data)
    assert np.abs(linkage.theta()).max() > 0.05
    assert np.abs(linkage.data.site("tip").xpos - forward_kinematics(linkage.theta())).max() < 1e-6


@pytest.mark.parametrize("direction", np.eye(3))
def test_backdrive_friction_holds_0_03_n_and_yields_to_0_06_n(linkage, direction):
    moved = []
    for force in (0.03, 0.06):
        mujoco.mj_resetData(linkage.model, linkage.data)
        linkage.model.opt.timestep = 5e-4
        linkage.data.ctrl[:] = np.add(gravity_torques(np.zeros(3)), joint_torques(np.zeros(3), force * direction))
        for _ in range(400):
            mujoco.mj_step(linkage.model, linkage.data)
        moved.append(np.linalg.norm(linkage.data.site("tip").xpos))
    assert moved[0] < 1e-5
    assert moved[1] > 1e-3


@pytest.mark.parametrize("motor", range(3))
@pytest.mark.parametrize("side", [-1, 1])
def test_joint_stops_hold_the_continuous_torque(linkage, motor, side):
    linkage.model.opt.timestep = 5e-4
    linkage.data.ctrl[motor] = side * PREMIUM_1_5.continuous_torque[motor]
    for _ in range(2000):
        mujoco.mj_step(linkage.model, linkage.data)
    theta = linkage.theta()
    low, high = np.array(PREMIUM_1_5.limit).T
    elbow_low, elbow_high = PREMIUM_1_5.elbow_limit
    slack = np.deg2rad(1.0)
    assert (theta > low - slack).all()
    assert (theta < high + slack).all()
    assert elbow_low - slack < theta[2] - theta[1] < elbow_high + slack


def test_gravity_torques_match_the_closed_form_when_attached_upright_in_a_world():
    world = mujoco.MjSpec()
    q_WP = np.empty(4)
    mujoco.mju_mat2Quat(q_WP, np.array(R_HP).ravel())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        world.attach(phantom_spec(), prefix="phantom/", frame=world.worldbody.add_frame(pos=[0.2, -1, 1], quat=q_WP))
        model = world.compile()
    data = mujoco.MjData(model)
    data.joint("phantom/theta2").qpos, data.joint("phantom/elbow").qpos, data.joint("phantom/twin").qpos = (
        0.3,
        -0.3,
        0.3,
    )
    mujoco.mj_forward(model, data)
    bias = [data.joint(f"phantom/{name}").qfrc_bias[0] for name in ("theta1", "theta2", "elbow", "theta3", "twin")]
    gravity = (bias[0], bias[1] - bias[2] + bias[4], bias[3] + bias[2] - bias[4])
    assert gravity == pytest.approx(gravity_torques(np.array([0.0, 0.3, 0.0])), abs=1e-12)
    assert model.joint("phantom/theta1").range == pytest.approx(PREMIUM_1_5.limit[0])
    assert data.site("phantom/tip").xmat.reshape(3, 3) == pytest.approx(np.eye(3))


def test_one_second_of_noise_on_every_joint_gives_no_mujoco_warning(linkage):
    rng = np.random.default_rng(1)
    linkage.model.opt.timestep = 1e-3
    dofs = [linkage.model.joint(name).dofadr[0] for name in GIMBAL_JOINTS]
    for _ in range(1000):
        linkage.data.ctrl[:] = rng.uniform(-1, 1, 3) * PREMIUM_1_5.peak_torque
        linkage.data.qfrc_applied[dofs] = rng.uniform(-0.02, 0.02, 3)
        mujoco.mj_step(linkage.model, linkage.data)
    assert np.isfinite(linkage.data.qpos).all()
    assert not linkage.data.warning.number.any()
