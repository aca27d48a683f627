"""Inverse dynamics of many states at once, contact forces, and joint torques under them."""

import mujoco
import numpy as np
import pytest

from models.humanoid.skeleton import FOOT_CONTACTS, N_TANGENT, figure_model, rest_pose
from models.mocap.dynamics.floor_forces import ALL_CONTACTS, EDGES, Floor, residual
from models.mocap.library import embedded

STANDING = np.ones((1, 8), dtype=bool)


@pytest.fixture(scope="module")
def states() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Each pose three times in a row, with other velocities and accelerations."""
    rng, q = np.random.default_rng(0), np.repeat(embedded("run").poses[::8], 3, axis=0)
    return q, rng.normal(size=(len(q), 57)), 10.0 * rng.normal(size=(len(q), 57))


def test_batched_demand_of_repeated_poses_equals_that_of_single_states(
    states: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> None:
    floor = Floor(spheres=ALL_CONTACTS)
    batched = floor.demand(*states)
    single = [floor.demand(*(part[k : k + 1] for part in states)) for k in range(len(states[0]))]
    for name in ("spheres", "com", "wrench", "force"):
        np.testing.assert_array_equal(getattr(batched, name), np.concatenate([getattr(d, name) for d in single]))


@pytest.mark.parametrize("contacts", [FOOT_CONTACTS, ALL_CONTACTS])
def test_joint_torques_and_residual_under_contact_forces_match_mujoco_jacobians(
    states: tuple[np.ndarray, np.ndarray, np.ndarray], contacts: tuple[str, ...]
) -> None:
    model = figure_model()
    data, spheres = mujoco.MjData(model), [model.geom(name).id for name in contacts]
    demand = Floor(spheres=contacts).demand(*states)
    grip = 100.0 * np.random.default_rng(1).random((len(states[0]), 4 * len(contacts)))
    torque = demand.torque_on(grip)
    for k in range(0, len(grip), 7):
        data.qpos[:], data.qvel[:], data.qacc[:] = (part[k] for part in states)
        mujoco.mj_inverse(model, data)
        load = np.zeros(57)
        for sphere, force in zip(spheres, grip[k].reshape(-1, 4) @ EDGES, strict=True):
            sole = data.geom_xpos[sphere] - (0.0, 0.0, model.geom_size[spheres[0], 0])
            jacobian = np.zeros((3, 57))
            mujoco.mj_jac(model, data, jacobian, None, sole, model.geom_bodyid[sphere])
            load += jacobian.T @ force
        expected = data.qfrc_inverse - load
        np.testing.assert_allclose(torque[k], expected[6:], atol=1e-8)
        np.testing.assert_allclose(residual(demand, grip)[k, :3], expected[:3], atol=1e-8)
        np.testing.assert_allclose(demand.torque[k] - demand.levers()[k] @ grip[k], torque[k], atol=1e-9)


def test_floor_forces_support_a_standing_figure():
    floor = Floor()
    zero = np.zeros((1, N_TANGENT))
    demand = floor.demand(rest_pose()[None], zero, zero)
    grip = floor.grip(demand, STANDING)
    assert np.abs(residual(demand, grip)).max() < 0.1
    assert grip.min() >= 0
    assert grip.sum() == pytest.approx(floor.body_weight, rel=1e-3)


def test_floor_force_is_zero_in_the_air_and_never_pulls():
    floor = Floor()
    zero = np.zeros((1, N_TANGENT))
    demand = floor.demand(rest_pose()[None], zero, zero)
    np.testing.assert_array_equal(floor.grip(demand, ~STANDING), 0)
    falling = zero.copy()
    falling[0, 2] = -3 * 9.81
    demand = floor.demand(rest_pose()[None], zero, falling)
    missing = residual(demand, floor.grip(demand, STANDING))
    assert missing[0, 2] == pytest.approx(-2 * floor.body_weight, rel=1e-6)


def test_friction_force_is_bounded():
    floor = Floor()
    zero, sideways = np.zeros((1, N_TANGENT)), np.zeros((1, N_TANGENT))
    sideways[0, 1] = 3 * 9.81
    demand = floor.demand(rest_pose()[None], zero, sideways)
    missing = residual(demand, floor.grip(demand, STANDING))
    assert np.linalg.norm(missing[0, :3]) > 0.5 * floor.body_weight
