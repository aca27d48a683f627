"""Flight, falls and recovery of the physical figure."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from models.humanoid.skeleton import JOINTS, figure_model, rest_pose
from models.mocap.library import embedded
from sim.body.clip_motion import clip_motion
from sim.body.falls import DOWN, LYING_TIME, RECOVERING, RECOVERY_TIME, UP
from sim.body.figure import Figure
from sim.body.figure_state import REPORT_DOWN, REPORT_FLIES, REPORT_SUPPORT, FigureGains
from sim.body.tracking import TrackingConfig, floor_world

PREFIX, STILL = "figure/", np.zeros(57)


def world(pose: np.ndarray, gains: FigureGains | None = None) -> tuple[mujoco.MjModel, mujoco.MjData, Figure]:
    model = floor_world(TrackingConfig())
    data = mujoco.MjData(model)
    data.qpos[:] = pose
    mujoco.mj_forward(model, data)
    return model, data, Figure(model, data, figure_model(), PREFIX, gains or FigureGains())


def standing() -> np.ndarray:
    """Arms down."""
    pose = rest_pose()
    for joint, angle in (("left_shoulder", -1.35), ("right_shoulder", 1.35)):
        first = 7 + 4 * JOINTS.index(joint)
        pose[first : first + 2] = np.cos(angle / 2), np.sin(angle / 2)
    return pose


def lowest_point_by_geoms(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Least height of the figure's surface over the floor by MuJoCo's own distance between geoms."""
    floor = model.geom("floor").id
    own = [g for g in range(model.ngeom) if g != floor]
    return min(mujoco.mj_geomDistance(model, data, floor, g, 1.0, None) for g in own)


def test_figure_off_the_floor_is_in_flight_only_if_its_reference_is() -> None:
    above = standing()
    above[2] += 0.3
    _, _, figure = world(above)
    figure.update(standing(), STILL, STILL)
    assert (figure.state.report[REPORT_SUPPORT], figure.state.report[REPORT_FLIES]) == (0.0, 0.0)
    figure.update(above, STILL, STILL)
    assert figure.state.report[REPORT_FLIES] == 1.0
    _, _, figure = world(standing())
    figure.update(above, STILL, STILL)
    assert figure.state.report[REPORT_FLIES] == 1.0


def test_fallen_figure_lies_on_the_floor_and_is_set_back_on_the_animation() -> None:
    begins = standing()
    begins[2], begins[3:7] = 0.6, (np.cos(np.pi / 4), 0.0, np.sin(np.pi / 4), 0.0)  # face down in the air
    model, data, figure = world(begins)
    modes, lows = [], []
    for k in range(5600):
        if k % 4 == 0:
            figure.update(standing(), STILL, STILL)
            modes.append(figure.state.report[REPORT_DOWN])
        mujoco.mj_step(model, data)
        if k % 40 == 0:
            lows.append(lowest_point_by_geoms(model, data))
    changes = [modes[k] for k in (0, *(np.flatnonzero(np.diff(modes)) + 1))]
    assert changes == [UP, DOWN, RECOVERING, UP]
    assert modes.count(RECOVERING) * figure.period == pytest.approx(RECOVERY_TIME, abs=0.01)
    assert modes.count(DOWN) * figure.period >= LYING_TIME
    assert min(lows) > -0.02
    assert np.linalg.norm(data.qpos[:3] - standing()[:3]) < 0.01
    assert figure.state.fall.state[2] == 1.0
    assert sum(warning.number for warning in data.warning) == 0


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seed"), [("run", 0), ("backflip", 1), ("walk", 3), ("run", 4)])
def test_thrown_figure_recovers_to_a_moving_animation_without_divergence(name: str, seed: int) -> None:
    rng, start = np.random.default_rng(seed), standing()
    start[2], start[3:7] = 1.0, Rotation.random(None, rng).as_quat(scalar_first=True)
    model, data, figure = world(start)
    data.qvel[:] = rng.normal(scale=2.0, size=57)
    motion = clip_motion(embedded(name), figure.period * np.arange(1800, dtype=np.float64))
    rows = [np.ascontiguousarray(r) for r in (motion.poses, motion.velocities, motion.accelerations)]
    modes, pose = list[float](), start
    for pose, velocity, acceleration in zip(*rows, strict=True):
        figure.update(pose, velocity, acceleration)
        modes.append(figure.state.report[REPORT_DOWN])
        if modes[-1] == UP and RECOVERING in modes:
            break
        mujoco.mj_step(model, data, 4)
    assert modes[-1] == UP
    assert DOWN in modes
    assert np.linalg.norm(data.qpos[:3] - pose[:3]) < 0.05
    assert np.abs(data.qvel).max() < 50.0
    assert sum(warning.number for warning in data.warning) == 0
