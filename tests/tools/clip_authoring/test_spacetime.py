"""Coordinates and the spacetime optimisation, against MuJoCo and finite differences."""

import mujoco
import numpy as np
import pytest

from models.errors import ModelError
from models.humanoid.skeleton import N_TANGENT, figure_model
from tools.clip_authoring import flights, gait
from tools.clip_authoring.coordinates import coordinate, poses, reflection, states
from tools.clip_authoring.spacetime import Motion, Task


@pytest.fixture(scope="module")
def figure():
    model = figure_model()
    return model, mujoco.MjData(model)


def random_state(rng, scale=0.6):
    u = scale * rng.standard_normal((4, N_TANGENT))
    return u, 2 * rng.standard_normal((4, N_TANGENT)), 10 * rng.standard_normal((4, N_TANGENT))


def test_states_match_mujoco_finite_differences(figure):
    model, _ = figure
    u, du, ddu = random_state(np.random.default_rng(0))
    q, v, a = states(u, du, ddu)
    h = 1e-5
    for k in range(len(u)):

        def pose(t, k=k):
            return poses(u[k] + t * du[k] + t * t / 2 * ddu[k])

        ahead, behind = np.empty(N_TANGENT), np.empty(N_TANGENT)
        mujoco.mj_differentiatePos(model, ahead, h, pose(0), pose(h))
        mujoco.mj_differentiatePos(model, behind, h, pose(-h), pose(0))
        np.testing.assert_allclose(q[k], pose(0))
        np.testing.assert_allclose(v[k], (ahead + behind) / 2, atol=1e-4)
        np.testing.assert_allclose(a[k], (ahead - behind) / h, atol=5e-3)


def test_reflected_coordinates_are_the_mirror_image(figure):
    model, data = figure
    u = 0.4 * np.random.default_rng(1).standard_normal(N_TANGENT)
    bodies = []
    for coordinates in (u, reflection() @ u):
        data.qpos[:] = poses(coordinates)
        mujoco.mj_kinematics(model, data)
        bodies.append({model.body(i).name: data.xpos[i].copy() for i in range(1, model.nbody)})
    swap = {"left": "right", "right": "left"}
    for name, place in bodies[0].items():
        side, _, rest = name.partition("_")
        twin = f"{swap[side]}_{rest}" if side in swap else name
        np.testing.assert_allclose(bodies[1][twin], place * (1, -1, 1), atol=1e-12)


def test_unknown_coordinate_is_refused_by_name():
    assert coordinate("left_knee", "y") == 3 * (2 + 12) + 1
    with pytest.raises(ModelError, match="tail"):
        coordinate("tail", "x")


@pytest.mark.slow
def test_gauss_newton_gradient_matches_finite_differences():
    motion = Motion(gait.task(gait.WALK))
    motion.solve(6)
    errors = motion.errors(motion.unknowns)
    _, gradient = motion._normal_equations(errors)
    direction = np.random.default_rng(3).standard_normal(len(gradient))
    direction /= np.linalg.norm(direction)
    h = 1e-6
    costs = [0.5 * np.sum(motion.errors(motion.unknowns + s * h * direction).weighted ** 2) for s in (1, -1)]
    assert gradient @ direction == pytest.approx((costs[0] - costs[1]) / (2 * h), rel=0.03)


@pytest.mark.slow
def test_solve_lowers_the_cost_at_every_iteration_and_keeps_the_end_coordinates():
    motion = Motion(flights.task(flights.JUMP, flights.JUMP.weights))
    start, end = motion.coordinates(np.array([0.0, flights.JUMP.keys[-1].time - 1e-9]))
    costs = motion.solve(2)
    assert len(costs) == 3
    assert costs[0] > costs[1] > costs[2]
    after = motion.coordinates(np.array([0.0, flights.JUMP.keys[-1].time - 1e-9]))
    np.testing.assert_allclose(after, [start, end], atol=1e-9)


def test_array_of_wrong_shape_is_refused():
    task = gait.task(gait.WALK)
    with pytest.raises(ModelError, match="clearance"):
        Motion(Task(**{**vars(task), "clearance": np.zeros((3, 8))}))
