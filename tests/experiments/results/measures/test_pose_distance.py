import mujoco
import numpy as np
import pytest

from experiments.results.measures.pose_distance import geodesic_distance, seen_distance, segment_places
from models.humanoid.skeleton import BODIES, N_TANGENT, figure_model, rest_pose


@pytest.fixture(scope="module")
def figure() -> mujoco.MjModel:
    return figure_model()


def poses(figure: mujoco.MjModel, n: int, seed: int) -> np.ndarray:
    rng, made = np.random.default_rng(seed), np.tile(rest_pose(), (n, 1))
    for pose in made:
        mujoco.mj_integratePos(figure, pose, rng.normal(scale=0.3, size=N_TANGENT), 1.0)
    return made


def test_segments_are_where_mujoco_s_own_kinematics_has_them(figure: mujoco.MjModel) -> None:
    made, data = poses(figure, 5, 1), mujoco.MjData(figure)
    for pose, places in zip(made, segment_places(made, figure), strict=True):
        data.qpos = pose
        mujoco.mj_kinematics(figure, data)
        np.testing.assert_allclose(places, [data.body(body).xpos for body in BODIES], atol=1e-12)


def test_the_geodesic_is_the_length_of_the_tangent_that_leads_there(figure: mujoco.MjModel) -> None:
    start = poses(figure, 1, 2)
    step = np.random.default_rng(3).normal(scale=0.2, size=N_TANGENT)
    end = start.copy()
    mujoco.mj_integratePos(figure, end[0], step, 1.0)
    assert geodesic_distance(start, end)[0] == pytest.approx(np.linalg.norm(step), rel=1e-9)
    assert geodesic_distance(end, start)[0] == pytest.approx(np.linalg.norm(step), rel=1e-9)


def test_a_figure_that_is_carried_is_seen_as_far_away_as_it_is_carried(figure: mujoco.MjModel) -> None:
    start = poses(figure, 3, 4)
    end = start.copy()
    end[:, :3] += [0.03, -0.04, 0.12]
    np.testing.assert_allclose(seen_distance(start, end, figure), 0.13, atol=1e-12)
