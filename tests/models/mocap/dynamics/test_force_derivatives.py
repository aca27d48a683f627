"""Inverse dynamics, and their derivatives in closed form, against MuJoCo's."""

import mujoco
import numpy as np
import pytest

from models.humanoid.skeleton import N_TANGENT, figure_model
from models.mocap.dynamics.force_derivatives import force_derivatives, point_derivatives, turn_derivatives
from models.mocap.dynamics.inverse_dynamics import SegmentPlaces, inverse_dynamics
from models.mocap.library import embedded
from tests.derivatives import central_differences


def forces(q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Generalised forces by MuJoCo, without contacts."""
    model = figure_model()
    data = mujoco.MjData(model)
    data.qpos, data.qvel, data.qacc = q, v, a
    mujoco.mj_inverse(model, data)
    return data.qfrc_inverse.copy()


def places_of(q: np.ndarray) -> SegmentPlaces:
    still = np.zeros((1, N_TANGENT))
    return inverse_dynamics(q[None], still, still)[1]


@pytest.mark.parametrize("clip", ["backflip", "walk"])
def test_derivatives_match_central_differences_of_mujoco(clip: str) -> None:
    rng, model = np.random.default_rng(0), figure_model()
    q, v, a = embedded(clip).poses[40], 3.0 * rng.normal(size=N_TANGENT), 20.0 * rng.normal(size=N_TANGENT)
    q[:3] += (5.0, -3.0, 0.0)  # derivatives do not depend on the place

    def moved(tangent: np.ndarray) -> np.ndarray:
        pose = q.copy()
        mujoco.mj_integratePos(model, pose, tangent, 1.0)
        return forces(pose, v, a)

    by_position, by_velocity, by_acceleration = force_derivatives(places_of(q), v[None], a[None])[0]
    for found, expected, tolerance in (
        (by_position, central_differences(moved, np.zeros(N_TANGENT), 1e-5), 1e-4),
        (by_velocity, central_differences(lambda rates: forces(q, rates, a), v, 1e-2), 1e-7),
        (by_acceleration, central_differences(lambda rates: forces(q, v, rates), a, 1.0), 1e-9),
    ):
        np.testing.assert_allclose(found, expected, atol=tolerance * np.abs(expected).max() / 100.0)


def test_generalised_forces_are_those_of_mujoco() -> None:
    rng, q = np.random.default_rng(1), embedded("run").poses[::16]
    v, a = rng.normal(size=(len(q), N_TANGENT)), 50.0 * rng.normal(size=(len(q), N_TANGENT))
    expected = [forces(*state) for state in zip(q, v, a, strict=True)]
    np.testing.assert_allclose(inverse_dynamics(q, v, a)[0], expected, atol=1e-9)


def test_derivatives_of_points_and_turns_match_mujoco_jacobians() -> None:
    model, q = figure_model(), embedded("backflip").poses[40]
    data, points, turns = mujoco.MjData(model), np.empty((2, 18, 3, N_TANGENT)), np.empty((18, 3, N_TANGENT))
    data.qpos = q
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    for body in range(1, model.nbody):
        mujoco.mj_jac(model, data, points[0, body - 1], turns[body - 1], data.xpos[body], body)
        mujoco.mj_jac(model, data, points[1, body - 1], None, data.xipos[body], body)
    places = places_of(q)
    for expected, of_bodies in zip(points, (places.joints, places.centres), strict=True):
        np.testing.assert_allclose(point_derivatives(places, of_bodies, range(18))[0], expected, atol=1e-12)
    np.testing.assert_allclose(turn_derivatives(places, range(18))[0], turns, atol=1e-12)
