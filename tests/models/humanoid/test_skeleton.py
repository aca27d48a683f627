import mujoco
import numpy as np
import pytest

from models.errors import ModelError
from models.humanoid.skeleton import (
    BODIES,
    FOOT_CONTACTS,
    JOINTS,
    N_POSE,
    N_TANGENT,
    SEGMENTS,
    figure_model,
    figure_spec,
    joint_range,
    rest_pose,
    torque_limit,
)

# De Leva (1996), table 4, males: share of body mass [%].
DE_LEVA = {"head": 6.94, "upper_arm": 2.71, "forearm": 1.62, "hand": 0.61, "thigh": 14.16, "shank": 4.33, "foot": 1.37}
DE_LEVA_TRUNK = 43.46


def _with_floor(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 0.1], contype=1, conaffinity=0)
    return spec


def test_model_has_75_positions_57_velocities_51_motors_and_17_ball_joints():
    model = figure_model()
    assert (model.nq, model.nv, model.nu) == (N_POSE, N_TANGENT, 51) == (75, 57, 51)
    assert len(JOINTS) == 17
    assert [model.body(k + 1).name for k in range(18)] == list(BODIES)
    assert [model.joint(k + 1).name for k in range(17)] == list(JOINTS)
    assert np.all(model.jnt_type[1:] == mujoco.mjtJoint.mjJNT_BALL)
    assert [int(model.body_parentid[k + 1]) - 1 for k in range(18)] == [segment.parent for segment in SEGMENTS]


def test_rest_pose_stands_on_its_soles_with_bodies_aligned_to_the_world():
    model = figure_model()
    data = mujoco.MjData(model)
    data.qpos[:] = rest_pose()
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.xquat[1:], np.tile([1.0, 0, 0, 0], (18, 1)), atol=1e-12)
    soles = [data.geom(name).xpos[2] - model.geom(name).size[0] for name in FOOT_CONTACTS]
    np.testing.assert_allclose(soles, 0.0, atol=1e-9)
    assert data.body("left_hand").xpos[1] > 0.5
    assert data.geom("left_toe_in").xpos[0] > data.geom("left_heel_in").xpos[0]


@pytest.mark.parametrize("mass", [75.0, 60.0])
def test_segment_masses_match_de_leva(mass):
    model = figure_model(mass=mass)
    assert model.body_mass.sum() == pytest.approx(mass)
    for part, share in DE_LEVA.items():
        names = [name for name in BODIES if name == part or name.split("_", 1)[-1] == part]
        for name in names:
            assert model.body(name).mass[0] == pytest.approx(share / 100 * mass), name
    trunk = ("pelvis", "abdomen", "chest", "left_clavicle", "right_clavicle")
    assert sum(model.body(name).mass[0] for name in trunk) == pytest.approx(DE_LEVA_TRUNK / 100 * mass, rel=1e-3)


@pytest.mark.parametrize(
    ("body", "length", "radii"),
    # Lengths [mm] of the mean male subject of 1741 mm, radii of gyration [%]: sagittal, transverse, longitudinal.
    [("left_thigh", 422.2, (32.9, 32.9, 14.9)), ("right_shank", 434.0, (25.5, 24.9, 10.3))],
)
def test_segment_inertias_match_de_leva(body, length, radii):
    model = figure_model()
    mass = model.body(body).mass[0]
    # In a leg's frame the sagittal axis is x, the transverse axis y and the long axis z.
    moments = mass * (np.array(radii) / 100 * length / 1741 * 1.75) ** 2
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, model.body(body).iquat)
    rotation = rotation.reshape(3, 3)
    np.testing.assert_allclose(rotation @ np.diag(model.body(body).inertia) @ rotation.T, np.diag(moments), atol=1e-12)


def test_inertias_satisfy_the_triangle_inequality():
    model = figure_model()
    a, b, c = np.sort(model.body_inertia[1:], axis=1).T
    assert np.all(a > 0)
    assert np.all(a + b >= c)


def test_figure_is_left_right_symmetric():
    limits, model = joint_range(), figure_model()
    torques = torque_limit().reshape(17, 3)
    for name in JOINTS:
        if not name.startswith("left_"):
            continue
        left, right = JOINTS.index(name), JOINTS.index(name.replace("left", "right"))
        np.testing.assert_array_equal(limits[left, 1], limits[right, 1])
        for axis in (0, 2):
            np.testing.assert_array_equal(limits[left, axis], -limits[right, axis, ::-1])
        np.testing.assert_array_equal(torques[left], torques[right])
    for name in BODIES:
        if name.startswith("left_"):
            left, right = model.body(name), model.body(name.replace("left", "right"))
            np.testing.assert_allclose(left.ipos * [1, -1, 1], right.ipos)
            np.testing.assert_allclose(left.pos * [1, -1, 1], right.pos)
            np.testing.assert_allclose(left.inertia, right.inertia)


def test_every_joint_axis_has_a_motor_with_its_torque_limit():
    model, limits = figure_model(1.6, 55.0), torque_limit(1.6, 55.0)
    for joint, name in enumerate(JOINTS):
        for axis, letter in enumerate("xyz"):
            motor = model.actuator(f"{name}_{letter}")
            assert motor.id == 3 * joint + axis
            assert model.joint(int(motor.trnid[0])).name == name
            np.testing.assert_array_equal(motor.gear, np.eye(6)[axis])
            np.testing.assert_allclose(motor.ctrlrange, limits[motor.id] * np.array([-1, 1]))
    assert np.all(limits > 0)
    np.testing.assert_allclose(limits, torque_limit() * 1.6 * 55.0 / (1.75 * 75.0))


def test_stature_scales_lengths():
    model = figure_model(stature=0.875)
    data = mujoco.MjData(model)
    data.qpos[:] = rest_pose(0.875)
    mujoco.mj_forward(model, data)
    assert data.geom("left_heel_in").xpos[2] == pytest.approx(0.01)
    tall = figure_model()
    np.testing.assert_allclose(model.body_pos[2:], tall.body_pos[2:] / 2)
    np.testing.assert_allclose(model.body_ipos[1:], tall.body_ipos[1:] / 2)


@pytest.mark.parametrize(("stature", "mass"), [(0.4, 75.0), (3.0, 75.0), (1.75, 2.0), (1.75, 300.0), (np.nan, 75.0)])
def test_stature_or_mass_outside_the_human_range_is_refused(stature, mass):
    with pytest.raises(ModelError, match="must lie between"):
        figure_spec(stature, mass)


def test_one_second_of_random_torques_gives_no_mujoco_warning():
    spec = _with_floor(figure_spec())
    spec.option.timestep = 5e-4
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model = spec.compile()
    data, rng = mujoco.MjData(model), np.random.default_rng(7)
    data.qpos[:] = rest_pose()
    for k in range(2000):
        if k % 20 == 0:
            data.ctrl[:] = 0.3 * torque_limit() * rng.uniform(-1, 1, 51)
        mujoco.mj_step(model, data)
    assert sum(warning.number for warning in data.warning) == 0
    assert np.all(np.isfinite(data.qpos))


def test_bodies_collide_with_the_floor_only_and_standing_touches_it_with_the_feet():
    model = _with_floor(figure_spec()).compile()
    assert set(np.flatnonzero(model.geom_contype)) == {0}  # the floor
    colliding = {model.body(model.geom_bodyid[geom]).name for geom in np.flatnonzero(model.geom_conaffinity)}
    assert colliding == set(BODIES)
    data = mujoco.MjData(model)
    data.qpos[:] = rest_pose()
    data.qpos[2] -= 1e-3
    mujoco.mj_forward(model, data)
    assert {int(max(contact.geom)) for contact in data.contact} == {model.geom(name).id for name in FOOT_CONTACTS}


def test_figure_model_returns_an_independent_copy_of_the_compiled_spec() -> None:
    own, compiled = figure_model(1.6, 60.0), figure_spec(1.6, 60.0).compile()
    own.opt.gravity[2] = 0.0
    np.testing.assert_array_equal(figure_model(1.6, 60.0).opt.gravity, compiled.opt.gravity)
    np.testing.assert_array_equal(figure_model(1.6, 60.0).body_mass, compiled.body_mass)
