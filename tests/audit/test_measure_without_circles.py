"""An audit of measures of the physical figure: each test would have caught what was wrong."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from experiments.config.words import run_config
from experiments.results.measures.run_measures import PathMeasure
from experiments.runs.run import run
from models.humanoid.skeleton import FOOT_CONTACTS, JOINTS, figure_model, joint_range, rest_pose, standing_com
from models.mocap.library import embedded
from sim.body.clip_motion import clip_motion
from sim.body.falls import DOWN, LIES, RISES, SET_BACK, UP
from sim.body.figure import Figure
from sim.body.figure_state import REPORT_DOWN, REPORT_FLIES, REPORT_SUPPORT, FigureGains
from sim.body.residual import Residual, ResidualMeasure
from sim.body.tracking import TrackingConfig, floor_world
from sim.recording.recording import Recording

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


def lowest_seen(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Least height of the figure's surface over the floor by MuJoCo's own distance between geoms."""
    floor = model.geom("floor").id
    own = [g for g in range(model.ngeom) if g != floor]
    return min(mujoco.mj_geomDistance(model, data, floor, g, 1.0, None) for g in own)


def test_a_figure_that_lost_the_floor_is_not_in_flight_unless_its_reference_is() -> None:
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


@pytest.mark.slow
@pytest.mark.usefixtures("without_page")
def test_grounded_of_a_run_is_what_an_independent_count_of_stance_and_contact_gives(tmp_path: Path) -> None:
    summary = run(run_config(clips=("run",), lap=2.2, seconds=4.0), tmp_path / "run", False, 0.0)
    with Recording(tmp_path / "run" / "run.h5") as recording:
        reference, ground = recording.channel("frames", "reference")[:], recording.channel("frames", "ground")[:]
        up = recording.channel("frames", "down")[:] == UP
    model = figure_model()
    data, stands = mujoco.MjData(model), np.empty(len(reference), dtype=bool)
    for k, pose in enumerate(reference):
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        lowest = min(data.geom(name).xpos[2] - model.geom(name).size[0] for name in FOOT_CONTACTS)
        stands[k] = lowest <= FigureGains().flight_height
    assert 0.2 < np.mean(stands) < 0.95
    grounded = np.mean(ground[stands & up, 2] > 1.0)
    assert summary.figure is not None
    assert summary.figure.grounded == pytest.approx(grounded, abs=1e-3)
    assert summary.figure.lost_contact_seconds == pytest.approx((1.0 - grounded) * np.sum(stands & up) * 2e-3, rel=0.02)


def test_a_figure_that_falls_is_caught_by_its_body_and_is_back_on_the_animation_after_a_second_on_the_floor() -> None:
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
            lows.append(lowest_seen(model, data))
    changes = [modes[k] for k in (0, *(np.flatnonzero(np.diff(modes)) + 1))]
    assert changes == [UP, DOWN, SET_BACK, UP]
    assert modes.count(SET_BACK) * figure.period == pytest.approx(RISES, abs=0.01)
    assert modes.count(DOWN) * figure.period >= LIES
    assert min(lows) > -0.02
    assert np.linalg.norm(data.qpos[:3] - standing()[:3]) < 0.01
    assert figure.state.fall.state[2] == 1.0
    assert sum(warning.number for warning in data.warning) == 0


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seed"), [("run", 0), ("backflip", 1), ("walk", 3), ("run", 4)])
def test_a_figure_thrown_anyhow_is_back_on_a_moving_animation_and_nothing_blows_up(name: str, seed: int) -> None:
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
        if modes[-1] == UP and SET_BACK in modes:
            break
        mujoco.mj_step(model, data, 4)
    assert modes[-1] == UP
    assert DOWN in modes
    assert np.linalg.norm(data.qpos[:3] - pose[:3]) < 0.05
    assert np.abs(data.qvel).max() < 50.0
    assert sum(warning.number for warning in data.warning) == 0


def test_balls_stop_at_the_corner_of_the_limits_that_everything_else_keeps() -> None:
    model, limits = figure_model(), joint_range()
    ankle = JOINTS.index("left_ankle")
    assert model.jnt_limited[1 + ankle]
    assert model.jnt_range[1 + ankle, 1] == pytest.approx(np.linalg.norm(np.abs(limits[ankle]).max(axis=1)))
    # No pose within the limits is beyond a stop.
    rng = np.random.default_rng(0)
    vectors = limits[..., 0] + rng.random((500, 17, 3)) * (limits[..., 1] - limits[..., 0])
    stops = np.where(model.jnt_limited[1:] == 1, model.jnt_range[1:, 1], np.inf)
    assert np.all(np.linalg.norm(vectors, axis=2) <= stops)


def test_bounds_of_hicks_are_kept_or_missed_by_force_and_moment_rms_and_peak() -> None:
    weight, height = 700.0, standing_com()
    assert height == pytest.approx(0.56 * 1.75, rel=0.05)  # as of a standing man, de Leva
    measure = ResidualMeasure(weight, height, 0.5)
    measure.add(np.array([[0.049 * weight, 0.0, 0.0, 0.0, 0.009 * weight * height, 0.0]]))
    assert measure.summary().missed() == ()
    assert measure.summary().verdict().endswith("all met")
    measure.add(np.array([[0.0, 0.0, 0.06 * weight, 0.02 * weight * height, 0.0, 0.0]]))
    made = measure.summary()
    assert made.seconds == 1.0
    assert made.force_rms == pytest.approx(np.sqrt((0.049**2 + 0.06**2) / 2))
    assert made.missed() == ("RMS force", "peak force", "RMS moment", "peak moment")
    assert Residual(1.0, 0.01, 0.06, 0.001, 0.002).missed() == ("peak force",)
    brief = Residual(1.0, 0.01, 0.0504, 0.001, 0.0101).brief()  # a peak that misses its bound is printed beyond it
    assert "1.0 % and 5.04 % of weight" in brief
    assert "0.1 % and 1.01 % of weight ×" in brief


class Bare:
    """What `PathMeasure` takes of a recording."""

    def __init__(self, clip_seconds: float):
        self.arrays = {"curve_span": np.array([0.0, 4.0]), "curve_closed": 0.0, "clip_seconds": clip_seconds}
        self.texts: dict[str, str] = {}


@pytest.mark.parametrize("block", [100, 5000])
def test_a_stylus_that_came_to_the_end_of_an_open_curve_is_told_to_stand_still(block: int) -> None:
    t = np.arange(5000) * 1e-3
    phase = np.minimum(2.0 * t, 4.0)  # twice its own pace, and at its end at 2 s
    jitter = 2e-4 * np.sin(300.0 * t)
    p = np.stack([0.01 * phase + jitter, 0.0 * t, 0.0 * t], axis=1)
    rows = {"t": t, "phase": phase, "p": p, "nearest": p, "distance": 0.0 * t, "user": 0.0 * p}
    measure = PathMeasure(Bare(4.0))  # pyright: ignore[reportArgumentType]
    for first in range(0, len(t), block):
        measure.add({name: values[first : first + block] for name, values in rows.items()})
    path = measure.summary()
    assert path.stopped_at == pytest.approx(1.95, abs=0.1)
    assert path.pace == pytest.approx(2.0, rel=0.05)
    assert "stood still from" in (path.line() or "")
    going = PathMeasure(Bare(np.nan))  # pyright: ignore[reportArgumentType]
    going.add({name: values[:1900] for name, values in rows.items()})
    assert going.summary().line() is None
