"""Measures of a run in LEADING, from its recording and the walked path."""

import math
from dataclasses import dataclass

import numpy as np

from controllers.walking.gait import Gait
from controllers.walking.walked_path import PATH_HEADING, path_value
from controllers.walking.walker import walker_at
from experiments.results.measures.blocks import BLOCK_FRAMES
from experiments.results.measures.soles import Soles
from experiments.results.measures.summary_parts import FigureSummary
from geometry.arrays import Array, IntArray
from geometry.quaternions import heading
from models.humanoid.skeleton import N_POSE
from models.world.scene import SceneConfig
from sim.recording.recording import Recording

# [m] and [rad] weighted equally in the search for the nearest earlier pose
_DISTANCE_SCALE, _TURN_SCALE = 0.01, math.radians(2.0)
_LEAST_LIMITED = 0.05  # [N] difference of the force from the field's that counts: ramps and rounding are smaller
_MAX_STORED_POSES = 6000  # poses of the outward path that are kept, one per centimetre


@dataclass(frozen=True)
class LeadSummary:
    """How a figure was led.

    Attributes
    ----------
    length_m : float
        Length of the path walked forwards since the recording began.
    turn_deg_per_s : tuple of three float
        Largest turn rates of the path while the figure went along it on no foot, on one foot and on two.
    force_max : float
        Largest force that the hand felt in the horizontal plane [N].
    limited_s : float
        For how long the field asked for more than the motors bear [s].
    slide_cm : float
        Largest slide of a point of the animation's soles while in contact (`Soles`).
    physical_slide_cm : float or None
        The same for the physical figure's soles, which roll, until its first fall; None without a physical figure.
    retrace_cm, retrace_deg : float or None
        On the way back, largest distance and yaw difference of the animation's root from its outward path; None if it
        never went back.
    physical_retrace_cm, physical_retrace_deg : float or None
        The same for the physical figure, until its first fall; None without one.
    """

    length_m: float
    turn_deg_per_s: tuple[float, float, float]
    force_max: float
    limited_s: float
    slide_cm: float
    physical_slide_cm: float | None
    retrace_cm: float | None
    retrace_deg: float | None
    physical_retrace_cm: float | None
    physical_retrace_deg: float | None

    def lines(self) -> list[str]:
        """Measures in words, one sentence per line."""
        none, one, two = self.turn_deg_per_s
        back = "The figure was not led back."
        if self.retrace_cm is not None:
            back = f"On the way back it retraced its path within {self.retrace_cm:.2f} cm and {self.retrace_deg:.2f}°"
            if self.physical_retrace_cm is not None:
                back += (
                    f", the physical figure within {self.physical_retrace_cm:.1f} cm and "
                    f"{self.physical_retrace_deg:.1f}°"
                )
            back += "."
        limited = (
            f"; for {self.limited_s:.1f} s the field asked for more than the motors bear"
            if self.limited_s > 0.0
            else ""
        )
        slid = (
            ""
            if self.physical_slide_cm is None
            else f", the physical figure's by up to {self.physical_slide_cm:.1f} cm"
        )
        return [
            f"The figure was led {self.length_m:.1f} m, turning by up to {two:.0f}°/s on two feet, {one:.0f}°/s on one "
            f"and {none:.0f}°/s on none; its soles slid by up to {self.slide_cm:.1f} cm{slid}.",
            f"{back} The hand felt up to {self.force_max:.1f} N{limited}.",
        ]


def lead_summary(
    recording: Recording, gait: Gait, walkers: Array, scene: SceneConfig, figure: FigureSummary | None
) -> LeadSummary:
    """Measure a run in constant memory, given its gait, its walker's last state, and measures of a physical figure."""
    ticks, frames = recording.groups["ticks"], recording.groups["frames"]
    every = round(recording.rates["ticks"] / recording.rates["frames"])
    root = frames["qpos"].shape[1] - N_POSE
    soles, pressing, shown, physical = Soles(scene), Soles(scene, physical=True), _Retrace(), _Retrace()
    farthest, force, limited, turns = -math.inf, 0.0, 0, np.zeros(3)
    for first in range(0, len(frames["t"]), BLOCK_FRAMES):
        rows = slice(first, first + BLOCK_FRAMES)
        t, reference, poses = frames["t"][rows], frames["reference"][rows], frames["qpos"][rows][:, root:]
        s = ticks["phase"][first * every : (first + len(t)) * every : every]
        if len(t) > 1:
            turns = np.maximum(turns, turn_rates(gait, walkers, s, np.gradient(s, t)))
        span = slice(first * every, (first + len(t)) * every)
        felt, asked = ticks["force"][span], ticks["field"][span][:, :3]
        force = max(force, float(np.linalg.norm(felt[:, :2], axis=1).max(initial=0.0)))
        limited += int(np.count_nonzero(np.linalg.norm(asked - felt, axis=1) > _LEAST_LIMITED))
        soles.add(reference)
        shown.add(s, reference, farthest)
        if figure is not None:
            standing = t < (math.inf if figure.fell_at is None else figure.fell_at)
            pressing.add(poses[standing])
            physical.add(s[standing], poses[standing], farthest)
        farthest = max(farthest, float(s.max()))
    none, one, two = (math.degrees(rate) for rate in turns)
    return LeadSummary(
        farthest - float(ticks["phase"][0]), (none, one, two), force, limited / recording.rates["ticks"],
        100.0 * soles.slide, None if figure is None else 100.0 * pressing.slide, *shown.result(), *physical.result(),
    )  # fmt: skip


def support_at(gait: Gait, s: Array) -> IntArray:
    """Number of feet in support at arc lengths s [m], shape (n,)."""
    lap, counts = s / gait.stride, gait.support
    return counts[(len(counts) * (lap - np.floor(lap))).astype(int) % len(counts)]


def turn_rates(gait: Gait, walkers: Array, s: Array, speed: Array) -> Array:
    """Largest turn rates [rad/s] of the path at arc lengths s [m] passed at speeds [m/s]: on no foot, one, two."""
    path = walker_at.py_func(walkers, 0).path
    rates = np.abs(speed * [path_value(path, float(place), PATH_HEADING)[1] for place in s])
    feet = support_at(gait, s)
    return np.array([rates[feet == count].max(initial=0.0) for count in range(3)])


class _Retrace:
    """Deviation of a figure, while it is led back, from its own outward path."""

    def __init__(self) -> None:
        self._outward_path = np.empty((0, 4))
        self._distance, self._turn = -1.0, 0.0

    def add(self, s: Array, poses: Array, farthest: float) -> None:
        """Add a block of arc lengths [m] and poses; `farthest` is the largest arc length before the block."""
        if len(s) == 0:
            return
        front = np.maximum.accumulate(np.concatenate(([farthest], s)))
        rows = np.stack([s, poses[:, 0], poses[:, 1], heading(poses[:, 3:7])], axis=1)
        new = (s > front[:-1]) & (np.floor(100.0 * s) > np.floor(100.0 * front[:-1]))
        self._outward_path = np.concatenate([self._outward_path, rows[new]])[-_MAX_STORED_POSES:]
        for place, ahead in zip(rows, front[1:], strict=True):
            # Near the turning point the filtered figure lags behind, and its outward path is not yet recorded there.
            if ahead - place[0] > 0.1:
                self._compare(place)

    def _compare(self, place: Array) -> None:
        near = self._outward_path[np.abs(self._outward_path[:, 0] - place[0]) < 0.3]
        # Behind the start there is no outward path to compare with.
        if len(near) < 2 or place[0] < self._outward_path[0, 0]:
            return
        start, step = near[:-1], np.diff(near, axis=0)
        step[:, 3] = np.remainder(step[:, 3] + np.pi, 2.0 * np.pi) - np.pi
        length = np.maximum((step[:, 1:3] ** 2).sum(axis=1), 1e-12)
        share = np.clip(((place[1:3] - start[:, 1:3]) * step[:, 1:3]).sum(axis=1) / length, 0.0, 1.0)
        apart = np.linalg.norm(start[:, 1:3] + share[:, None] * step[:, 1:3] - place[1:3], axis=1)
        turn = np.remainder(place[3] - start[:, 3] - share * step[:, 3] + np.pi, 2.0 * np.pi) - np.pi
        # A swaying pelvis passes a place more than once or turns on the spot, so position and yaw decide together.
        k = int(np.argmin(np.hypot(apart / _DISTANCE_SCALE, turn / _TURN_SCALE)))
        self._distance, self._turn = max(self._distance, float(apart[k])), max(self._turn, abs(float(turn[k])))

    def result(self) -> tuple[float | None, float | None]:
        """Largest distance [cm] and yaw difference [degrees]; None if the figure never went back."""
        if self._distance < 0.0:
            return None, None
        return 100.0 * self._distance, math.degrees(self._turn)
