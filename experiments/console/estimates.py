"""Estimates, before a run begins, of the time and disk space that it will take."""

import math
import shutil
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from controllers.errors import ParameterError
from experiments.console.progress import expected_seconds
from sim.recording.recorder import DISK_RESERVE, Group

SIMULATING = "a simulated second"
"""Name under which the wall-clock time per simulated second is stored."""
_MIN_BYTES_PER_TICK = 400.0  # bytes per tick that every run records: measurements, forces, motor commands
# [s] of real time and [bytes] from which a run announces what it will take
_MIN_ANNOUNCED_TIME, _MIN_ANNOUNCED_SIZE = 60.0, 1e9


def check_length(out: Path, seconds: float, servo_period: float) -> None:
    """Refuse a run whose recording cannot fit on the disk, however little it records, before anything is made."""
    _check_disk_space(out, seconds, _MIN_BYTES_PER_TICK / servo_period)


def cost_estimate(out: Path, seconds: float, groups: Mapping[str, Group]) -> str | None:
    """Time and disk space that a run will take, in words; None if both are small.

    Raises
    ------
    ParameterError
        If its recording does not fit on the disk.
    """
    rate = sum(8.0 * g.rate * sum(int(np.prod(shape)) for shape in g.channels.values()) for g in groups.values())
    _check_disk_space(out, seconds, rate)
    a_second, size = expected_seconds(SIMULATING), seconds * rate
    real_time = None if a_second is None else a_second * seconds
    if size < _MIN_ANNOUNCED_SIZE and (real_time or 0.0) < _MIN_ANNOUNCED_TIME:
        return None
    time = "" if real_time is None else f"about {_duration_text(real_time)} at the speed of the last run, and "
    return (
        f"{seconds:g} s of simulated time take {time}{_size_text(size)} of disk; "
        f"{_size_text(_free_bytes(out))} are free"
    )


def _check_disk_space(out: Path, seconds: float, rate: float) -> None:
    size, free = seconds * rate, max(0.0, _free_bytes(out) - DISK_RESERVE)
    if size > free:
        expected = f"less than {free / rate:.3g} s" if free else "another --out"
        raise ParameterError(
            f"--seconds is {seconds:g}: a recording of {_size_text(size)} or more, and {_size_text(free)} are free for "
            f"it where {out} is; expected {expected}"
        )


def _free_bytes(out: Path) -> float:
    """Free bytes on the file system where a folder is or will be; infinite where it has no size, such as ``/proc``."""
    there = next(folder for folder in (out.absolute(), *out.absolute().parents) if folder.exists())
    total, _, free = shutil.disk_usage(there)
    return float(free) if total else math.inf


def _size_text(size: float) -> str:
    for unit, factor in (("TB", 1e12), ("GB", 1e9)):
        if size >= factor:
            return f"{size / factor:.3g} {unit}"
    return f"{size / 1e6:.3g} MB"


def _duration_text(seconds: float) -> str:
    for unit, factor in (("years", 365.25 * 86400.0), ("days", 86400.0), ("hours", 3600.0), ("minutes", 60.0)):
        if seconds >= 2.0 * factor:
            return f"{seconds / factor:.0f} {unit}"
    return f"{seconds:.0f} s"
