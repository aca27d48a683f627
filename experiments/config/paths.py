"""Paths in a configuration: those in a file start at the file's folder, and a resolved configuration has full ones."""

import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

from experiments.config.maps import MAP_SUFFIX, MapFile
from experiments.config.part import from_file
from experiments.config.run_config import Replay, RunConfig

_Change = Callable[[str], str]


def relative_to(folder: Path) -> _Change:
    """Function that gives a path in a file of this folder as a path of the program."""
    return lambda path: os.path.normpath(folder / path)


def load_config(path: Path) -> RunConfig:
    """The configuration in a JSON file; see `experiments.config.part.from_file`."""
    return with_paths(from_file(RunConfig, path), relative_to(path.parent))


def with_paths(config: RunConfig, change: _Change) -> RunConfig:
    """A configuration in which a function has changed the paths: of motion files, a map, a device file, a replay."""
    map, device = config.map, config.device
    if isinstance(map, MapFile):
        map = replace(map, file=change(map.file))
    elif map.clips:
        map = replace(cast(Any, map), clips=_changed_clips(map.clips, change))
    if isinstance(device, Replay):
        device = replace(device, run=change(device.run))
    elif device.device_file:
        device = replace(device, device_file=change(device.device_file))
    return replace(config, map=map, device=device)


def with_paths_of_options(options: Mapping[str, Any], change: _Change) -> dict[str, Any]:
    """Options of a run in which a function has changed the paths; values of another type than a path's stay."""
    changed = dict(options)
    for name in ("map", "device_file", "replay"):
        value = options.get(name)
        if isinstance(value, str) and value and (name != "map" or value.endswith(MAP_SUFFIX)):
            changed[name] = change(value)
    if isinstance(clips := options.get("clips"), list | tuple):
        changed["clips"] = _changed_clips(cast(list[Any], clips), change)
    return changed


def _changed_clips(names: tuple[Any, ...] | list[Any], change: _Change) -> tuple[Any, ...]:
    """Names of embedded clips have no suffix, motion files have one."""
    return tuple(change(name) if isinstance(name, str) and Path(name).suffix else name for name in names)
