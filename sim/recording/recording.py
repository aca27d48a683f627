"""Reading of recordings: of a run that ended, was killed, or is still going on.

Layout of the file, as written by `sim.recording.recorder`::

    config, versions      JSON texts          seed     integer
    static/<name>         arrays and texts    summary  JSON as bytes, of which ``summary_bytes`` count; 0 until the end
    <group>/<channel>     float64 (n, *shape), of which ``<group>/rows`` count, at ``<group>/rate`` [Hz]

Other programs can open the file of a killed run with ``h5py.File(path, "r", swmr=True)``, or after ``h5clear -s``.
"""

import json
from pathlib import Path
from typing import Self, TypeVar

import h5py
import numpy as np

from geometry.arrays import Array
from sim.errors import SimError
from sim.recording.unclosed import AsClosed, has_writer, superblock

_T = TypeVar("_T")
RESERVED = frozenset({"rows", "rate"})
"""Names in a group that are not channels."""


class RecordingError(SimError):
    """A recording that cannot be made, continued or read."""


def dataset_of(node: h5py.Group, name: str) -> h5py.Dataset:
    """A dataset by name; KeyError if there is none."""
    dataset = node[name]
    if not isinstance(dataset, h5py.Dataset):
        raise KeyError(f"{node.name}/{name} is not a dataset")
    return dataset


def group_of(node: h5py.Group, name: str) -> h5py.Group:
    """A group by name; KeyError if there is none."""
    group = node[name]
    if not isinstance(group, h5py.Group):
        raise KeyError(f"{node.name}/{name} is not a group")
    return group


def _first_line(error: Exception) -> str:
    return str(error).split("\n")[0]


def _members(node: h5py.Group) -> list[str]:
    return [str(name) for name in node]


def _open_file(path: Path) -> h5py.File:
    """Open the file: in SWMR mode while its writer lives, else as the writer left it (`sim.recording.unclosed`)."""
    head = superblock(path)
    if head is None:
        raise OSError("not an HDF5 file of this program")
    if not head.sound:
        raise OSError("its first bytes are damaged")
    if head.being_written and has_writer(path):
        return h5py.File(path, "r", libver="latest", swmr=True)
    return h5py.File(path if head.whole else AsClosed(path, head.closed), "r")


def _truncation(path: Path) -> str:
    """Text for a message that says how many bytes a file lacks at its end; empty if it is complete."""
    head = superblock(path)
    return "" if head is None or head.size >= head.end else f", cut short: {head.size} bytes of {head.end}"


class Channel:
    """Rows of a channel, read from the file when they are sliced.

    ``channel[i]``, ``channel[a:b]`` and ``channel[::k]`` give float64 arrays; ``len(channel)`` is the number of
    valid rows when the recording was opened.
    """

    def __init__(self, dataset: h5py.Dataset, rows: int, path: Path):
        self._dataset, self._path = dataset, path
        self._rows = rows
        self.shape = (rows, *dataset.shape[1:])

    def __len__(self) -> int:
        return self._rows

    def __getitem__(self, rows: int | slice) -> Array:
        if isinstance(rows, slice):
            return self._read(slice(*rows.indices(self._rows)))
        if not -self._rows <= rows < self._rows:
            raise IndexError(f"{self._dataset.name}: row {rows}; there are {self._rows}")
        return np.asarray(self._read(rows % self._rows))

    def _read(self, rows: int | slice) -> Array:
        try:
            return self._dataset[rows]
        except (OSError, RuntimeError) as error:
            source, reason = f"{self._path}{_truncation(self._path)}", _first_line(error)
            raise RecordingError(f"{source}: {self._dataset.name} is damaged ({reason})") from None


class _Contents(dict[str, _T]):
    """Contents of a recording by name; a missing name raises an error that names the file."""

    def __init__(self, path: Path, kind: str):
        super().__init__()
        self._path, self._kind = path, kind

    def __missing__(self, name: str) -> _T:
        raise RecordingError(f"{self._path}: no {self._kind}{name}; there are {sorted(self)}")


class Recording:
    """A recording, finished or not, opened for reading; also while it is still being written.

    Parameters
    ----------
    path : Path
        File made by a `Recorder`.

    Attributes
    ----------
    path : Path
        Its file.
    config : dict
        Configuration of the run.
    seed : int
        Seed of the run's random generator.
    versions : dict
        Versions of Python and of the packages on which a run depends, and the processor.
    summary : dict or None
        The summary given to `Recorder.close`; None if the run did not end normally.
    arrays, texts : dict
        Data that is constant during the run (`static` of the `Recorder`), numeric and text.
    static : dict
        Both.
    groups : dict
        For each group its channels by name. A missing name raises a `RecordingError`.
    rates : dict
        For each group its rate [Hz].

    Raises
    ------
    RecordingError
        If the file is missing, or not a recording.
    """

    def __init__(self, path: Path):
        self.path = path
        try:
            self._file = _open_file(path)
        except OSError as error:
            reason = (error.strerror or _first_line(error)) if path.exists() else "there is no such file"
            raise RecordingError(f"{path}: cannot be opened ({reason}); expected the run.h5 of a run") from None
        try:
            self._read()
        except (KeyError, OSError, RuntimeError, TypeError, ValueError, IndexError) as error:
            self._file.close()
            reason = _truncation(path) or f", or damaged ({_first_line(error)})"
            raise RecordingError(f"{path}: not a recording{reason}; expected the run.h5 of a run") from None

    def _read(self) -> None:
        file = self._file
        self.config: dict[str, object] = json.loads(dataset_of(file, "config")[()])
        self.versions: dict[str, str] = json.loads(dataset_of(file, "versions")[()])
        self.seed = int(dataset_of(file, "seed")[()])
        summary = bytes(dataset_of(file, "summary")[: dataset_of(file, "summary_bytes")[0]])
        self.summary: dict[str, object] | None = json.loads(summary) if summary else None
        self.arrays: dict[str, Array] = _Contents(self.path, "array ")
        self.texts: dict[str, str] = _Contents(self.path, "text ")
        self.static: dict[str, Array | str] = _Contents(self.path, "array or text ")
        static = group_of(file, "static")
        for name in _members(static):
            value = dataset_of(static, name)[()]
            if isinstance(value, bytes):
                self.texts[name] = value.decode()
            else:
                self.arrays[name] = np.asarray(value, dtype=np.float64)
        self.static.update({**self.arrays, **self.texts})
        self.groups: dict[str, dict[str, Channel]] = _Contents(self.path, "group ")
        nodes = {name: node for name in _members(file) if isinstance(node := file[name], h5py.Group) and "rate" in node}
        self.rates = {name: float(dataset_of(node, "rate")[()]) for name, node in nodes.items()}
        rows = {name: int(dataset_of(node, "rows")[0]) for name, node in nodes.items()}
        if summary:
            end_time = np.inf
        else:  # a run stopped between the writing of two groups is cut to the shorter one
            end_time = min((rows[name] / rate for name, rate in self.rates.items() if rows[name]), default=0.0)
        for name, node in nodes.items():
            n = int(min(rows[name], np.ceil(end_time * self.rates[name] - 1e-6)))
            self.groups[name] = _Contents(self.path, f"channel {name}/")
            for key in (key for key in _members(node) if key not in RESERVED):
                channel = dataset_of(node, key)
                count = channel.shape[0]
                if count < rows[name] or (summary and count > rows[name]):  # a kill leaves rows that are not counted
                    raise ValueError(f"{name}/{key} has {count} rows, {name}/rows says {rows[name]}")
                self.groups[name][key] = Channel(channel, n, self.path)

    def channel(self, group: str, name: str) -> Channel:
        """A channel that must have rows.

        Raises
        ------
        RecordingError
            If there is no such channel, or it has no rows.
        """
        channel = self.groups[group][name]
        if len(channel) == 0:
            raise RecordingError(f"{self.path}: {group}/{name} has no rows; the run ended before the first was written")
        return channel

    @property
    def complete(self) -> bool:
        """Whether the run ended normally, with a summary."""
        return self.summary is not None

    def close(self) -> None:
        """Close the file; channels can then no longer be read."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
