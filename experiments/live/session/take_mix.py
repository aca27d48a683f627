"""Comparison of takes, and mixing of one animation from several takes.

Two performances of a curve are not synchronous, as each has its own pace. A moment of one take therefore corresponds to
the moment of the other at which the stylus was at the same share of a lap.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from controllers.errors import ParameterError
from experiments.results.folder import RECORDING, has_animation
from experiments.results.measures.laps import counted_rivers, lap_durations, lap_steps
from geometry import quaternions
from geometry.arrays import Array
from geometry.easing import smooth_steps
from sim.errors import SimError
from sim.recording.recording import Recording

FPS = 50.0  # [Hz] frame rate at which takes are compared and exported, that of a run's BVH


@dataclass(frozen=True, eq=False)
class TakeData:
    """A take in memory, 50 frames a second.

    Attributes
    ----------
    name : str
        Name of its folder.
    poses : Array
        The animation as the hand made it, qpos, shape (n, 75).
    laps : Array
        Laps along the curve, or along the rivers that had the hand, shape (n,); the whole part counts whole laps.
    closed : bool
        Whether the curve is closed.
    path : Array
        Positions of the stylus in H [m], shape (n, 3).
    force, distance : Array
        Norm of the force on the hand [N], and distance from the curve [m], shape (n,).
    """

    name: str
    poses: Array = field(repr=False)
    laps: Array = field(repr=False)
    closed: bool
    path: Array = field(repr=False)
    force: Array = field(repr=False)
    distance: Array = field(repr=False)

    @property
    def times(self) -> Array:
        """Times of the frames [s], shape (n,)."""
        return np.arange(len(self.poses)) / FPS

    @staticmethod
    def of(folder: Path) -> "TakeData":
        """Read a take from its folder.

        Raises
        ------
        SimError
            If it holds no recording, or one without a figure.
        """
        with Recording(folder / RECORDING) as recording:
            if not has_animation(recording):
                raise SimError(f"{folder}: was recorded without a figure; expected a take with one")
            stride = max(1, round(recording.rates["frames"] / FPS))
            poses = recording.channel("frames", "reference")[::stride]
            every = stride * round(recording.rates["ticks"] / recording.rates["frames"])
            ticks = {
                name: recording.channel("ticks", name)[::every] for name in ("phase", "river", "p", "force", "distance")
            }
            spans = lap_durations(recording)
            closed = len(spans) > 1 or bool(recording.arrays["curve_closed"])
        phase, river = ticks["phase"], counted_rivers(ticks["river"], spans)
        laps = phase[0] / spans[river[0]] + np.append(0.0, np.cumsum(lap_steps(phase, river, spans, closed)))
        force = np.linalg.norm(ticks["force"], axis=1)
        return TakeData(folder.name, poses, laps, closed, ticks["p"], force, ticks["distance"])

    def frames_at(self, laps: Array) -> Array:
        """Fractional frame numbers at which the take is at given `laps`; on a closed curve, in the nearest lap.

        Raises
        ------
        ParameterError
            If the take does not pass these places.
        """
        own, wanted = np.maximum.accumulate(self.laps), laps
        if self.closed:
            wanted = laps + np.round(np.mean([own[0], own[-1]]) - np.mean(laps))
        tolerance = 0.05 * (1.0 if self.closed else own[-1] - own[0])
        if wanted[0] < own[0] - tolerance or wanted[-1] > own[-1] + tolerance:
            raise ParameterError(
                f"{self.name} goes from {own[0]:.2f} to {own[-1]:.2f} laps, the region from {wanted[0]:.2f} to "
                f"{wanted[-1]:.2f}; expected a region that both takes go through"
            )
        return np.interp(wanted, own, np.arange(len(own), dtype=np.float64))


class Region(NamedTuple):
    """Span of time [s] of a take in which another take replaces it."""

    start: float
    end: float
    take: TakeData


def mixed(take: TakeData, regions: Sequence[Region], ease: float = 0.3) -> Array:
    r"""Poses of a take in which regions are replaced by other takes, shape (n, 75).

    .. math:: q = q_a \exp\bigl(s \log(q_a^{-1} q_b)\bigr), \qquad s = \sigma(x)

    with σ = x³ (10 − 15 x + 6 x²) over `ease` [s] within each end of a region, so that velocity and acceleration are
    continuous. Later regions overwrite earlier ones.

    Raises
    ------
    ParameterError
        If a region is not in the take, too short to ease in and out, or of phases that the other take does not pass.
    """
    poses, times = take.poses.copy(), take.times
    for start, end, other in regions:
        if not 0.0 <= start < end <= times[-1] + 1.0 / FPS:
            raise ParameterError(
                f"the region is {start:g} to {end:g} s; expected two times from 0 to {times[-1]:.1f} s"
            )
        if end - start < 2.0 * ease:
            raise ParameterError(f"the region lasts {end - start:.2f} s; expected {2.0 * ease:g} s or more")
        rows = np.flatnonzero((times >= start) & (times <= end))
        other_poses = _interpolate_frames(other.poses, other.frames_at(np.maximum.accumulate(take.laps)[rows]))
        edge = np.minimum(times[rows] - start, end - times[rows]) / ease
        poses[rows] = between(poses[rows], other_poses, smooth_steps(edge))
    return poses


def between(start: Array, end: Array, share: Array) -> Array:
    """Interpolate poses (n, 75) with shares (n,): linearly for the root position, by slerp for the rotations."""
    shape = (len(start), -1, 4)
    rotations = quaternions.slerped(start[:, 3:].reshape(shape), end[:, 3:].reshape(shape), share[:, None, None])
    return np.hstack([start[:, :3] + share[:, None] * (end - start)[:, :3], rotations.reshape(len(start), -1)])


def _interpolate_frames(poses: Array, frames: Array) -> Array:
    """Poses at fractional frame numbers, shape (k,) → (k, 75)."""
    low = np.clip(np.floor(frames).astype(int), 0, len(poses) - 1)
    high = np.minimum(low + 1, len(poses) - 1)
    return between(poses[low], poses[high], frames - low)
