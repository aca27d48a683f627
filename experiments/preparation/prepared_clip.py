"""Prepared clips for runs: motion files that `hvf prepare` did not write are prepared once and cached."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from experiments.console.progress import working
from experiments.files.array_cache import cached_array, is_cached
from geometry.arrays import Array
from models.mocap.library import Loaded, load
from models.mocap.motion.clip import CLOSURE_TOLERANCE, Clip
from models.mocap.preparation.bounds import MAX_END_SPEED
from sim.compilation.workers import run_in_workers

# A change of this module, or of any that it imports, invalidates the cache.
_PREPARING_MODULE = "models.mocap.preparation.prepare"
_MOST_OF_IT = 0.95  # share of an edited animation whose cycle is named if it is less


class PreparedClip(NamedTuple):
    """A clip for a run.

    Attributes
    ----------
    clip : Clip
        The prepared clip; unchanged if it is in the file as `is_prepared` says.
    remarks : tuple of str
        What the file lacks, what was assumed or repaired, and what was done with it, a line each.
    feasible : bool
        False if the capture was prepared, but no motion near it is feasible by contact forces.
    """

    clip: Clip
    remarks: tuple[str, ...]
    feasible: bool = True


def prepared_clips(paths: Sequence[Path], raw: bool = False, loop: str = "auto") -> list[PreparedClip]:
    """The motions in files, prepared in parallel; prepared ones (`is_prepared`), and all if `raw`, are used unchanged.

    Prepared clips are cached under a hash of the captured poses and of the code that prepares them. `loop` is ``auto``
    or ``lap`` (`models.mocap.preparation.looping.close_or_rest`).

    Raises
    ------
    ModelError
        If a file cannot be read, or contradicts itself.
    """
    captures = [_Capture(path, load(path), loop) for path in paths]
    missing = (
        {} if raw else {capture.path: capture for capture in captures if capture.unprepared and not capture.is_kept}
    )
    if len(missing) > 1:
        with working(f"preparing {len(missing)} captures", sum(one.loaded.clip.duration for one in missing.values())):
            run_in_workers([(prepared_clips, ([path], raw, loop)) for path in missing])
    return [capture.prepared(raw) for capture in captures]


def is_prepared(loaded: Loaded) -> bool:
    """Whether a file has a prepared clip: on the figure's own skeleton, and closed or at rest at both ends.

    The animation of a run, or a capture that is only converted, goes on beyond its ends: closed over them, its feet
    slide by a metre, and the figure falls there.
    """
    clip = loaded.clip
    return loaded.report is None and (clip.closes(CLOSURE_TOLERANCE) or clip.end_speed() <= MAX_END_SPEED)


class _Capture(NamedTuple):
    """A motion file that was read, and its cached preparation."""

    path: Path
    loaded: Loaded
    loop: str

    @property
    def unprepared(self) -> bool:
        if self.loop == "lap" and not self.loaded.clip.closes(CLOSURE_TOLERANCE):
            return True
        return not is_prepared(self.loaded)

    @property
    def is_kept(self) -> bool:
        return is_cached(_PREPARING_MODULE, "prepared", self._cache_key, self._shape)

    @property
    def _cache_key(self) -> tuple[Array, Array]:
        clip, loops = self.loaded.clip, self.loaded.loops
        return clip.poses, np.array([clip.fps, -1.0 if loops is None else float(loops), float(self.loop == "lap")])

    @property
    def _shape(self) -> tuple[int, int]:
        return -1, self.loaded.clip.poses.shape[1]

    def prepared(self, raw: bool) -> PreparedClip:
        clip, report = self.loaded.clip, self.loaded.report
        notes = () if report is None else tuple(f"{self.path.name}: {note}" for note in report.notes())
        if raw or not self.unprepared:
            return PreparedClip(clip, notes)
        rows = cached_array(_PREPARING_MODULE, "prepared", self._cache_key, self._shape, self._prepare)
        outcome = (
            "prepared" + self._part(rows[0, 2:5])
            if rows[0, 1]
            else "no feasible motion is near it: looped and smoothed alone, as `hvf prepare` reports"
        )
        remarks = (*notes, f"{self.path.name}: {outcome}; --raw takes the capture as it is")
        return PreparedClip(Clip(rows[1:], float(rows[0, 0]), clip.name), remarks, bool(rows[0, 1]))

    def _part(self, looped: Array) -> str:
        start, end, gap = looped
        if self.loop == "auto":
            if self.loaded.report is not None or end - start >= _MOST_OF_IT * self.loaded.clip.duration:
                return ""
            return f" from {start:.2f} to {end:.2f} s, its cycle (hvf prepare --loop open keeps all)"
        return f" from {start:.2f} to {end:.2f} s, the lap that repeats itself best (its ends were {gap:.0f}° apart)"

    def _prepare(self) -> Array:
        from models.mocap.preparation.prepare import prepared  # imported late: loads signal processing

        with working(f"preparing {self.path.name}"):
            result = prepared(self.path, self.loop)
        header = np.zeros((1, result.clip.poses.shape[1]))
        looped = result.looped
        header[0, :5] = result.clip.fps, result.near, looped.start, looped.end, np.degrees(looped.gap)
        return np.vstack((header, result.clip.poses))
