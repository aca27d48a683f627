"""Recording of a run, streamed to HDF5, so that a killed run loses at most its last half second.

The file is written in HDF5's single-writer mode (SWMR), in which every flush leaves a file that can be opened. The row
count ``<group>/rows`` is raised only after the rows have been flushed, so a reader never sees rows that are not yet
written. A file is created completely under another name and then renamed, so its header is never incomplete. The layout
is described in `sim.recording.recording`, which reads it.
"""

import json
import math
import os
import platform
import shutil
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Self, cast

import h5py
import numpy as np
import numpy.typing as npt
from llvmlite.binding import get_host_cpu_name

from geometry.arrays import Array
from sim.recording.recording import RESERVED, RecordingError, dataset_of, group_of
from sim.recording.unclosed import lock_for_writing

CHUNK_SECONDS = 0.5  # [s] of rows that a killed run can lose, besides rows not yet appended
# A write is copied page by page, and a kill between two pages corrupts what crosses their boundary. With this page size
# HDF5's own structures stay within a page (up to 8176 chunks, more than an hour); rows need not.
PAGE_SIZE = 4096
DISK_RESERVE = 4_000_000  # [bytes] kept free on the disk, for structures and summary of the file
_PARTIAL_KEPT = "what was recorded until then is kept; expected room on the disk, or another --out"
_PACKAGES = ("haptic-vector-fields", "mujoco", "numpy", "numba", "h5py")


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
        if not self.channels or RESERVED & self.channels.keys():
            raise RecordingError(f"channels are {sorted(self.channels)}; at least one, and none of {sorted(RESERVED)}")

    @property
    def chunk(self) -> int:
        """Number of rows that are written at once."""
        return max(1, round(self.rate * CHUNK_SECONDS))


class DiskFull(RecordingError):
    """The disk is full; what was recorded until then is kept."""


def _check_room(path: Path, size: int) -> None:
    """Check that after writing `size` [bytes] the disk has room to close the file; raises `DiskFull` otherwise."""
    free = shutil.disk_usage(path.parent).free
    if free < size + DISK_RESERVE:
        raise DiskFull(f"{path}: the disk is full ({free / 1e6:.0f} MB free); {_PARTIAL_KEPT}")


class _Stream:
    """Buffered writing of a group: one buffer of fixed size per channel, written when full."""

    def __init__(self, group: Group, node: h5py.Group, path: Path):
        self._name, self._path = node.name, path
        self._datasets = {name: dataset_of(node, name) for name in group.channels}
        self._rows = dataset_of(node, "rows")
        self._buffers = {name: np.empty((group.chunk, *shape)) for name, shape in group.channels.items()}
        self._chunk = group.chunk
        self._buffered = 0
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
            stop = min(n, start + self._chunk - self._buffered)
            filled = self._buffered + stop - start
            for name, block in blocks.items():
                self._buffers[name][self._buffered : filled] = block[start:stop]
            self._buffered, start = filled, stop
            if filled == self._chunk:
                self.flush()

    def flush(self) -> None:
        """Write the buffered rows, and then raise the row count."""
        if self._buffered == 0:
            return
        _check_room(self._path, sum(buffer.nbytes for buffer in self._buffers.values()))
        try:
            self._write()
        except (OSError, RuntimeError) as error:  # such as an exceeded quota, which `_check_room` cannot see
            why = os.strerror(error.errno) if isinstance(error, OSError) and error.errno else str(error).split("\n")[0]
            raise DiskFull(f"{self._path}: cannot be written any further ({why}); {_PARTIAL_KEPT}") from None

    def _write(self) -> None:
        total = self._written + self._buffered
        for name, buffer in self._buffers.items():
            dataset = self._datasets[name]
            dataset.id.set_extent((total, *buffer.shape[1:]))
            # Whole chunks are written directly: five times faster, and HDF5's cache does not grow.
            if self._buffered == self._chunk and self._written % self._chunk == 0:
                dataset.id.write_direct_chunk((self._written, *[0] * (buffer.ndim - 1)), buffer)
            else:
                dataset[self._written : total] = buffer[: self._buffered]
            dataset.flush()
        self._rows[0] = total
        self._rows.flush()
        self._written, self._buffered = total, 0


def _to_json(value: object) -> object:
    """Plain data with infinite numbers, which JSON lacks, replaced by the text "Infinity" with its sign."""
    if isinstance(value, float) and math.isinf(value):
        return "Infinity" if value > 0.0 else "-Infinity"
    if isinstance(value, Mapping):
        return {key: _to_json(item) for key, item in cast(Mapping[object, object], value).items()}
    if isinstance(value, list | tuple):
        return [_to_json(item) for item in cast(Sequence[object], value)]
    return value


def _write_header(
    file: h5py.File, config: Mapping[str, object], seed: int, static: Mapping[str, npt.ArrayLike | str]
) -> None:
    file["config"] = json.dumps(_to_json(config), allow_nan=False)
    versions = {"python": platform.python_version(), "processor": get_host_cpu_name()}
    file["versions"] = json.dumps(versions | {p: version(p) for p in _PACKAGES})
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
    """Writes a run to a new file, in constant memory.

    Use as a context manager. If it is left before `close` was given a summary, for example by an exception, all rows
    are kept and the recording stays marked as incomplete.

    Parameters
    ----------
    path : Path
        File to create.
    config : Mapping
        The resolved configuration of the run; with the seed, all that is needed to repeat it. Stored as JSON.
    seed : int
        Seed of the run's random generator.
    groups : Mapping[str, Group]
        Groups of channels to be appended to.
    static : Mapping[str, array or str]
        Data that is constant during the run: points of the curve, the model's XML, names of clips.

    Raises
    ------
    RecordingError
        If the file exists.
    DiskFull
        When rows are appended for which there is no room; the file is then closed.
    """

    def __init__(
        self, path: Path, config: Mapping[str, object], seed: int, groups: Mapping[str, Group],
        static: Mapping[str, npt.ArrayLike | str],
    ):  # fmt: skip
        if path.exists():
            raise RecordingError(f"{path}: exists; a recording is never overwritten, choose another name")
        temporary = path.with_name(f".{path.name}.{os.getpid()}")
        try:
            with h5py.File(temporary, "w", libver="latest", fs_strategy="page", fs_page_size=PAGE_SIZE) as file:
                _write_header(file, config, seed, static)
                for name, group in groups.items():
                    _write_group(file.create_group(name), group)
            temporary.rename(path)
        finally:
            temporary.unlink(missing_ok=True)
        # Opened in single-writer mode directly: if it were opened first and switched then, a kill in between would
        # leave the file marked as unreadable.
        access = h5py.h5p.create(h5py.h5p.FILE_ACCESS)
        access.set_libver_bounds(h5py.h5f.LIBVER_LATEST, h5py.h5f.LIBVER_LATEST)
        flags = h5py.h5f.ACC_RDWR | h5py.h5f.ACC_SWMR_WRITE
        self._file = h5py.File(h5py.h5f.open(os.fsencode(path), flags, access))
        self._lock, self._closed = lock_for_writing(path), False
        self._streams = {name: _Stream(group, group_of(self._file, name), path) for name, group in groups.items()}

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
            If the group, a channel or a shape differs from those given at construction.
        """
        if group not in self._streams:
            raise RecordingError(f"{group}: no such group; there are {sorted(self._streams)}")
        with self._closed_if_disk_is_full():
            self._streams[group].append(blocks)

    def flush(self) -> None:
        """Write what is buffered, so that a reader sees all that was appended."""
        with self._closed_if_disk_is_full():
            for stream in self._streams.values():
                stream.flush()

    def close(self, summary: Mapping[str, object] | None = None) -> None:
        """Write what is buffered and close the file; a summary marks the recording as complete."""
        if self._closed:
            return
        self.flush()
        if summary is not None:
            text = np.frombuffer(json.dumps(summary).encode(), dtype=np.uint8)
            dataset, count = dataset_of(self._file, "summary"), dataset_of(self._file, "summary_bytes")
            dataset.resize(len(text), axis=0)
            dataset[:] = text
            dataset.flush()
            count[0] = len(text)
        self._closed = True
        self._file.close()
        os.close(self._lock)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        self.close()

    @contextmanager
    def _closed_if_disk_is_full(self) -> Generator[None]:
        """Close the file without writing the buffers if the disk becomes full."""
        try:
            yield
        except DiskFull:
            self._closed = True
            with suppress(OSError, RuntimeError):
                self._file.close()
            os.close(self._lock)
            raise
