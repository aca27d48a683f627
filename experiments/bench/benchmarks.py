"""Benchmarks of speed, as ratios measured within one run: ``make bench``."""

import json
import os
import resource
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np
from numba import njit

from controllers.curves.closest_point import closest_phase
from controllers.curves.trajectory import Trajectory
from controllers.fields.algebra.map_feed import Maps, feed_maps, unlinked_maps
from controllers.fields.algebra.program import Compiled, evaluate
from controllers.fields.follow import follow_wrench
from controllers.haptic_map.base import HapticMap
from controllers.haptic_map.lifted import Lifted
from controllers.haptic_map.map_stages import evaluate_map_jacobian
from controllers.state import HandState, stylus_path
from experiments.bench.part_costs import (
    heaviest_field,
    picture_microseconds,
    prepare_cost,
    recorder_cost,
    tick_microseconds,
)
from experiments.bench.results import BenchmarkResult
from experiments.bench.tick_cost import MODES, PHYSICS_STEP, figure_cost, prepared, tick_cost
from experiments.bench.trial_cost import trial_cost
from experiments.certify.certify import CERTIFICATE
from experiments.config.modes import JointWalls
from experiments.config.options import run_config
from experiments.fitting.figure_legs import figure_legs
from experiments.results.folder import SUMMARY
from experiments.setups.modes.fixed_curve import figure_walls
from experiments.setups.parts.clips import load_clips
from experiments.setups.session import Session
from experiments.setups.wiring import wire
from geometry.arrays import Array, IntArray
from models.humanoid.skeleton import figure_model
from models.mocap.library import embedded, embedded_names
from models.mocap.motion.clip import Clip
from models.mocap.readers.own_bvh import write_bvh
from sim.body.clip_motion import clip_motion
from sim.compilation.compiled import entry_point
from sim.compilation.kernel_units import linked_stages
from sim.loop.servo import run_block

ROUNDS = 7  # of which the fastest counts
_LIBRARY_IMPORTS = "import mujoco, numba, h5py, scipy.interpolate, rich, pydantic"
"""Imports that any program of these libraries needs before its first tick."""


def benchmark_results() -> Iterator[BenchmarkResult]:
    """Yield every result with its bounds as it is measured; bounds are ratios within one run.

    The unit `mj_steps` is the time of a bare `mj_step` of the demo's world on this machine.
    """
    costs = {name: tick_cost(make()) for name, make in MODES.items()}
    step = costs["follow"].step
    speed = PHYSICS_STEP / costs["follow"].tick
    yield BenchmarkResult("simulated seconds per second, physics and servo at 1 kHz, figure at 500 Hz", speed)
    yield BenchmarkResult("microseconds of a bare mj_step of the world", 1e6 * step)
    for name, cost in costs.items():
        yield BenchmarkResult(f"a closed-loop tick, {name}", cost.tick / cost.step, "mj_steps", at_most=1.5)
    default = tick_cost(run_config())
    yield BenchmarkResult("simulated seconds per second, default clock", 1e-3 / default.tick)
    yield BenchmarkResult("a closed-loop tick of the default clock, two steps", default.tick / default.step, "mj_steps")
    agrees = all(cost.same for cost in (*costs.values(), default))
    yield BenchmarkResult(
        "runs whose replayed controls give the same states, bit for bit, of all", float(agrees), at_least=1.0
    )
    cost = figure_cost()
    yield BenchmarkResult(
        "kinematic figure, against the physical one", cost.physical / cost.kinematic, "× as fast", at_least=3.0
    )
    yield BenchmarkResult("no figure, against the physical one", cost.physical / cost.none, "× as fast", at_least=5.0)
    yield BenchmarkResult("a tick without figure", cost.none / cost.bare_step, "mj_steps of the linkage", at_most=3.0)
    config = run_config()
    clips, _ = load_clips(config.map.clips)
    yield BenchmarkResult("two threads / twice one thread", thread_scaling(lambda: wire(config, clips)), at_least=0.9)
    recorder = recorder_cost()
    yield BenchmarkResult(
        "a run with its recorder, against one without", recorder.ratio, "× the processor time", at_most=1.15
    )
    yield BenchmarkResult("memory after 20 s recorded / before", recorder.grown, at_most=1.02)
    small, large = closest_point_microseconds(10), closest_point_microseconds(10_000)
    yield BenchmarkResult("closest point, 10 → 10 000 pieces", large / small, "×", at_most=3.0)

    def in_mj_steps(name: str, microseconds: float, bound: float) -> BenchmarkResult:
        return BenchmarkResult(name, 1e-6 * microseconds / step, "mj_steps", at_most=bound)

    yield in_mj_steps("ten rivers of higher order, with the limiter", tick_microseconds(*heaviest_field()), 0.3)
    yield in_mj_steps("soft walls of 17 joints", walls_microseconds(wire(config, clips)), 0.5)
    yield in_mj_steps("h(p) with h_* over four clips", map_microseconds(wire(config, clips)), 1.0)
    four, ten, hundred = (lifted_microseconds(m) for m in (4, 10, 100))
    yield in_mj_steps("lifted map, h(p) with h_*, four clips near", four, 1.0)
    yield BenchmarkResult("lifted map, 10 → 100 clips", hundred / ten, "×", at_most=2.0)
    trials = trial_cost()
    yield BenchmarkResult("a study beside its trials, processor time", 100 * trials.overhead, "%", at_most=5.0)
    yield BenchmarkResult("trials on two threads / twice one", trials.scaling, at_least=0.9)
    yield BenchmarkResult("memory after 2000 short trials / after 400", trials.grown, at_most=1.01)
    yield in_mj_steps("a picture of the live page", picture_microseconds(wire(config, clips)), 100.0)
    start = libraries_seconds()
    yield BenchmarkResult(
        "second start of hvf to its first tick", second_start_seconds() / start, "× its libraries", at_most=3.0
    )
    yield BenchmarkResult(
        "second start of a study to its first row", trials.start / start, "× its libraries", at_most=3.0
    )
    yield BenchmarkResult(
        "recompilation after a change in one law / a cold start, processor time", recompilation_ratio(), at_most=0.1
    )
    yield BenchmarkResult("hvf --help", _command_seconds("--help") / start, "× its libraries", at_most=1.5)
    certified, verified = certificate_seconds()
    yield in_mj_steps("certificate of the demo", 1e6 * certified, 300_000)
    yield BenchmarkResult("a certificate verified", verified / start, "× the libraries' start", at_most=2.0)
    yield in_mj_steps("ten clips of 10 s lifted, with the report", 1e6 * lifting_seconds(), 900_000)
    per_second, per_simulated = prepare_cost()
    yield BenchmarkResult("preparing captures, processor time", per_second, "× the clips' duration", at_most=6.0)
    yield BenchmarkResult("preparing captures, against simulating their figure", per_simulated, "× the processor time")


def libraries_seconds() -> float:
    """Time in which a new process imports the libraries that a run needs, the best of three [s]."""
    times: list[float] = []
    for _ in range(3):
        begin = time.perf_counter()
        subprocess.run([sys.executable, "-c", _LIBRARY_IMPORTS], check=True)
        times.append(time.perf_counter() - begin)
    return min(times)


def thread_scaling(make: Callable[[], Session]) -> float:
    """Throughput of two threads with a session each, over twice that of one; the shortest times of all rounds count."""
    alone_times, pair_times = list[float](), list[float]()
    for _ in range(ROUNDS):
        alone, pair = prepared(make), [prepared(make) for _ in range(2)]
        threads = [
            threading.Thread(target=run_block, args=(session.servo, 0, n, False, ticks, frames))
            for session, ticks, frames, n in pair
        ]
        begin = time.perf_counter()
        session, ticks, frames, n = alone
        run_block(session.servo, 0, n, False, ticks, frames)
        alone_times.append(time.perf_counter() - begin)
        begin = time.perf_counter()
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        pair_times.append(time.perf_counter() - begin)
    return min(alone_times) / min(pair_times)


def second_start_seconds() -> float:
    """Time from the start of a new process to its first tick, with the code already compiled [s]."""
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(2):
            _command_seconds("run", "--seconds", "0.1", "--overwrite", "--out", folder)
        summary = json.loads((Path(folder) / SUMMARY).read_text(encoding="utf-8"))
    return float(summary["speed"]["first_tick_seconds"])


def recompilation_ratio() -> float:
    """Processor time of a run with one law to compile, beyond that of a warm one, over that of a cold one.

    A unit is kept by its content (`sim.compilation.unit_key`), so that of a law that changes is missing.
    """
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"HVF_CACHE_DIR": f"{folder}/cache"}

        def processor_seconds() -> float:
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            _command_seconds("run", "--seconds", "0.1", "--overwrite", "--out", f"{folder}/run", env=environment)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime

        cold, warm = processor_seconds(), processor_seconds()
        (law,) = Path(folder, "cache").rglob(f"*.{follow_wrench.__name__}-*.unit")
        law.unlink()
        return (processor_seconds() - warm) / cold


def certificate_seconds() -> tuple[float, float]:
    """Times in which new processes certify the demo's field, and verify the certificate [s]."""
    with tempfile.TemporaryDirectory() as folder:
        certified = _command_seconds("certify", "--out", folder)
        return certified, _command_seconds("certify", "--verify", str(Path(folder) / CERTIFICATE))


def lifting_seconds() -> float:
    """Time in which a new process lifts ten clips of 10 s at 60 frames a second, and reports on the map [s]."""
    times = np.arange(601) / 60.0
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder) / f"{k}.bvh" for k in range(10)]
        for k, file in enumerate(files):
            clip = embedded(embedded_names()[k % len(embedded_names())])
            poses = clip_motion(clip, times * (1.0 - 0.05 * (k // len(embedded_names())))).poses
            write_bvh(Clip(poses, 60.0, file.stem), file)
        return _command_seconds("lift", *map(str, files), "--out", str(Path(folder) / "map.npz"))


def _command_seconds(*arguments: str, env: Mapping[str, str] | None = None) -> float:
    begin = time.perf_counter()
    subprocess.run([sys.executable, "-m", "experiments.cli", *arguments], check=True, capture_output=True, env=env)
    return time.perf_counter() - begin


@njit
def _find_closest_points(blob: Array, points: Array, phase: float) -> float:
    total = 0.0
    for i in range(points.shape[0]):
        phase, distance = closest_phase(blob, 0, points[i, 0], points[i, 1], points[i, 2], phase)
        total += distance
    return total


def closest_point_microseconds(pieces: int) -> float:
    """Mean time of a closest-point query for a hand that moves along a knotted curve of `pieces` pieces [µs]."""
    t = np.linspace(0.0, 1.0, pieces + 1)
    angle = 2.0 * np.pi * t
    points = np.stack(
        [np.sin(angle) + 2.0 * np.sin(2.0 * angle), np.cos(angle) - 2.0 * np.cos(2.0 * angle), -np.sin(3.0 * angle)], 1
    )
    points[-1] = points[0]
    curve = Trajectory(t, 0.02 * points, periodic=True)
    blob = curve.packed()
    path = curve.point(np.linspace(0.0, 1.0, 4000)) + np.random.default_rng(0).normal(scale=1e-3, size=(4000, 3))
    _find_closest_points(blob, path[:2], np.nan)
    return _microseconds(lambda: _find_closest_points(blob, path, np.nan), len(path))


@entry_point
def _evaluate_map(stages: IntArray, params: Array, points: Array, memory: Array, pose: Array, jacobian: Array) -> None:
    for i in range(points.shape[0]):
        evaluate_map_jacobian(stages, params, points[i], memory, pose, jacobian)


def map_microseconds(session: Session) -> float:
    """Mean time of h with h_* along the default curve [µs]."""
    return _map_microseconds(session.haptic_map, session.curve.point(np.linspace(0.0, session.curve.duration, 2000)))


def lifted_microseconds(m: int) -> float:
    """Mean time of h with h_* of a lifted map of m clips on a lattice of curves, at random places between them [µs]."""
    clips = [embedded(name) for name in embedded_names()]
    motions = [(clips[i % len(clips)].poses, clips[i % len(clips)].fps) for i in range(m)]
    side, lap, k = int(np.ceil(np.sqrt(m))), np.arange(64)[:, None] * np.pi / 32.0, np.arange(m)
    step = 0.04 / (side - 1)
    r, z = 0.03 + step * (k % side) + 0.1 * step * np.sin(lap + k), -0.02 + step * (k // side) + 0.0 * lap
    angles = [np.linspace(0.0, 2.0 * np.pi, len(poses)) for poses, _ in motions]
    lifted = Lifted(motions, [True] * m, angles, np.stack([r, z], axis=-1), figure_legs(figure_model()))
    theta, radius, height = np.random.default_rng(0).uniform([0.0, 0.03, -0.02], [6.28, 0.07, 0.02], (2000, 3)).T
    return _map_microseconds(lifted, np.column_stack([radius * np.cos(theta), radius * np.sin(theta), height]))


def _map_microseconds(haptic_map: HapticMap, places: Array) -> float:
    """Mean time of h with h_* at places (n, 3) of an upright stylus [µs]."""
    stages, params, memory, _ = haptic_map.compiled()
    pose, jacobian, points = np.empty(haptic_map.nq), np.empty((haptic_map.nv, 6)), stylus_path(places)
    stages = linked_stages(stages)
    _evaluate_map(stages, params, points[:2], memory, pose, jacobian)
    return _microseconds(lambda: _evaluate_map(stages, params, points, memory, pose, jacobian), len(points))


@njit
def _evaluate_walls(maps: Maps, field: Compiled, memory: Array, hands: Array, wrench: Array) -> None:
    for i in range(hands.shape[0]):
        feed_maps(maps, field.params, memory, hands[i])
        evaluate(field.units, field.ops, field.params, memory, hands[i], wrench)


def walls_microseconds(session: Session) -> float:
    """Mean time of a tick of the figure's soft walls for a hand on the default curve [µs]."""
    curve = session.curve
    times = np.linspace(0.0, curve.duration, 4000)
    hands = np.array([HandState.at(curve.point(t), curve.velocity(t), t).vector() for t in times])
    program, wrench = figure_walls(session.haptic_map, JointWalls()).program(), np.empty(6)
    memory, field, maps = program.fresh_memory(), program.compiled(), unlinked_maps(program.map_feeds)
    maps = maps._replace(stages=linked_stages(maps.stages))
    _evaluate_walls(maps, field, memory, hands[:2], wrench)
    return _microseconds(lambda: _evaluate_walls(maps, field, memory, hands, wrench), len(hands))


def _microseconds(call: Callable[[], object], calls: int) -> float:
    times: list[float] = []
    for _ in range(ROUNDS):
        begin = time.perf_counter()
        call()
        times.append(time.perf_counter() - begin)
    return 1e6 * min(times) / calls
