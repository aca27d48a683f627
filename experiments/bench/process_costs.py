"""Costs of whole processes: their start, recompilation, certificates, lifting."""

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from controllers.fields.follow import follow_wrench
from experiments.certify.certify import CERTIFICATE
from experiments.results.folder import SUMMARY
from models.mocap.library import embedded, embedded_names
from models.mocap.motion.clip import Clip
from models.mocap.readers.own_bvh import write_bvh
from sim.body.clip_motion import clip_motion

_LIBRARY_IMPORTS = "import mujoco, numba, h5py, scipy.interpolate, rich, pydantic"
"""Imports that any program of these libraries needs before its first tick."""


class ProcessCost(NamedTuple):
    """Clock time of a process, and processor time, which other load hardly changes, with its children [s]."""

    clock: float
    processor: float


def libraries_cost() -> ProcessCost:
    """Cost of importing the libraries that a run needs in a new process, the least of three."""
    costs = [_process_cost("-c", _LIBRARY_IMPORTS) for _ in range(3)]
    return ProcessCost(*np.min(costs, axis=0).tolist())


def second_start_seconds() -> float:
    """Time from the start of a new process to its first tick, with the code already compiled [s]."""
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(2):
            command_cost("run", "--seconds", "0.1", "--overwrite", "--out", folder)
        summary = json.loads((Path(folder) / SUMMARY).read_text(encoding="utf-8"))
    return float(summary["speed"]["first_tick_seconds"])


def recompilation_ratio() -> float:
    """Processor time of a run with one law to compile, beyond that of a warm one, over that of a cold one.

    A unit is kept by its content (`sim.compilation.unit_key`), so that of a law that changes is missing.
    """
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"HVF_CACHE_DIR": f"{folder}/cache"}

        def processor_seconds() -> float:
            run = "run", "--seconds", "0.1", "--overwrite", "--out", f"{folder}/run"
            return command_cost(*run, env=environment).processor

        cold, warm = processor_seconds(), processor_seconds()
        (law,) = Path(folder, "cache").rglob(f"*.{follow_wrench.__name__}-*.unit")
        law.unlink()
        return (processor_seconds() - warm) / cold


def certificate_seconds() -> tuple[float, float]:
    """Processor times in which new processes certify the demo's field, with compiled code, and verify this [s]."""
    with tempfile.TemporaryDirectory() as folder:
        _, certified = (command_cost("certify", "--overwrite", "--out", folder) for _ in range(2))
        verified = command_cost("certify", "--verify", str(Path(folder) / CERTIFICATE))
        return certified.processor, verified.processor


def lifting_seconds() -> float:
    """Processor time in which new processes lift ten clips of 10 s at 60 frames a second and report on the map [s]."""
    times = np.arange(601) / 60.0
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder) / f"{k}.bvh" for k in range(10)]
        for k, file in enumerate(files):
            clip = embedded(embedded_names()[k % len(embedded_names())])
            poses = clip_motion(clip, times * (1.0 - 0.05 * (k // len(embedded_names())))).poses
            write_bvh(Clip(poses, 60.0, file.stem), file)
        return command_cost("lift", *map(str, files), "--out", str(Path(folder) / "map.npz")).processor


def command_cost(*arguments: str, env: Mapping[str, str] | None = None) -> ProcessCost:
    """Cost of an ``hvf`` command in a new process."""
    return _process_cost("-m", "experiments.cli", *arguments, env=env)


def _process_cost(*arguments: str, env: Mapping[str, str] | None = None) -> ProcessCost:
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run([sys.executable, *arguments], check=True, capture_output=True, env=env)
    clock, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    return ProcessCost(clock, after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime)
