"""Times of compiled functions that are called in a tick: closest point, haptic maps, soft walls."""

import time
from collections.abc import Callable

import numpy as np
from numba import njit

from controllers.curves.closest_point import closest_phase
from controllers.curves.trajectory import Trajectory
from controllers.fields.algebra.map_feed import Maps, feed_maps, unlinked_maps
from controllers.fields.algebra.program import Compiled, evaluate
from controllers.haptic_map.base import HapticMap
from controllers.haptic_map.lifted import Lifted
from controllers.haptic_map.map_stages import evaluate_map_jacobian
from controllers.state import HandState, stylus_path
from experiments.config.modes import JointWalls
from experiments.fitting.figure_legs import figure_legs
from experiments.setups.modes.fixed_curve import figure_walls
from experiments.setups.session import Session
from geometry.arrays import Array, IntArray
from models.humanoid.skeleton import figure_model
from models.mocap.library import embedded, embedded_names
from sim.compilation.compiled import entry_point
from sim.compilation.kernel_units import linked_stages

_ROUNDS = 7  # of which the fastest counts


def _microseconds(call: Callable[[], object], calls: int) -> float:
    times: list[float] = []
    for _ in range(_ROUNDS):
        begin = time.perf_counter()
        call()
        times.append(time.perf_counter() - begin)
    return 1e6 * min(times) / calls


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
    memory, field, maps = program.fresh_memory(), program.compiled(), unlinked_maps(program.feeds)
    maps = maps._replace(stages=linked_stages(maps.stages))
    _evaluate_walls(maps, field, memory, hands[:2], wrench)
    return _microseconds(lambda: _evaluate_walls(maps, field, memory, hands, wrench), len(hands))
