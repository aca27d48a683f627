"""Costs of parts: a tick of the heaviest field, the recorder, an image of the live page, preparing captures."""

import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
import psutil
from numba import njit
from scipy.ndimage import gaussian_filter1d

from controllers.curves.trajectory import Trajectory
from controllers.fields.algebra.law import Program
from controllers.fields.algebra.program import Compiled, evaluate
from controllers.fields.bundle import RiverBundle
from controllers.fields.higher_order import HigherOrder
from controllers.fields.river import River
from controllers.safety.limiter import ForceLimiter, limit_force
from controllers.state import HandState
from experiments.config.options import run_config
from experiments.live.session.messages import SLICE_SIDE
from experiments.preparation.tracking_trial import followed
from experiments.setups.session import Session
from experiments.setups.wiring import wire
from geometry.arrays import Array
from models.humanoid.skeleton import N_TANGENT
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip
from models.mocap.preparation.poses import add_tangents
from models.mocap.preparation.prepare import prepared
from models.mocap.readers.own_bvh import write_bvh
from sim.loop.channels import groups, record_into
from sim.recording.recorder import Recorder
from sim.viewer.live_stage import LiveStage
from sim.viewer.replay_page import unserved
from sim.viewer.shown import Moment, courses

_CLIPS = ("walk", "run", "jump", "squat_dance")  # gaits, a flight, and a dance in place
# RMS error of joints [rad] and of the root [m], and its correlation time [s]: the soles then slide and hover by
# centimetres, as in captures.
_JOINT_ERROR, _ROOT_ERROR, _CORRELATION_TIME = np.deg2rad(2.0), 0.01, 0.1
_FOLLOWING_TIME = 5.0  # [s] for which the physical figure follows each clip


@njit
def _run_ticks(compiled: Compiled, memory: Array, limits: Array, limiter: Array, hands: Array, force: Array) -> float:
    wrench, total = np.zeros(6), 0.0
    for i in range(hands.shape[0]):
        evaluate(compiled.units, compiled.ops, compiled.params, memory, hands[i], wrench)
        limit_force(limits, limiter, wrench, force)
        total += force[0]
    return total


def heaviest_field() -> tuple[Program, Array]:
    """A limited smooth field of higher order of ten rivers that are all near; and a lap of hands in it."""
    lap = Trajectory.circle(0.05, 4.0)
    times = np.linspace(0.0, 4.0, 129)
    angle = 0.5 * np.pi * times
    rivers: list[River] = []
    for k in range(10):
        points = lap.point(times)
        points[:, 2] = 0.015 * np.sin((k % 3 + 1) * angle + k)
        points[-1] = points[0]
        rivers.append(River(Trajectory(times, points, periodic=True)))
    bundle = RiverBundle(tuple(rivers), tuple(f"river {k}" for k in range(10)))
    hands = np.array([HandState.at(lap.point(t), lap.velocity(t), t).vector() for t in np.arange(4000) * 1e-3])
    return HigherOrder(bundle, 0.09, 0.025).program().limited(8.0), hands


def tick_microseconds(program: Program, hands: Array) -> float:
    """Mean processor time of a tick of a field with the safety limiter [µs], the best of five laps of hands."""
    limiter, memory, best = ForceLimiter(1e-3), program.fresh_memory(), np.inf
    compiled, heat = program.compiled(), limiter.fresh_memory()
    for lap in range(6):
        rows = hands[:2] if lap == 0 else hands
        begin = time.thread_time()
        _run_ticks(compiled, memory, limiter.limits(), heat, rows, np.zeros(3))
        best = best if lap == 0 else min(best, time.thread_time() - begin)
    return 1e6 * best / len(hands)


_SHORT_RUN, _LONG_RUN = 2.0, 20.0  # [s] of a short and of a long run


class RecorderCost(NamedTuple):
    """Ratio of processor times with and without recorder, and of memory after and before a run ten times as long."""

    ratio: float
    grown: float


def recorder_cost() -> RecorderCost:
    """Measure both ratios on the demo's run."""
    _processor_time(0.1, True)
    alone, recorded = _processor_time(_SHORT_RUN, False), _processor_time(_SHORT_RUN, True)
    before = psutil.Process().memory_info().rss
    _processor_time(_LONG_RUN, True)
    return RecorderCost(recorded / alone, psutil.Process().memory_info().rss / before)


def _processor_time(seconds: float, recorded: bool) -> float:
    """Processor time of a run [s], all threads."""
    session = wire(run_config())
    with tempfile.TemporaryDirectory() as folder:
        if not recorded:
            begin = time.process_time()
            session.loop().run(seconds)
            return time.process_time() - begin
        with Recorder(
            Path(folder) / "run.h5", {}, 1, groups(session.servo, session.world), session.static()
        ) as recorder:
            begin = time.process_time()
            session.loop(record_into(recorder, session.servo, session.world)).run(seconds)
            recorder.flush()
            return time.process_time() - begin


N_IMAGES, N_WARM_UP_IMAGES = 200, 20  # images that are timed, and drawn before as a warm-up


def picture_microseconds(session: Session) -> float:
    """Processor time of an image in which every body has moved [µs], without connected browsers."""
    model, data = session.world.full_model(), session.world.data
    with unserved() as server:
        stage = LiveStage(server.scene, model, courses(session.static()), 0.01)
        rng = np.random.default_rng(1)
        qpos = data.qpos[: model.nq] + 0.05 * rng.normal(size=(2, model.nq))
        pose, forces = qpos[:, -75:], rng.normal(size=(2, SLICE_SIDE**2, 3))
        begin = 0.0
        for k in range(N_WARM_UP_IMAGES + N_IMAGES):
            if k == N_WARM_UP_IMAGES:
                begin = time.thread_time()
            moment = k % 2
            place = np.full(3, 0.01 * moment)
            with server.atomic():
                stage.show(Moment(0.016 * k, qpos[moment], pose[moment], place, 1.0 + place, 1.0 - place, place))
                stage.draw_slice(forces[moment], forces[moment])
        return 1e6 * (time.thread_time() - begin) / N_IMAGES


def prepare_cost() -> tuple[float, float]:
    """Prepare clips with errors like those of captures, and let the physical figure follow them for as long.

    Returns the processor time of preparing, over the clips' duration and over the processor time of following.
    """
    rng = np.random.default_rng(0)
    preparing_time = clip_time = simulating_time = 0.0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "capture.bvh"
        for number, name in enumerate((_CLIPS[0], *_CLIPS)):
            write_bvh(_add_capture_errors(embedded(name), rng), path)
            result = prepared(path)
            began = time.process_time()
            followed(result.clip, _FOLLOWING_TIME)
            cost = (time.process_time() - began) / _FOLLOWING_TIME
            if number == 0:
                continue  # warm-up: compiles
            preparing_time, clip_time = preparing_time + result.seconds, clip_time + result.clip.duration
            simulating_time += result.clip.duration * cost
    return preparing_time / clip_time, preparing_time / simulating_time


def _add_capture_errors(clip: Clip, rng: np.random.Generator) -> Clip:
    """The clip with smooth random errors of the root and of all joints, so that its ends do not match."""
    scale = np.where(np.arange(N_TANGENT) < 3, _ROOT_ERROR, _JOINT_ERROR)
    errors = gaussian_filter1d(rng.normal(size=(clip.n_frames, N_TANGENT)), _CORRELATION_TIME * clip.fps, axis=0)
    return Clip(add_tangents(clip.poses, scale * errors / errors.std(axis=0)), clip.fps, clip.name)
