import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from models.humanoid.skeleton import BODIES, JOINTS, figure_model, rest_pose, torque_limit
from sim.body.feedback import rotate_by_vector, rotation_error
from sim.body.figure import CONTACTS, Figure, FigureGains
from sim.body.figure_state import REPORT_RESIDUAL, REPORT_SATURATED, REPORT_SUPPORT
from sim.body.stance import N_LEG, stance_response
from sim.body.tracking import TrackingConfig, floor_world
from sim.errors import SimError

PREFIX = "figure/"
STILL = np.zeros(57)


def _figure(height=0.0, gains=None):
    """The figure in its rest pose on (or above) the floor, with the arms down."""
    model = floor_world(TrackingConfig())
    data = mujoco.MjData(model)
    figure = Figure(model, data, figure_model(), PREFIX, gains or FigureGains())
    pose = rest_pose()
    for joint, angle in (("left_shoulder", -1.35), ("right_shoulder", 1.35)):
        first = 7 + 4 * JOINTS.index(joint)
        pose[first : first + 2] = np.cos(angle / 2), np.sin(angle / 2)
    pose[2] += height
    data.qpos[:] = pose
    mujoco.mj_forward(model, data)
    return model, data, figure, pose


def _moving(seed):
    """A figure standing on bent legs in the middle of some motion, and a reference near its state."""
    model, data, figure, pose = _figure()
    rng = np.random.default_rng(seed)
    for side in ("left", "right"):
        for joint, angle in (("hip", -0.5), ("knee", 1.0), ("ankle", -0.5)):
            first = 7 + 4 * JOINTS.index(f"{side}_{joint}")
            pose[first], pose[first + 2] = np.cos(angle / 2), np.sin(angle / 2)
    pose[2] -= 0.8606 * (1 - np.cos(0.5)) + 1e-5
    data.qpos[:] = pose
    data.qvel[:] = 0.05 * rng.normal(size=57)
    mujoco.mj_forward(model, data)
    return model, data, figure, pose, 0.05 * rng.normal(size=57), 0.5 * rng.normal(size=57)


def test_rotation_error_and_rotated_vector_equal_scipy():
    rng = np.random.default_rng(0)
    for _ in range(50):
        a, b = Rotation.random(random_state=rng), Rotation.random(random_state=rng)
        error, out, vector = np.empty(3), np.empty(3), rng.normal(size=3)
        rotation_error(a.as_quat(scalar_first=True), b.as_quat(scalar_first=True), error)
        np.testing.assert_allclose(error, (a.inv() * b).as_rotvec(), atol=1e-9)
        rotate_by_vector(error, vector, out)
        np.testing.assert_allclose(out, Rotation.from_rotvec(error).apply(vector), atol=1e-12)


def _imbalance(model, data, figure):
    """Generalised force of the planned motion, less those planned for motors, ground and residual."""
    s, M, J = figure.state, np.empty((57, 57)), np.empty((3, 57))
    mujoco.mj_fullM(model, data, M)
    given = np.zeros(57)
    for name, force in zip(CONTACTS, s.force, strict=True):
        point = data.geom(PREFIX + name).xpos - [0, 0, s.radius]
        mujoco.mj_jac(model, data, J, None, point, int(model.geom(PREFIX + name).bodyid[0]))
        given += J.T @ force
    given[6:] += data.ctrl
    given[:6] += data.qfrc_applied[:6]
    return M @ s.acceleration + data.qfrc_bias - data.qfrc_passive - given


@pytest.mark.parametrize("seed", range(3))
def test_planned_motion_obeys_the_equations_of_motion(seed):
    model, data, figure, pose, v_r, a_r = _moving(seed)
    figure.update(pose, v_r, a_r)
    assert figure.state.force[:, 2].sum() > 300.0
    np.testing.assert_allclose(_imbalance(model, data, figure), 0.0, atol=1e-6 * figure.state.weight)


def test_planned_forces_lie_within_the_friction_cone():
    _, _, figure, pose, v_r, a_r = _moving(5)
    figure.update(pose, v_r, a_r)
    force = figure.state.force
    assert np.all(force[:, 2] >= 0.0)
    assert np.all(np.hypot(force[:, 0], force[:, 1]) <= 0.9 * force[:, 2] + 1e-9)


def test_leg_accelerations_bring_loaded_feet_to_rest():
    model, data, figure, _, _, a = _moving(2)
    plain, s, offset, response = a.copy(), figure.state, np.empty(N_LEG), np.empty((N_LEG, 6))
    figure.update(data.qpos.copy(), STILL, STILL)
    points, ones = s.points[:4].copy(), np.ones(4)
    stance_response(s.legs[0], points, ones, ones, s.xpos, s.xmat, s.qvel, a, offset, response)
    for k in range(N_LEG):
        a[3 + 3 * s.legs[0, k // 3] + k % 3] += offset[k]
    J, before, h = np.empty((3, 57)), np.empty((3, 57)), 1e-6
    for point, name in zip(points, CONTACTS[:4], strict=True):
        body = int(model.geom(PREFIX + name).bodyid[0])
        mujoco.mj_jac(model, data, J, None, point, body)
        velocity = J @ data.qvel
        other = mujoco.MjData(model)
        other.qpos[:] = data.qpos
        mujoco.mj_integratePos(model, other.qpos, data.qvel, -h)
        mujoco.mj_kinematics(model, other)
        mujoco.mj_comPos(model, other)
        mujoco.mj_jac(model, other, before, None, point - h * velocity, body)
        settling = -40.0 * velocity - [0, 0, 400 * max(0, point[2])] - (J - before) / h @ data.qvel
        assert np.linalg.norm(J @ a - settling) < 0.05 * np.linalg.norm(J @ plain - settling)


def test_stance_response_is_linear_in_the_root_acceleration():
    _, data, figure, _, _, a = _moving(4)
    s, ones = figure.state, np.ones(4)
    figure.update(data.qpos.copy(), STILL, STILL)
    offset, moved, response = np.empty(N_LEG), np.empty(N_LEG), np.empty((N_LEG, 6))
    arguments = s.legs[1], s.points[4:8], ones, ones, s.xpos, s.xmat, s.qvel
    stance_response(*arguments, a, offset, response)
    change = np.arange(6.0)
    a[:6] += change
    stance_response(*arguments, a, moved, response)
    np.testing.assert_allclose(moved - offset, response @ change, atol=1e-9)


def test_standing_needs_no_residual_and_ground_bears_the_weight():
    model, data, figure, pose = _figure()
    total = 0.0
    for k in range(1000):
        if k % 4 == 0:
            figure.update(pose, STILL, STILL)
            assert np.abs(figure.state.report[REPORT_RESIDUAL : REPORT_RESIDUAL + 6]).max() < 1.0
        mujoco.mj_step(model, data)
        total += data.qfrc_constraint[2] / 1000
    assert total == pytest.approx(figure.state.weight, rel=0.02)
    assert np.linalg.norm(data.qpos[:3] - pose[:3]) < 2e-3
    assert np.all(np.abs(data.ctrl) <= torque_limit())


def test_figure_recovers_from_a_shove():
    model, data, figure, pose = _figure()
    chest = model.body(PREFIX + BODIES[2]).id
    for k in range(4000):
        if k % 4 == 0:
            figure.update(pose, STILL, STILL)
        data.xfrc_applied[chest, 0] = 60.0 if 400 <= k < 600 else 0.0
        mujoco.mj_step(model, data)
    assert np.linalg.norm(data.qpos[:3] - pose[:3]) < 0.02


def test_flying_reference_gets_no_residual_or_contact_force():
    model, data, figure, pose = _figure(height=0.5)
    start = data.subtree_com[1].copy()
    v_r, a_r = np.zeros(57), np.zeros(57)
    v_r[2], a_r[2] = 3.0, 20.0
    for k in range(200):
        if k % 4 == 0:
            figure.update(pose, v_r, a_r)
            assert np.all(data.qfrc_applied == 0.0)
            assert np.all(figure.state.force == 0.0)
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.subtree_com[1] - start, [0, 0, -0.5 * 9.81 * 0.1**2], atol=5e-4)


def test_standing_reference_does_not_support_a_falling_figure():
    _, data, figure, pose = _figure(height=0.3)
    pose[2] -= 0.3
    figure.update(pose, STILL, STILL)
    assert np.all(data.qfrc_applied == 0.0)
    assert figure.state.report[REPORT_SUPPORT] == 0.0


def test_residual_stays_within_its_bounds():
    gains = FigureGains(force_bound=0.05, moment_bound=0.01)
    _, data, figure, pose = _figure(gains=gains)
    far = pose.copy()
    far[0] += 0.4  # less than what counts as a fall
    figure.update(far, STILL, STILL)
    weight = figure.state.weight
    assert np.linalg.norm(data.qfrc_applied[:3]) <= 0.05 * weight * (1 + 1e-9)
    assert np.linalg.norm(data.qfrc_applied[3:6]) <= 0.01 * weight * 1.75 * (1 + 1e-9)
    assert np.linalg.norm(data.qfrc_applied[:3]) > 0.0


def test_saturated_motor_keeps_its_limit_and_its_joint_yields():
    model, data, figure, pose = _figure()
    a_r, elbow = np.zeros(57), 6 + 3 * JOINTS.index("left_elbow")
    a_r[elbow + 2] = 450.0
    figure.state.torque_limit[elbow - 6 + 2] = 10.0
    figure.update(pose, STILL, a_r)
    assert data.ctrl[elbow - 6 + 2] == pytest.approx(10.0)
    assert 0.0 < figure.state.acceleration[elbow + 2] < 400.0
    assert figure.state.report[REPORT_SATURATED] == 1
    np.testing.assert_allclose(_imbalance(model, data, figure), 0.0, atol=0.1)


def test_world_without_the_figure_is_refused():
    model = floor_world(TrackingConfig())
    with pytest.raises(SimError, match="no figure with the prefix 'ghost/'"):
        Figure(model, mujoco.MjData(model), figure_model(), "ghost/")


@pytest.mark.parametrize("gains", [{"joint_rate": -1.0}, {"root_rate": np.nan}, {"lift_time": 0.0}])
def test_invalid_gains_are_refused(gains):
    model = floor_world(TrackingConfig())
    with pytest.raises(SimError, match=next(iter(gains))):
        Figure(model, mujoco.MjData(model), figure_model(), PREFIX, FigureGains(**gains))
