"""Distances between poses: geodesic, and as seen by segment positions."""

import mujoco
import numpy as np
import pytest

from experiments.trials.trial.measures import geodesic_distance, seen_distance
from models.humanoid.skeleton import N_TANGENT, figure_model, rest_pose


@pytest.fixture(scope="module")
def figure() -> mujoco.MjModel:
    return figure_model()


def poses(figure: mujoco.MjModel, n: int, seed: int) -> np.ndarray:
    rng, result = np.random.default_rng(seed), np.tile(rest_pose(), (n, 1))
    for pose in result:
        mujoco.mj_integratePos(figure, pose, rng.normal(scale=0.3, size=N_TANGENT), 1.0)
    return result


def test_geodesic_distance_is_the_norm_of_the_tangent(figure: mujoco.MjModel) -> None:
    start = poses(figure, 1, 2)
    step = np.random.default_rng(3).normal(scale=0.2, size=N_TANGENT)
    end = start.copy()
    mujoco.mj_integratePos(figure, end[0], step, 1.0)
    assert geodesic_distance(start, end)[0] == pytest.approx(np.linalg.norm(step), rel=1e-9)
    assert geodesic_distance(end, start)[0] == pytest.approx(np.linalg.norm(step), rel=1e-9)


def test_seen_distance_of_translated_figure_is_the_translation(figure: mujoco.MjModel) -> None:
    start = poses(figure, 3, 4)
    end = start.copy()
    end[:, :3] += [0.03, -0.04, 0.12]
    np.testing.assert_allclose(seen_distance(start, end, figure), 0.13, atol=1e-12)
