"""Lifting: curves in the device's workspace from clips alone (Donald & Henle 2000, section 8.1, left open there).

Four steps, each a module: motions become points of a Euclidean space (`motion_features`); all are aligned in time to
one lap (`common_lap`); moments at which two motions nearly agree are found (`transitions`); and the curves are arranged
to reproduce the distances of the motions, far apart where motions differ and near at transitions (`arrangement`). The
results are the angles and sites of a `Lifted` map, which is exact on every clip for any angles and sites.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from controllers.errors import ParameterError
from controllers.haptic_map.lifting.arrangement import arrange
from controllers.haptic_map.lifting.arrangement_energy import N_ANGLES, Task, sites_of
from controllers.haptic_map.lifting.common_lap import N_SAMPLES, Phase, common_lap
from controllers.haptic_map.lifting.curve_measures import ArrangementMeasure, measure
from controllers.haptic_map.lifting.frames import closing_gap
from controllers.haptic_map.lifting.layouts import lattice
from controllers.haptic_map.lifting.motion_features import Features, Motion, features
from controllers.haptic_map.lifting.room import Room
from controllers.haptic_map.lifting.transitions import Comparison, Transition, compare, find_transitions, same_motions
from controllers.motion.loops import MAX_CLOSURE_GAP
from geometry.arrays import Array, Mask

_MIN_FRAMES = 4  # frames that a cubic spline needs


class Lifting(NamedTuple):
    """Curves of clips, as arguments of `Lifted`, and their measures.

    Attributes
    ----------
    angles : tuple of Array
        θ of every frame of each clip [rad].
    sites : Array, shape (rows, n, 2)
        (r, z) [m].
    transitions : tuple of Transition
        Transitions, the best first.
    same : tuple of (int, int)
        Pairs of clips with the same motion, whose curves are still kept apart.
    still : tuple of int
        Clips in which nothing moves.
    before, after : ArrangementMeasure
        Measures of the layout by mean distances alone, and of the arrangement.
    distance : float
        Mean over the lap and all pairs of the distance between poses [m].
    """

    angles: tuple[Array, ...]
    sites: Array
    transitions: tuple[Transition, ...]
    same: tuple[tuple[int, int], ...]
    still: tuple[int, ...]
    before: ArrangementMeasure
    after: ArrangementMeasure
    distance: float


def lift(motions: Sequence[Motion], weights: Array, room: Room, rng: np.random.Generator) -> Lifting:
    """Author a curve for every clip.

    Parameters
    ----------
    motions : sequence of Motion
        Clips of any lengths and frame rates.
    weights : Array, shape (1 + joints,)
        Displacement of the body per radian of root and joints, RMS over its mass [m].
    room : Room
    rng : numpy.random.Generator
        Draws the initial guesses of the arrangement.

    Raises
    ------
    ParameterError
        If there is no clip, one has fewer than four frames, is given as closed but does not close, or is too fast for
        the innermost radius; or if there is no room for all clips.
    """
    clips = list(motions)
    if not clips:
        raise ParameterError("no clips to lift; expected one or more")
    for motion in clips:
        _check_motion(motion)
    _check_room(len(clips), room)
    clip_features = [features(motion, weights, N_SAMPLES) for motion in clips]
    phases = common_lap(clips, clip_features)
    laps = np.array([clip.duration / (1.0 - phase.gap) for clip, phase in zip(clips, phases, strict=True)])
    compared = _compare_clips(clip_features, phases, laps)
    transitions = find_transitions(compared, room.alike, [clip.strides for clip in clips])
    rate, change = _angular_rates(clips, phases)
    _check_speeds(clips, rate, change, room)
    task = Task(
        room.rectangle, room.separation, room.approach, room.speed, room.acceleration, compared.distance, transitions,
        rate, change,
    )  # fmt: skip
    controls, start = arrange(task, rng)
    still = [i for i, each in enumerate(clip_features) if float(np.abs(each.velocity).max()) < 1e-6]
    pairs = np.triu_indices(len(clips), 1)
    return Lifting(
        angles=tuple(phase.angles(len(motion.poses)) for motion, phase in zip(clips, phases, strict=True)),
        sites=sites_of(controls),
        transitions=tuple(transitions),
        same=tuple(same_motions(compared)),
        still=tuple(still),
        before=measure(task, start),
        after=measure(task, controls),
        distance=float(compared.distance[:, pairs[0], pairs[1]].mean()) if len(clips) > 1 else 0.0,
    )


def _check_motion(motion: Motion) -> None:
    if len(motion.poses) < _MIN_FRAMES:
        raise ParameterError(
            f"clip {motion.name!r} has {len(motion.poses)} frames, and a curve needs {_MIN_FRAMES}; give a longer "
            "clip, or one with more frames a second"
        )
    gap = closing_gap(motion.poses) if motion.closed else 0.0
    if gap > MAX_CLOSURE_GAP:
        raise ParameterError(
            f"clip {motion.name!r} is given as cyclic, but its last frame is {gap:.2g} (m, or half radians) from its "
            "first one moved over the ground; lift it as an open clip, or cut it where it repeats"
        )


def _check_room(n: int, room: Room) -> None:
    fits = len(lattice(room.rectangle, room.separation))
    if n <= fits:
        return
    closer = room.separation
    while len(lattice(room.rectangle, closer)) < n:
        closer *= 0.98
    raise ParameterError(
        f"{n} clips do not fit {1e3 * room.separation:g} mm apart into r {room.r_range}, z {room.z_range} m: "
        f"{fits} do; give fewer, a separation of {1e3 * closer:.1f} mm, or a larger rectangle"
    )


def _check_speeds(clips: list[Motion], rate: Array, change: Array, room: Room) -> None:
    inner = room.r_range[0]
    speed = inner * np.abs(rate).max(axis=0)
    pull = inner * np.hypot(rate**2, change).max(axis=0)
    for motion, v, a in zip(clips, speed, pull, strict=True):
        over = max(v / room.speed, np.sqrt(a / room.acceleration))
        if over > 1.0:
            raise ParameterError(
                f"clip {motion.name!r} goes round in {motion.duration:.2f} s: at the innermost radius that is {v:.2f} "
                f"m/s and {a:.1f} m/s², more than {room.speed:g} m/s or {room.acceleration:g} m/s²; slow it down to "
                f"{over * motion.duration:.2f} s, or give a smaller inner radius"
            )


def _compare_clips(clip_features: list[Features], phases: list[Phase], laps: Array) -> Comparison:
    lap = np.arange(N_ANGLES) / N_ANGLES
    moments: list[Features] = []
    inside: list[Mask] = []
    for each, phase in zip(clip_features, phases, strict=True):
        s = phase.share(lap)
        if phase.gap == 0.0:
            moments.append(each.at(np.mod(s, 1.0)))
            inside.append(np.ones(N_ANGLES, dtype=np.bool_))
            continue
        # In the gap an open clip returns from its end to its start; no transition may lie there.
        back = np.clip((s - 1.0) * (1.0 - phase.gap) / phase.gap, 0.0, 1.0)
        moments.append(each.at(np.where(s <= 1.0, np.clip(s, 0.0, 1.0), 1.0 - back)))
        inside.append(s <= 1.0)
    return compare(moments, np.stack(inside, axis=1), laps)


def _angular_rates(clips: list[Motion], phases: list[Phase]) -> tuple[Array, Array]:
    """θ̇ and θ̈ of each clip at its own pace, at equal steps of θ, shape (N_ANGLES, n)."""
    lap = np.arange(N_ANGLES) / N_ANGLES
    rates: list[Array] = []
    changes: list[Array] = []
    for motion, phase in zip(clips, phases, strict=True):
        since = np.mod(lap - phase.start, 1.0)
        slope = 1.0 / (1.0 - phase.gap) + phase.lead(since, 1)
        rate = 2.0 * np.pi / (motion.duration * slope)
        rates.append(rate)
        # dθ̇/dt = θ̇ dθ̇/dθ, and θ̇ is inversely proportional to the slope of the share.
        changes.append(-(rate**2) * phase.lead(since, 2) / (2.0 * np.pi * slope))
    return np.stack(rates, axis=1), np.stack(changes, axis=1)


def closes(poses: Array) -> bool:
    """Whether a clip that passed `checked_clip` can be lifted as a closed curve."""
    return len(poses) >= _MIN_FRAMES and closing_gap(poses) <= MAX_CLOSURE_GAP
