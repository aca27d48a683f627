"""Inverse dynamics of many states at once, and joint torques under contact forces."""

import mujoco
import numpy as np
import pytest

from models.humanoid.skeleton import figure_model
from models.mocap.dynamics.floor_forces import ALL_CONTACTS, EDGES, Floor, RequiredWrench
from models.mocap.library import embedded


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
    for name in RequiredWrench._fields:
        np.testing.assert_array_equal(getattr(batched, name), np.concatenate([getattr(d, name) for d in single]))


def test_joint_torques_under_contact_forces_match_mujoco_jacobians(
    states: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> None:
    model = figure_model()
    data, spheres = mujoco.MjData(model), [model.geom(name).id for name in ALL_CONTACTS]
    demand = Floor(spheres=ALL_CONTACTS).demand(*states)
    grip = 100.0 * np.random.default_rng(1).random((len(states[0]), 40))
    torque = demand.torque_on(grip)
    for k in range(0, len(grip), 7):
        data.qpos[:] = states[0][k]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        load = np.zeros(57)
        for sphere, force in zip(spheres, grip[k].reshape(10, 4) @ EDGES, strict=True):
            sole = data.geom_xpos[sphere] - (0.0, 0.0, model.geom_size[spheres[0], 0])
            jacobian = np.zeros((3, 57))
            mujoco.mj_jac(model, data, jacobian, None, sole, model.geom_bodyid[sphere])
            load += jacobian.T @ force
        np.testing.assert_allclose(torque[k], demand.torque[k] - load[6:], atol=1e-9)
        np.testing.assert_allclose(demand.torque[k] - demand.levers()[k] @ grip[k], torque[k], atol=1e-9)
