"""Quality of a map of clips: conditioning and smoothness of its derivative h_*, and the motions between its curves."""

from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import mujoco
import numpy as np

from controllers.blending.pair_corrections import neighbouring_pairs
from controllers.certificates.flight.flight_fit import find_flights, fit_free_fall
from controllers.haptic_map.animation import ClipMap
from controllers.state import stylus_path
from experiments.results.measures.soles import Soles
from geometry.arrays import Array
from models.humanoid.skeleton import figure_model, rest_pose
from models.mocap.dynamics.contacts import contacts
from models.mocap.dynamics.momentum import momentum
from models.mocap.motion.clip import Clip
from models.mocap.motion.ranges import beyond_ranges
from models.world.scene import SceneConfig
from sim.reference.reference import map_derivatives, map_poses


class MotionMeasure(NamedTuple):
    """Largest faults of a motion.

    Attributes
    ----------
    limits : float
        Excess of a joint over its limits [rad].
    slide : float
        Largest slide of a point of the soles (`experiments.results.measures.soles`) [m].
    penetration : float
        Depth of the body below the floor [m].
    ballistic : float
        Distance of the centre of mass from the best-fitting free fall in flights [m]; 0 without a flight.
    """

    limits: float
    slide: float
    penetration: float
    ballistic: float

    @staticmethod
    def worst(measures: "list[MotionMeasure]") -> "MotionMeasure":
        """The largest of each measure; zeros for an empty list."""
        return MotionMeasure(*np.max([MotionMeasure(0.0, 0.0, 0.0, 0.0), *measures], axis=0).tolist())


def measure_motion(clip: Clip) -> MotionMeasure:
    """Measure a clip on the default figure."""
    floor, feet = contacts(clip), Soles(SceneConfig())
    feet.add(clip.poses)
    com = momentum(clip).com
    spans = find_flights(floor.supported, clip.fps)
    return MotionMeasure(
        limits=max(0.0, float(beyond_ranges(clip.poses).max())),
        slide=feet.slide,
        penetration=float(max(0.0, -floor.clearance.min())),
        ballistic=max((fit_free_fall(com[a : b + 1], clip.fps, 1.0)[0] for a, b in spans), default=0.0),
    )


N_SAMPLES = 96  # samples of the lap
_PROBE_COUNT = 400  # random places at which smoothness is measured
_STEP = 1e-5  # [m] step of the differences of h_*
_FPS = 60.0  # frame rate of in-betweens [1/s]


def body_weights() -> Array:
    """RMS displacement of the default figure's mass by a radian of root and joints [m/rad], shape (18,).

    √(I_k / M), with I_k the mean moment of inertia, about joint k, of the segments distal to it in the rest pose; the
    root rotates the body about its centre of mass.
    """
    model = figure_model()
    data = mujoco.MjData(model)
    data.qpos = rest_pose()
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mass, centres = model.body_mass, data.xipos
    weights: list[float] = []
    for body in range(1, model.nbody):
        pivot = data.subtree_com[1] if body == 1 else data.xpos[body]
        subtree = [b for b in range(1, model.nbody) if _is_ancestor(model, body, b)]
        inertia = sum(
            float(2.0 / 3.0 * mass[b] * ((centres[b] - pivot) ** 2).sum() + model.body_inertia[b].mean())
            for b in subtree
        )
        weights.append(float(np.sqrt(inertia / mass.sum())))
    return np.array(weights)


def _is_ancestor(model: mujoco.MjModel, body: int, other: int) -> bool:
    while other > body:
        other = int(model.body_parentid[other])
    return other == body


@dataclass(frozen=True, eq=False)
class Layout:
    """A map and the places of its clips.

    Attributes
    ----------
    haptic_map : ClipMap
        The map.
    names : tuple of str
        Names of its n clips.
    sites : Array, shape (SAMPLES, n, 2)
        (r, z) of each clip [m], at equal steps of θ.
    times : Array, shape (SAMPLES + 1, n)
        Time in each clip since θ = 0, round the lap [s].
    """

    haptic_map: ClipMap
    names: tuple[str, ...]
    sites: Array
    times: Array

    def neighbours(self) -> list[tuple[int, int]]:
        """Pairs of clips with no other between them over half of the lap."""
        return neighbouring_pairs(self.sites, 0.5)


class MapQuality(NamedTuple):
    """Measures of a map of clips.

    Attributes
    ----------
    separation : float
        Least distance of two clips' curves at one angle [m].
    conditioning : (float, float)
        Condition number of h_* along the curves, with poses in metres (`body_weights`): median and 90th percentile.
    conditioning_between : (float, float)
        The same half way between neighbours.
    roughness : (float, float)
        Relative change of h_* per millimetre between neighbours: median and 90th percentile [1/mm].
    between : dict of MotionMeasure
        Measures of in-betweens half way between neighbours, by their names.
    clips : MotionMeasure
        The largest measures of the clips themselves.
    """

    separation: float
    conditioning: tuple[float, float]
    conditioning_between: tuple[float, float]
    roughness: tuple[float, float]
    between: dict[str, MotionMeasure]
    clips: MotionMeasure


def measure_map(layout: Layout, clips: tuple[Clip, ...], rng: np.random.Generator) -> MapQuality:
    """Measure a map on the default figure."""
    scale = np.concatenate([np.ones(3), np.repeat(body_weights(), 3)])[:, None]
    pairs, sites, n = layout.neighbours(), layout.sites, len(layout.names)
    distance = [np.linalg.norm(sites[:, i] - sites[:, j], axis=1).min() for i, j in combinations(range(n), 2)]
    angles = 2.0 * np.pi * np.arange(N_SAMPLES) / N_SAMPLES
    along = [_condition_numbers(layout, scale, angles, sites[:, i]) for i in range(n)]
    halfway = [_condition_numbers(layout, scale, angles, 0.5 * (sites[:, i] + sites[:, j])) for i, j in pairs]
    return MapQuality(
        separation=float(min(distance, default=np.inf)),
        conditioning=_median_and_p90(np.concatenate(along)),
        conditioning_between=_median_and_p90(np.concatenate(halfway)) if pairs else (np.nan, np.nan),
        roughness=_roughness(layout, scale, pairs, rng),
        between={f"{layout.names[i]} – {layout.names[j]}": measure_motion(in_between(layout, i, j)) for i, j in pairs},
        clips=MotionMeasure.worst([measure_motion(clip) for clip in clips]),
    )


def _median_and_p90(values: Array) -> tuple[float, float]:
    # Without interpolation: the value is infinite where the map is singular.
    middle, high = np.quantile(values, [0.5, 0.9], method="higher")
    return float(middle), float(high)


def _stylus_poses(angles: Array, places: Array) -> Array:
    """Poses (n, 7) of an upright stylus at angles (n,) and places (r, z) [m], shape (n, 2)."""
    return stylus_path(np.column_stack([places[:, 0] * np.cos(angles), places[:, 0] * np.sin(angles), places[:, 1]]))


def _condition_numbers(layout: Layout, scale: Array, angles: Array, places: Array) -> Array:
    jacobians = scale * map_derivatives(layout.haptic_map, _stylus_poses(angles, places))[:, :, :3]
    sigma = np.linalg.svd(jacobians, compute_uv=False)
    regular = sigma[:, 2] > 1e-9 * sigma[:, 0]
    return np.where(regular, sigma[:, 0] / np.where(regular, sigma[:, 2], 1.0), np.inf)


def _roughness(
    layout: Layout, scale: Array, pairs: list[tuple[int, int]], rng: np.random.Generator
) -> tuple[float, float]:
    if not pairs:
        return np.nan, np.nan
    points, steps = np.empty((_PROBE_COUNT, 7)), np.zeros((_PROBE_COUNT, 7))
    for k in range(_PROBE_COUNT):
        i, j = pairs[int(rng.integers(len(pairs)))]
        row, share = int(rng.integers(N_SAMPLES)), float(rng.uniform())
        place = (1.0 - share) * layout.sites[row, i] + share * layout.sites[row, j]
        points[k] = _stylus_poses(np.array([2.0 * np.pi * row / N_SAMPLES]), place[None])[0]
        steps[k, :3] = rng.normal(size=3)
    steps *= _STEP / np.linalg.norm(steps, axis=1, keepdims=True)
    here, there = (scale * map_derivatives(layout.haptic_map, points + side * steps)[:, :, :3] for side in (-0.5, 0.5))
    size = (1, 2)  # Frobenius norm of each derivative
    return _median_and_p90(np.linalg.norm(there - here, axis=size) / (np.linalg.norm(here, axis=size) * _STEP) / 1e3)


def in_between(layout: Layout, i: int, j: int) -> Clip:
    """The animation of a lap half way between two clips, with the mean of their timings."""
    lap = 0.5 * (layout.times[:, i] + layout.times[:, j])
    frames = max(8, round(float(lap[-1]) * _FPS))
    # The end point is left out: it is the first frame of the next lap.
    samples = np.interp(np.linspace(0.0, lap[-1], frames, endpoint=False), lap, np.arange(N_SAMPLES + 1))
    closed = np.concatenate([layout.sites, layout.sites[:1]])
    middle = 0.5 * (closed[:, i] + closed[:, j])
    places = np.stack([np.interp(samples, np.arange(N_SAMPLES + 1), middle[:, k]) for k in range(2)], axis=1)
    poses = map_poses(layout.haptic_map, _stylus_poses(2.0 * np.pi * samples / N_SAMPLES, places))
    return Clip(poses, frames / float(lap[-1]), f"{layout.names[i]}-{layout.names[j]}")


def lap_times(angles: Array, duration: float) -> Array:
    """Time in a clip since θ = 0 [s] at SAMPLES + 1 equal steps of θ to 2π, from its frames' angles [rad].

    Where the clip leaves a gap in the lap, time is linear in θ.
    """
    share = np.linspace(0.0, 1.0, len(angles))
    step = 2.0 * np.pi * np.arange(N_SAMPLES + 1) / N_SAMPLES
    lap = duration * 2.0 * np.pi / (angles[-1] - angles[0])
    # Two laps, since the first frame may be at any angle.
    knots = np.concatenate([angles - 2.0 * np.pi, angles])
    times = np.concatenate([share * duration - lap, share * duration])
    keep = np.concatenate([[True], np.diff(knots) > 0.0])
    knots, times = np.append(knots[keep], knots[-1] + 2.0 * np.pi), np.append(times[keep], times[-1] + lap)
    found = np.interp(step, knots, times)
    return found - found[0]
