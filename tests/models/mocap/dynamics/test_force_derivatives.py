"""Derivatives of inverse dynamics in closed form, and the inverse dynamics of the preparation, against MuJoCo's."""

import mujoco
import numpy as np
import pytest

from models.humanoid.skeleton import N_TANGENT, figure_model
from models.mocap.dynamics.floor_forces import ALL_CONTACTS, Floor, RequiredWrench
from models.mocap.dynamics.force_derivatives import SegmentPlaces, force_derivatives
from models.mocap.library import embedded
from models.mocap.preparation.change import State
from models.mocap.preparation.inverse_dynamics import InverseDynamics
from tests.derivatives import central_differences


def forces(q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Generalised forces by MuJoCo, without contacts."""
    model = figure_model()
    data = mujoco.MjData(model)
    data.qpos, data.qvel, data.qacc = q, v, a
    mujoco.mj_inverse(model, data)
    return data.qfrc_inverse.copy()


def places_of(q: np.ndarray) -> SegmentPlaces:
    model = figure_model()
    data = mujoco.MjData(model)
    data.qpos = q
    mujoco.mj_kinematics(model, data)
    fields = (data.xpos, data.xipos, data.xmat.reshape(-1, 3, 3), data.ximat.reshape(-1, 3, 3))
    return SegmentPlaces(*(field[None, 1:].copy() for field in fields))


@pytest.mark.parametrize("clip", ["backflip", "walk"])
def test_derivatives_match_central_differences_of_mujoco(clip: str) -> None:
    rng, model = np.random.default_rng(0), figure_model()
    q, v, a = embedded(clip).poses[40], 3.0 * rng.normal(size=N_TANGENT), 20.0 * rng.normal(size=N_TANGENT)
    q[:3] += (5.0, -3.0, 0.0)  # derivatives do not depend on the place

    def moved(tangent: np.ndarray) -> np.ndarray:
        pose = q.copy()
        mujoco.mj_integratePos(model, pose, tangent, 1.0)
        return forces(pose, v, a)

    by_position, by_velocity, by_acceleration = force_derivatives(model, places_of(q), v[None], a[None])[0]
    for found, expected, tolerance in (
        (by_position, central_differences(moved, np.zeros(N_TANGENT), 1e-5), 1e-4),
        (by_velocity, central_differences(lambda rates: forces(q, rates, a), v, 1e-2), 1e-7),
        (by_acceleration, central_differences(lambda rates: forces(q, v, rates), a, 1.0), 1e-9),
    ):
        np.testing.assert_allclose(found, expected, atol=tolerance * np.abs(expected).max() / 100.0)


def test_the_preparations_inverse_dynamics_are_those_of_the_floor() -> None:
    rng, q = np.random.default_rng(1), embedded("run").poses[::16]
    v, a = rng.normal(size=(len(q), N_TANGENT)), 50.0 * rng.normal(size=(len(q), N_TANGENT))
    found, expected = (
        InverseDynamics(State(q, v, a), False, ALL_CONTACTS).demand,
        Floor(spheres=ALL_CONTACTS).demand(q, v, a),
    )
    for name in RequiredWrench._fields:
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), atol=1e-9, err_msg=name)
