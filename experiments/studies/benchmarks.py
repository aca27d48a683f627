"""Speed, as ratios measured within one run: ``make bench``."""

import json
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
from numba import njit

from controllers.curves.closest_point import closest_phase
from controllers.curves.trajectory import Trajectory
from controllers.fields.map_feed import feed_maps, feed_rows
from controllers.fields.program import Compiled, evaluate
from controllers.haptic_map.evaluate import evaluate_map_jacobian
from controllers.haptic_map.lifted import Lifted
from controllers.state import HandState
from experiments.certify.certify import CERTIFICATE
from experiments.config.modes import JointWalls
from experiments.config.run_config import RunConfig
from experiments.results.folder import SUMMARY
from experiments.setups.clips import load_clips
from experiments.setups.figure_legs import figure_legs
from experiments.setups.session import Session
from experiments.setups.stylus import stylus_path
from experiments.setups.walls import figure_walls
from experiments.setups.wiring import wire
from experiments.studies.field_cost import heaviest_field, tick_microseconds
from experiments.studies.figure_cost import figure_cost
from experiments.studies.trial_cost import trial_cost
from models.humanoid.skeleton import figure_model
from models.mocap.clip import Clip
from models.mocap.library import embedded, embedded_names
from models.mocap.readers.own_bvh import write_bvh
from sim.body.clip_motion import clip_motion
from sim.compilation.compiled import entry_point
from sim.compilation.kernel_units import map_units
from sim.loop.loop import make_logs
from sim.loop.servo import FrameLog, TickLog, run_block

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

SECONDS = 2.0  # simulated in each measurement of the loop
ROUNDS = 7


def bench() -> None:
    """Print every figure with what it has to reach."""
    config = RunConfig(seconds=SECONDS)
    clips, _ = load_clips(config.map.clips)
    ratio, factor, same = closed_loop_over_replay(lambda: wire(config, clips))
    print(f"closed loop / replay of its controls, one thread: {ratio:.3f} (≤ 1.05); same states bit for bit: {same}")
    print(f"real-time factor of one thread: {factor:.2f}")
    print(f"two threads / twice one thread: {thread_scaling(lambda: wire(config, clips)):.2f} (≥ 0.90)")
    small, large = closest_point_microseconds(10), closest_point_microseconds(10_000)
    print(f"closest point: {small:.2f} µs on 10 pieces, {large:.2f} µs on 10 000: ×{large / small:.2f} (≤ 3)")
    print(f"ten rivers of higher order, with the limiter: {tick_microseconds(*heaviest_field()):.1f} µs a tick (≤ 20)")
    print(f"second start of hvf to its first tick: {second_start_seconds():.1f} s (≤ 3)")
    cost = figure_cost()
    print(f"kinematic figure, against the physical one: {cost.physical / cost.kinematic:.1f} × as fast (≥ 3)")
    print(f"no figure, against the physical one: {cost.physical / cost.none:.1f} × as fast (≥ 5)")
    print(f"a tick without figure: {cost.none / cost.bare_step:.1f} bare mj_steps of the linkage (≤ 3)")
    trials = trial_cost()
    print(f"a study beside its trials, processor time: {100 * trials.overhead:.1f} % (≤ 5)")
    print(f"trials on two threads / twice one: {trials.scaling:.2f} (≥ 0.90)")
    print(f"memory after 2000 short trials / after 400: {trials.grown:.3f} (≤ 1.01)")
    print(f"second start of a study to its first row: {trials.start:.1f} s (≤ 3)")
    print(f"soft walls of 17 joints: {walls_microseconds(wire(config, clips)):.1f} µs a tick (≤ 20)")
    print(f"h(p) with h_* over four clips: {map_microseconds(wire(config, clips)):.1f} µs (≤ 20)")
    four, ten, hundred = (lifted_microseconds(m) for m in (4, 10, 100))
    print(f"lifted map, h(p) with h_*, four clips near: {four:.1f} µs (≤ 20)")
    print(f"lifted map, 10 → 100 clips: {ten:.1f} → {hundred:.1f} µs: ×{hundred / ten:.2f} (≤ 2)")
    made, verified = certificate_seconds()
    print(f"certificate of the demo: {made:.1f} s (≤ 20), verified in {verified:.2f} s (≤ 1)")
    print(f"ten clips of 10 s lifted, with the report: {lifting_seconds():.1f} s (≤ 60)")


def closed_loop_over_replay(make: Callable[[], Session]) -> tuple[float, float, bool]:
    """Time of the closed loop over that of replaying its controls, real-time factor, and whether the states agree.

    Both run through `sim.loop.servo.run_block`, in turn; the median of the ratios of neighbouring runs is taken.
    """
    ratios: list[float] = []
    factors: list[float] = []
    same = True
    for _ in range(ROUNDS):
        session, ticks, frames, n = _prepared(make)
        closed = _timed(session, n, False, ticks, frames)
        end = session.world.data.qpos.copy()
        other, _, unused, _ = _prepared(make)
        replayed = _timed(other, n, True, ticks, unused)
        same = same and bool(np.array_equal(end, other.world.data.qpos))
        ratios.append(closed / replayed)
        factors.append(SECONDS / closed)
    return statistics.median(ratios), statistics.median(factors), same


def thread_scaling(make: Callable[[], Session]) -> float:
    """Throughput of two threads, a session each, over twice that of one."""
    ratios: list[float] = []
    for _ in range(ROUNDS):
        session, ticks, frames, n = _prepared(make)
        alone = _timed(session, n, False, ticks, frames)
        pair = [_prepared(make) for _ in range(2)]
        threads = [
            threading.Thread(target=run_block, args=(session.servo, 0, n, False, ticks, frames))
            for session, ticks, frames, n in pair
        ]
        begin = time.perf_counter()
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        ratios.append(alone / (time.perf_counter() - begin))
    return statistics.median(ratios)


def second_start_seconds() -> float:
    """Seconds from the start of a new process to its first tick, with the code already compiled by one before."""
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(2):
            _seconds_of("run", "--seconds", "0.1", "--overwrite", "--out", folder)
        summary = json.loads((Path(folder) / SUMMARY).read_text(encoding="utf-8"))
    return float(summary["speed"]["first_tick_seconds"])


def certificate_seconds() -> tuple[float, float]:
    """Seconds that new processes take to certify the demo's field, and to verify that."""
    with tempfile.TemporaryDirectory() as folder:
        made = _seconds_of("certify", "--out", folder)
        return made, _seconds_of("certify", "--verify", str(Path(folder) / CERTIFICATE))


def lifting_seconds() -> float:
    """Seconds that a new process takes to lift ten clips of 10 s at 60 frames a second, and to report on the map."""
    times = np.arange(601) / 60.0
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder) / f"{k}.bvh" for k in range(10)]
        for k, file in enumerate(files):
            clip = embedded(embedded_names()[k % len(embedded_names())])
            poses = clip_motion(clip, times * (1.0 - 0.05 * (k // len(embedded_names())))).poses
            write_bvh(Clip(poses, 60.0, file.stem), file)
        return _seconds_of("lift", *map(str, files), "--out", str(Path(folder) / "map.npz"))


def _seconds_of(*arguments: str) -> float:
    begin = time.perf_counter()
    subprocess.run([sys.executable, "-m", "experiments.cli", *arguments], check=True, capture_output=True)
    return time.perf_counter() - begin


def _prepared(make: Callable[[], Session]) -> tuple[Session, TickLog, FrameLog, int]:
    session = make()
    n = round(SECONDS / session.servo.plant.period)
    ticks, frames = make_logs(session.servo, n)
    return session, ticks, frames, n


def _timed(session: Session, n: int, replay: bool, ticks: TickLog, frames: FrameLog) -> float:
    begin = time.perf_counter()
    run_block(session.servo, 0, n, replay, ticks, frames)
    return time.perf_counter() - begin


@njit
def _closest_many(blob: Array, points: Array, phase: float) -> float:
    total = 0.0
    for i in range(points.shape[0]):
        phase, distance = closest_phase(blob, 0, points[i, 0], points[i, 1], points[i, 2], phase)
        total += distance
    return total


def closest_point_microseconds(pieces: int) -> float:
    """Mean time of a closest-point query of a hand that moves along a knotted curve of so many pieces [µs]."""
    t = np.linspace(0.0, 1.0, pieces + 1)
    angle = 2.0 * np.pi * t
    points = np.stack(
        [np.sin(angle) + 2.0 * np.sin(2.0 * angle), np.cos(angle) - 2.0 * np.cos(2.0 * angle), -np.sin(3.0 * angle)], 1
    )
    points[-1] = points[0]
    curve = Trajectory(t, 0.02 * points, periodic=True)
    blob = curve.packed()
    path = curve.point(np.linspace(0.0, 1.0, 4000)) + np.random.default_rng(0).normal(scale=1e-3, size=(4000, 3))
    _closest_many(blob, path[:2], np.nan)
    return _microseconds(lambda: _closest_many(blob, path, np.nan), len(path))


@entry_point
def _map_many(
    units: IntArray, kind: int, params: Array, points: Array, memory: Array, pose: Array, jacobian: Array
) -> None:
    for i in range(points.shape[0]):
        evaluate_map_jacobian(units, kind, params, points[i], memory, pose, jacobian)


def map_microseconds(session: Session) -> float:
    """Mean time of h with h_* along the default curve [µs]."""
    kind, params, memory = session.haptic_map.compiled()
    pose, jacobian = np.empty(session.haptic_map.nq), np.empty((session.haptic_map.nv, 6))
    points = stylus_path(session.curve.point(np.linspace(0.0, session.curve.duration, 2000)))
    units = map_units([(kind, params)])
    _map_many(units, kind, params, points[:2], memory, pose, jacobian)
    return _microseconds(lambda: _map_many(units, kind, params, points, memory, pose, jacobian), len(points))


def lifted_microseconds(m: int) -> float:
    """Mean time of h with h_* of a lifted map of m clips on a lattice of curves, at random places between them [µs]."""
    clips = [embedded(name) for name in embedded_names()]
    motions = [(clips[i % len(clips)].poses, clips[i % len(clips)].fps) for i in range(m)]
    side, lap, k = int(np.ceil(np.sqrt(m))), np.arange(64)[:, None] * np.pi / 32.0, np.arange(m)
    step = 0.04 / (side - 1)
    r, z = 0.03 + step * (k % side) + 0.1 * step * np.sin(lap + k), -0.02 + step * (k // side) + 0.0 * lap
    angles = [np.linspace(0.0, 2.0 * np.pi, len(poses)) for poses, _ in motions]
    lifted = Lifted(motions, [True] * m, angles, np.stack([r, z], axis=-1), figure_legs(figure_model()))
    kind, params, memory = lifted.compiled()
    pose, jacobian = np.empty(lifted.nq), np.empty((lifted.nv, 6))
    theta, radius, height = np.random.default_rng(0).uniform([0.0, 0.03, -0.02], [6.28, 0.07, 0.02], (2000, 3)).T
    points = stylus_path(np.column_stack([radius * np.cos(theta), radius * np.sin(theta), height]))
    units = map_units([(kind, params)])
    _map_many(units, kind, params, points[:2], memory, pose, jacobian)
    return _microseconds(lambda: _map_many(units, kind, params, points, memory, pose, jacobian), len(points))


@njit
def _wall_many(units: IntArray, feeds: IntArray, field: Compiled, memory: Array, hands: Array, wrench: Array) -> None:
    for i in range(hands.shape[0]):
        feed_maps(units, feeds, field.params, memory, hands[i])
        evaluate(field.units, field.ops, field.params, memory, hands[i], wrench)


def walls_microseconds(session: Session) -> float:
    """Mean time of a tick of the figure's soft walls for a hand on the default curve [µs]."""
    curve, numbers = session.curve, JointWalls()
    times = np.linspace(0.0, curve.duration, 4000)
    hands = np.array([HandState.at(curve.point(t), curve.velocity(t), t).vector() for t in times])
    walls = figure_walls(session.haptic_map, numbers.wall_stiffness, numbers.wall_margin, numbers.joint_speed)
    program, wrench = walls.program(), np.empty(6)
    memory, units = program.fresh_memory(), session.servo.reference.units
    feeds, field = feed_rows(program.map_feeds), program.compiled()
    _wall_many(units, feeds, field, memory, hands[:2], wrench)
    return _microseconds(lambda: _wall_many(units, feeds, field, memory, hands, wrench), len(hands))


def _microseconds(call: Callable[[], object], calls: int) -> float:
    times: list[float] = []
    for _ in range(ROUNDS):
        begin = time.perf_counter()
        call()
        times.append(time.perf_counter() - begin)
    return 1e6 * min(times) / calls
