"""Animations that the physical figure follows before a run: of hands that wander, are pushed, or change rivers."""

from collections.abc import Sequence

import mujoco
import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.fields.algebra.instructions import TRACE_PHASE, TRACE_RIVER, TRACE_SIZE
from controllers.haptic_map.composite import Composite
from controllers.haptic_map.cylindrical import Cylindrical
from controllers.haptic_map.lifted import Lifted
from controllers.haptic_map.lifting.arrangement_energy import PUSH_SPEED
from controllers.haptic_map.river_clips import RiverClips
from controllers.haptic_map.river_memory import ACTIVE_RIVER, TIMING_RIVER
from controllers.state import stylus_path
from experiments.config.run_config import Figure
from experiments.fitting.animation_trial import FPS, AnimationTrial
from experiments.fitting.figure_legs import packed_legs
from experiments.preparation.followed import TRIAL_SECONDS
from geometry.arrays import Array
from geometry.easing import cubic_steps, smooth_steps
from models.mocap.motion.clip import Clip
from sim.reference.reference import make_reference, map_poses, reference_along

_DOMAIN_FRACTION = 0.17  # offset by a push as a share of the domain: 2.5 N against 300 N/m, over 50 mm
_PUSH_OFFSET = 8e-3  # [m] offset by a push on a lifted map: 2.5 N against 300 N/m
_PUSH_INTERVAL, _PUSH_TIME = 1.7, 0.15  # [s] half the duration of a push, and its rise time
_GRID_SIZE = 500  # points at which a curve's radius and speed are taken
_ORDER = (0, 1, 2, 0, 2, 1, 0)  # of the three rivers: each change from one to another occurs once
_DWELL_TIME, _TRANSFER_TIME = 5.5, 0.3  # [s] on a river, enough for a gate and the transition; [s] to the next river
_RIVERS_DURATION = _DWELL_TIME * len(_ORDER)


def domain(haptic_map: Cylindrical | Composite) -> Array:
    """Intervals of r and z through which the hand moves [m], shape (2, 2)."""
    return np.array([haptic_map.r_range, haptic_map.z_range if isinstance(haptic_map, Cylindrical) else (0.0, 0.0)])


def poses_about_circle(haptic_map: Cylindrical | Composite, r: Array | float, angles: Array, z: Array | float) -> Array:
    """Poses of a map with the hand at cylindrical coordinates [m], [rad], shape (n, 75); needs compiled code."""
    points = np.broadcast_arrays(r * np.cos(angles), r * np.sin(angles), z)
    return map_poses(haptic_map, stylus_path(np.stack(points, axis=-1)))


def tour_duration(lap: float) -> float:
    """Duration of `tour_of_domain` [s]: two laps at least."""
    return max(TRIAL_SECONDS, 2.0 * lap)


def tour_of_domain(haptic_map: Cylindrical | Composite, lap: float, parallel: bool) -> Clip:
    """The animation of a hand that tours the domain of a map from its middle, with pushes outwards and inwards.

    The hand wanders at constant angular speed. A push does not change the speed along the path that the field imposes,
    so a hand pushed from radius R to r goes round at R/r of its angular speed, as in FOLLOW; with a `parallel` flow
    (`Follow.parallel`) its angular speed does not change. Where the tour has two laps only, a lap has an odd number of
    pushes, so that each part of the clips is met with a push outwards in one lap and inwards in the other. The tour
    takes `tour_duration`, and goes on for one second more.
    """
    seconds = tour_duration(lap)
    times = _times(seconds)
    odd = 2 * round(0.5 * (lap / (2.0 * _PUSH_INTERVAL) - 1.0)) + 1
    interval = 0.5 * lap / odd if seconds > TRIAL_SECONDS else _PUSH_INTERVAL
    turn, pushed = 2.0 * np.pi * times / seconds, _DOMAIN_FRACTION * _push_profile(times, interval)
    shares = np.stack([0.5 + 0.5 * np.sin(2.0 * turn) + pushed, 0.5 + 0.5 * np.sin(3.0 * turn)])
    low, high = domain(haptic_map).T
    r, z = low[:, None] + np.clip(shares, 0.0, 1.0) * (high - low)[:, None]
    middle = 0.5 * (low[0] + high[0])
    pace = middle / (middle + pushed * (high[0] - low[0]))
    elapsed = times if parallel else np.concatenate([[0.0], np.cumsum(pace[:-1])]) / FPS
    return Clip(poses_about_circle(haptic_map, r, 2.0 * np.pi / lap * elapsed, z), FPS, "blend")


def lap_left_alone(haptic_map: Cylindrical | Composite, lap: float) -> Clip:
    """The animation of a hand that goes round in the middle of a map's domain; it lasts as long as `tour_of_domain`."""
    times = _times(tour_duration(lap))
    r, z = domain(haptic_map).mean(axis=1)
    return Clip(poses_about_circle(haptic_map, r, 2.0 * np.pi / lap * times, z), FPS, "blend")


def tour_along_curve(haptic_map: Lifted, curve: Trajectory, keeps_pace: bool) -> Clip:
    """The animation of a hand that moves along a curve of a map at its pace and is pushed outwards and inwards.

    If the field does not keep the pace off the curve (`Follow.parallel`), a push does not change the hand's speed, so
    its angular speed is lower the further out it is. Where the curve's radius changes, a part of the push is along it,
    and speeds the hand up or slows it down in either flow.
    """
    times = _times(TRIAL_SECONDS)
    push = _push_profile(np.maximum(times - _PUSH_INTERVAL, 0.0), _PUSH_INTERVAL)
    points = curve.point(curve.start + _pushed_phases(curve, push, keeps_pace))
    points[:, :2] *= 1.0 + (_PUSH_OFFSET * push / np.hypot(points[:, 0], points[:, 1]))[:, None]
    return Clip(map_poses(haptic_map, stylus_path(points)), FPS, "pushed")


def _times(seconds: float) -> Array:
    return np.arange(round((seconds + 1.0) * FPS)) / FPS


def _push_profile(times: Array, interval: float) -> Array:
    """Offset of a hand that is pushed out (1) and in (-1) in turn at times (n,), for twice an interval each [s]."""
    phase = times / interval % 2.0
    ramp = np.minimum(phase, 2.0 - phase) * interval / _PUSH_TIME
    return np.asarray(cubic_steps(ramp) * np.where(times // (2.0 * interval) % 2.0 == 0.0, 1.0, -1.0))


def _pushed_phases(curve: Trajectory, push: Array, keeps_pace: bool) -> Array:
    """Phases since the curve's start [s] of a hand that is pushed by `push` (n,), 1 outwards and -1 inwards."""
    grid = np.linspace(0.0, curve.duration, _GRID_SIZE)
    points, velocities = curve.point(curve.start + grid), curve.velocity(curve.start + grid)
    radii, speeds = np.hypot(points[:, 0], points[:, 1]), np.linalg.norm(velocities, axis=1)
    outward = np.sum(points[:, :2] * velocities[:, :2], axis=1) / (radii * speeds)  # cosine of tangent and push
    added = PUSH_SPEED * outward / speeds
    phases = np.zeros(len(push))
    for k, share in enumerate(push[:-1]):
        radius, extra = np.interp(phases[k], grid, radii), share * np.interp(phases[k], grid, added)
        pace = (1.0 if keeps_pace else radius / (radius + _PUSH_OFFSET * share)) + extra
        phase = phases[k] + pace / FPS
        phases[k + 1] = phase % curve.duration if curve.periodic else min(max(phase, 0.0), curve.duration)
    return phases


def tour_of_rivers(haptic_map: RiverClips, part: Figure, figure: mujoco.MjModel) -> Clip:
    """The animation of a hand that moves at the rivers' pace and makes each change between two of the rivers once."""
    # The stylus filter begins at rest: its first second is dropped.
    times = np.arange(round((_RIVERS_DURATION + 2.0) * FPS)) / FPS - 1.0
    stop = np.clip(times // _DWELL_TIME, 0, len(_ORDER) - 1).astype(int)
    order = np.array(_ORDER)
    share = smooth_steps((times - _DWELL_TIME * stop) / _TRANSFER_TIME)[:, None]
    phases = np.array([curve.start + times % curve.duration for curve in haptic_map.curves])
    points = np.array([curve.point(phase) for curve, phase in zip(haptic_map.curves, phases, strict=True)])
    rows = np.arange(len(times))
    current, previous = points[order[stop], rows], points[order[np.maximum(stop - 1, 0)], rows]
    traces, poses = np.zeros((len(times), TRACE_SIZE)), np.empty((len(times), haptic_map.nq))
    traces[:, TRACE_RIVER], traces[:, TRACE_PHASE] = order[stop], phases[order[stop], rows]
    reference = make_reference(
        figure, haptic_map.compiled(), 1.0 / FPS, part.smoothing, part.blend, packed_legs(figure)
    )
    reference_along(reference, stylus_path(previous + share * (current - previous)), traces, poses)
    return Clip(poses[times >= 0.0], FPS, "rivers")


def round_of_river(haptic_map: RiverClips, river: int) -> Clip:
    """The animation of a hand that goes round one river at its pace, for a round and `_DWELL_TIME` [s]."""
    curve = haptic_map.curves[river]
    times, memory = _times(haptic_map.round_seconds(river) + _DWELL_TIME), haptic_map.compiled().memory
    memory[ACTIVE_RIVER] = memory[TIMING_RIVER] = river
    points = curve.point(curve.start + times % curve.duration)
    return Clip(map_poses(haptic_map, stylus_path(points), memory), FPS, "alone")


def river_remarks(
    haptic_map: RiverClips, names: Sequence[str], part: Figure, figure: mujoco.MjModel
) -> tuple[str, ...]:
    """Remarks on what the physical figure does not follow on a map of three rivers; needs compiled code.

    Each clip is tried alone through a whole round, since the changes between the rivers show parts of long clips only.

    Parameters
    ----------
    haptic_map : RiverClips
        The map.
    names : sequence of str
        Names of the rivers' clips.
    part : Figure
        Settings of the figure; of these, the stylus filter and the duration of transitions are used.
    figure : mujoco.MjModel
        Model of the figure alone.
    """
    # Different clips may have one name, and one clip may have several rivers.
    alone = [line for river, name in enumerate(names) for line in _remark_on_river(haptic_map, river, name)]
    lines = tuple(dict.fromkeys(alone))
    made_of = (haptic_map.compiled().params, np.array([part.smoothing, part.blend]))
    trial = AnimationTrial(__name__, lambda: tour_of_rivers(haptic_map, part, figure), _RIVERS_DURATION, made_of)
    result = trial.followed()
    if result.stands:
        return lines
    where = ""
    if result.fell is not None:
        stop = min(int(result.fell // _DWELL_TIME), len(_ORDER) - 1)
        change = f"the change from {names[_ORDER[stop - 1]]} to {names[_ORDER[stop]]}"
        after = f", {result.fell - _DWELL_TIME * stop:.1f} s after {change}"
        where = after if stop else ", before any river changes"
    return (*lines, f"from river to river the physical figure {result}{where}")


def _remark_on_river(haptic_map: RiverClips, river: int, name: str) -> tuple[str, ...]:
    """Remark on a river whose clip the physical figure does not follow alone, through a round at the river's pace."""
    seconds, made_of = haptic_map.round_seconds(river), (haptic_map.compiled().params, np.array([river]))
    trial = AnimationTrial(__name__, lambda: round_of_river(haptic_map, river), seconds + _DWELL_TIME, made_of)
    result = trial.followed()
    pace = haptic_map.loops[river].duration / seconds
    remark = f"with {name} alone, at {pace:.2f} times its recorded speed, the physical figure {result}"
    return () if result.stands else (remark,)
