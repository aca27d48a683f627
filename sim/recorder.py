"""Recordings: what a run did, streamed to HDF5 so that a killed run loses at most its last quarter of a second.

The file is written in HDF5's single-writer mode (SWMR), in which every flush leaves a file that can be opened. What
counts is counted last: ``<group>/rows`` is raised only after the rows have been flushed, so a reader never sees rows
that were still on their way. A file is born whole under another name and then renamed, so it is never half a header.
Other programs open the file of a killed run with ``h5py.File(path, "r", swmr=True)``, or after ``h5clear -s``.

Layout::

    config, versions      JSON texts          seed     integer
    static/<name>         arrays and texts    summary  JSON as bytes, of which ``summary_bytes`` count; 0 until the end
    <group>/<channel>     float64 (n, *shape), of which ``<group>/rows`` count, at ``<group>/rate`` [Hz]
"""

import json
import os
import platform
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from types import TracebackType
from typing import Self

import h5py
import numpy as np
import numpy.typing as npt

from sim.errors import SimError

Array = npt.NDArray[np.float64]

CHUNK_SECONDS = 0.25  # what a killed run can lose
_PACKAGES = ("haptic-vector-fields", "mujoco", "numpy", "numba", "h5py")
_RESERVED = {"rows", "rate"}


class RecordingError(SimError):
    """A recording that cannot be made, continued or read."""


@dataclass(frozen=True)
class Group:
    """Channels that are recorded at one rate.

    Parameters
    ----------
    rate : float
        Rows per second [Hz].
    channels : Mapping[str, tuple of int]
        Shape of one row of each channel; ``()`` for a number.

    Raises
    ------
    RecordingError
        If the rate is not positive, or no channel is given, or a channel is called ``rows`` or ``rate``.
    """

    rate: float
    channels: Mapping[str, tuple[int, ...]]

    def __post_init__(self) -> None:
        if not (np.isfinite(self.rate) and self.rate > 0):
            raise RecordingError(f"rate is {self.rate} Hz; it must be positive")
        if not self.channels or _RESERVED & self.channels.keys():
            raise RecordingError(f"channels are {sorted(self.channels)}; at least one, and none of {sorted(_RESERVED)}")

    @property
    def chunk(self) -> int:
        """Rows that are written at once."""
        return max(1, round(self.rate * CHUNK_SECONDS))


def _dataset(node: h5py.Group, name: str) -> h5py.Dataset:
    dataset = node[name]
    if not isinstance(dataset, h5py.Dataset):
        raise KeyError(f"{node.name}/{name} is not a dataset")
    return dataset


def _group(node: h5py.Group, name: str) -> h5py.Group:
    group = node[name]
    if not isinstance(group, h5py.Group):
        raise KeyError(f"{node.name}/{name} is not a group")
    return group


def _names(node: h5py.Group) -> list[str]:
    return [str(name) for name in node]


class _Stream:
    """A group on its way to the file: one buffer of fixed size per channel, written when full."""

    def __init__(self, group: Group, node: h5py.Group):
        self._name = node.name
        self._datasets = {name: _dataset(node, name) for name in group.channels}
        self._rows = _dataset(node, "rows")
        self._buffers = {name: np.empty((group.chunk, *shape)) for name, shape in group.channels.items()}
        self._chunk = group.chunk
        self._filled = 0
        self._written = 0

    def append(self, blocks: Mapping[str, Array]) -> None:
        if blocks.keys() != self._buffers.keys():
            raise RecordingError(f"{self._name}: channels are {sorted(blocks)}; expected {sorted(self._buffers)}")
        n = len(next(iter(blocks.values())))
        for name, block in blocks.items():
            expected = (n, *self._buffers[name].shape[1:])
            if np.shape(block) != expected:
                raise RecordingError(f"{self._name}/{name}: shape is {np.shape(block)}; expected {expected}")
        start = 0
        while start < n:
            stop = min(n, start + self._chunk - self._filled)
            filled = self._filled + stop - start
            for name, block in blocks.items():
                self._buffers[name][self._filled : filled] = block[start:stop]
            self._filled, start = filled, stop
            if filled == self._chunk:
                self.flush()

    def flush(self) -> None:
        """Write the buffered rows, and only then count them."""
        if self._filled == 0:
            return
        total = self._written + self._filled
        for name, buffer in self._buffers.items():
            dataset = self._datasets[name]
            dataset.resize(total, axis=0)
            dataset[self._written : total] = buffer[: self._filled]
            dataset.flush()
        self._rows[0] = total
        self._rows.flush()
        self._written, self._filled = total, 0


def _write_header(
    file: h5py.File, config: Mapping[str, object], seed: int, static: Mapping[str, npt.ArrayLike | str]
) -> None:
    file["config"] = json.dumps(config)
    file["versions"] = json.dumps({"python": platform.python_version()} | {p: version(p) for p in _PACKAGES})
    file["seed"] = seed
    node = file.create_group("static")
    for name, value in static.items():
        node[name] = value
    file.create_dataset("summary", shape=(0,), maxshape=(None,), chunks=(4096,), dtype=np.uint8)
    file["summary_bytes"] = np.zeros(1, dtype=np.int64)


def _write_group(node: h5py.Group, group: Group) -> None:
    node["rate"] = group.rate
    node["rows"] = np.zeros(1, dtype=np.int64)
    for name, shape in group.channels.items():
        node.create_dataset(
            name, shape=(0, *shape), maxshape=(None, *shape), chunks=(group.chunk, *shape), dtype=np.float64
        )


class Recorder:
    """Writes a run to a new file, in memory that does not grow with the run.

    Use as a context manager; leaving it before `close` was given a summary (because of an exception, say) keeps all
    rows and leaves the recording marked as incomplete.

    Parameters
    ----------
    path : Path
        File to make.
    config : Mapping
        The resolved configuration of the run: with the seed, all that is needed to repeat it. Stored as JSON.
    seed : int
        Seed of the run's random generator.
    groups : Mapping[str, Group]
        What will be appended.
    static : Mapping[str, array or str]
        What does not change during the run: points of the curve, the model's XML, names of clips.

    Raises
    ------
    RecordingError
        If the file exists.
    """

    def __init__(
        self,
        path: Path,
        config: Mapping[str, object],
        seed: int,
        groups: Mapping[str, Group],
        static: Mapping[str, npt.ArrayLike | str],
    ):
        if path.exists():
            raise RecordingError(f"{path}: exists; a recording is never overwritten, choose another name")
        draft = path.with_name(f".{path.name}.{os.getpid()}")
        try:
            with h5py.File(draft, "w", libver="latest") as file:
                _write_header(file, config, seed, static)
                for name, group in groups.items():
                    _write_group(file.create_group(name), group)
            draft.rename(path)
        finally:
            draft.unlink(missing_ok=True)
        # Opened in single-writer mode at once: opening first and switching then leaves a moment in which a kill
        # would mark the file as unreadable.
        access = h5py.h5p.create(h5py.h5p.FILE_ACCESS)
        access.set_libver_bounds(h5py.h5f.LIBVER_LATEST, h5py.h5f.LIBVER_LATEST)
        flags = h5py.h5f.ACC_RDWR | h5py.h5f.ACC_SWMR_WRITE
        self._file = h5py.File(h5py.h5f.open(os.fsencode(path), flags, access))
        self._streams = {name: _Stream(group, _group(self._file, name)) for name, group in groups.items()}

    def append(self, group: str, blocks: Mapping[str, Array]) -> None:
        """Append rows to every channel of a group.

        Parameters
        ----------
        group : str
            One of the groups given at construction.
        blocks : Mapping[str, array]
            For each channel of the group an array (n, *shape); they are copied.

        Raises
        ------
        RecordingError
            If the group, a channel or a shape is not what was announced.
        """
        if group not in self._streams:
            raise RecordingError(f"{group}: no such group; there are {sorted(self._streams)}")
        self._streams[group].append(blocks)

    def close(self, summary: Mapping[str, object] | None = None) -> None:
        """Write what is buffered and close the file; a summary marks the recording as complete."""
        if not self._file:
            return
        for stream in self._streams.values():
            stream.flush()
        if summary is not None:
            text = np.frombuffer(json.dumps(summary).encode(), dtype=np.uint8)
            dataset, count = _dataset(self._file, "summary"), _dataset(self._file, "summary_bytes")
            dataset.resize(len(text), axis=0)
            dataset[:] = text
            dataset.flush()
            count[0] = len(text)
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class Channel:
    """Rows of a channel, read from the file when they are sliced.

    ``channel[i]``, ``channel[a:b]`` and ``channel[::k]`` give float64 arrays; ``len(channel)`` is the number of
    rows that count when the recording was opened.
    """

    def __init__(self, dataset: h5py.Dataset, rows: int):
        self._dataset = dataset
        self._rows = rows
        self.shape = (rows, *dataset.shape[1:])

    def __len__(self) -> int:
        return self._rows

    def __getitem__(self, rows: int | slice) -> Array:
        if isinstance(rows, slice):
            start, stop, step = rows.indices(self._rows)
            return self._dataset[start:stop:step]
        if not -self._rows <= rows < self._rows:
            raise IndexError(f"{self._dataset.name}: row {rows}; there are {self._rows}")
        return np.asarray(self._dataset[rows % self._rows])


class Recording:
    """A recording, finished or not, opened for reading; also while it is still being written.

    Parameters
    ----------
    path : Path
        File made by a `Recorder`.

    Attributes
    ----------
    config : dict
        Configuration of the run.
    seed : int
    versions : dict
        Versions of Python and of the packages that decide what a run does.
    summary : dict or None
        What `Recorder.close` was given; None if the run did not get there.
    arrays, texts : dict
        What does not change during the run (`static` of the `Recorder`), by kind.
    groups : dict
        For each group its channels by name.
    rates : dict
        For each group its rate [Hz].

    Raises
    ------
    RecordingError
        If the file is missing, or not a recording.
    """

    def __init__(self, path: Path):
        self._path = path
        try:
            self._file = h5py.File(path, "r", libver="latest", swmr=True)
        except OSError as error:
            raise RecordingError(f"{path}: cannot be opened ({error}); expected the run.h5 of a run") from None
        try:
            self._read()
        except (KeyError, TypeError, ValueError) as error:
            self._file.close()
            raise RecordingError(f"{path}: not a recording ({error}); expected the run.h5 of a run") from None

    def _read(self) -> None:
        file = self._file
        self.config: dict[str, object] = json.loads(_dataset(file, "config")[()])
        self.versions: dict[str, str] = json.loads(_dataset(file, "versions")[()])
        self.seed = int(_dataset(file, "seed")[()])
        summary = bytes(_dataset(file, "summary")[: _dataset(file, "summary_bytes")[0]])
        self.summary: dict[str, object] | None = json.loads(summary) if summary else None
        self.arrays: dict[str, Array] = {}
        self.texts: dict[str, str] = {}
        static = _group(file, "static")
        for name in _names(static):
            value = _dataset(static, name)[()]
            if isinstance(value, bytes):
                self.texts[name] = value.decode()
            else:
                self.arrays[name] = np.asarray(value, dtype=np.float64)
        self.groups: dict[str, dict[str, Channel]] = {}
        self.rates: dict[str, float] = {}
        for name in _names(file):
            node = file[name]
            if isinstance(node, h5py.Group) and "rate" in node:
                rows = int(_dataset(node, "rows")[0])
                self.rates[name] = float(_dataset(node, "rate")[()])
                self.groups[name] = {
                    key: Channel(_dataset(node, key), rows) for key in _names(node) if key not in _RESERVED
                }

    def channel(self, group: str, name: str) -> Channel:
        """A channel that has rows.

        Raises
        ------
        RecordingError
            If there is no such channel, or it has no rows.
        """
        channels = self.groups.get(group, {})
        if name not in channels:
            raise RecordingError(f"{self._path}: no channel {group}/{name}; {group} has {sorted(channels)}")
        if len(channels[name]) == 0:
            raise RecordingError(
                f"{self._path}: {group}/{name} has no rows; the run ended before the first was written"
            )
        return channels[name]

    def array(self, name: str) -> Array:
        """An array that does not change during the run.

        Raises
        ------
        RecordingError
            If there is none of that name.
        """
        if name not in self.arrays:
            raise RecordingError(f"{self._path}: no array {name}; there are {sorted(self.arrays)}")
        return self.arrays[name]

    @property
    def complete(self) -> bool:
        """Whether the run came to its end."""
        return self.summary is not None

    def close(self) -> None:
        """Close the file; channels can then no longer be read."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
