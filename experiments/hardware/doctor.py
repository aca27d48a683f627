"""Checks whether this machine can drive a device: libraries, permissions, system limits and timer latency."""

import math
import os
import platform
import sys
import time
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sim.devices.dhd import DHD
from sim.devices.hardware_list import RULES_FILE, FoundDevice
from sim.devices.hdapi import HDAPI

PERIOD = 1e-3
"""Period of the loop whose lateness is measured [s]."""
OK, WEAK, MISSING = "ok", "weak", "missing"


@dataclass(frozen=True)
class Finding:
    """Result of one check.

    Parameters
    ----------
    what : str
        Subject of the check, such as ``memory lock``.
    state : str
        ``ok``, ``weak`` (works, but less well) or ``missing``.
    says : str
        What was found.
    remedy : str
        How to fix it; empty if nothing is wrong.
    """

    what: str
    state: str
    says: str
    remedy: str = ""

    def lines(self) -> list[str]:
        """The finding in words."""
        return [f"{self.state:8} {self.what}: {self.says}", *([f"{'':9}{self.remedy}"] if self.remedy else [])]


class Lateness(NamedTuple):
    """Wake-up lateness of a 1 kHz loop [s], and the number of deadlines that it missed by a whole period."""

    loops: int
    p50: float
    p99: float
    p999: float
    worst: float
    missed: int


def findings(devices: list[FoundDevice]) -> list[Finding]:
    """All checks except the measurement of lateness."""
    return [*_libraries(), *_permissions(devices), *_limits()]


def _libraries() -> list[Finding]:
    found: list[Finding] = []
    try:
        found.append(Finding("hidapi", OK, f"{version('hidapi')}, for devices over HID"))
    except PackageNotFoundError:
        found.append(Finding("hidapi", MISSING, "the package is not installed", "pip install hidapi"))
    for name, path, install in (
        ("OpenHaptics (HD)", HDAPI.find(), "install 3D Systems' OpenHaptics and device driver, for a Touch or Phantom"),
        ("Force Dimension (dhd)", DHD.find(), "install the Force Dimension SDK, for an omega, delta, sigma or Falcon"),
    ):
        found.append(
            Finding(name, OK, path) if path else Finding(name, MISSING, "the library is not installed", install)
        )
    return found


def _permissions(devices: list[FoundDevice]) -> list[Finding]:
    connected = [device for device in devices if device.kind in ("phantom", "spacemouse")]
    if not connected:
        return [Finding("devices", MISSING, "no Phantom over HID and no SpaceMouse is connected")]
    return [
        Finding(device.path, OK, f"{device.product}: this user may open it")
        if device.usable
        else Finding(
            device.path, MISSING, f"{device.product}: this user may not open it",
            f"put this line into {RULES_FILE}, then run `udevadm control --reload` and plug the device in again:\n"
            f"{'':9}{device.udev_rule()}",
        )
        for device in connected
    ]  # fmt: skip


def _limits() -> list[Finding]:
    if not sys.platform.startswith("linux"):
        return [Finding("realtime", WEAK, f"{platform.system()} has no supported realtime class")]
    import resource  # not on Windows

    unlimited = resource.RLIM_INFINITY
    priority = resource.getrlimit(resource.RLIMIT_RTPRIO)[0]
    memory = unlimited if os.geteuid() == 0 else resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]  # root has no limit
    limits = "in /etc/security/limits.d/hvf.conf, then log in again"
    return [
        _preemption(),
        Finding("realtime priority", OK, "allowed")
        if priority != 0 or _is_realtime_allowed()
        else Finding("realtime priority", WEAK, "not allowed (RLIMIT_RTPRIO 0)", f"put `USER - rtprio 80` {limits}"),
        Finding("memory lock", OK, "unlimited" if memory == unlimited else f"{memory / 2**20:.0f} MB")
        if memory == unlimited or memory >= 2**30
        else Finding(
            "memory lock", WEAK, f"{memory / 2**20:.0f} MB (RLIMIT_MEMLOCK)", f"put `USER - memlock unlimited` {limits}"
        ),
        _governor(),
    ]


def _is_realtime_allowed() -> bool:
    """Whether the system grants this process SCHED_FIFO; the scheduling policy is restored afterwards."""
    policy, parameter = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    except PermissionError:
        return False
    os.sched_setscheduler(0, policy, parameter)
    return True


def _preemption() -> Finding:
    if _read("/sys/kernel/realtime") == "1":
        return Finding("kernel", OK, "PREEMPT_RT")
    build = platform.version()
    kind = next((word for word in ("PREEMPT_RT", "PREEMPT_DYNAMIC", "PREEMPT") if word in build), "no preemption")
    if kind == "PREEMPT_RT":
        return Finding("kernel", OK, kind)
    return Finding("kernel", WEAK, kind, "a kernel with PREEMPT_RT has less latency, above all in the worst case")


def _governor() -> Finding:
    found = {_read(str(path)) for path in Path("/sys/devices/system/cpu").glob("cpu[0-9]*/cpufreq/scaling_governor")}
    if not found:
        return Finding("processor's frequency", OK, "not scaled by the system")
    if found == {"performance"}:
        return Finding("processor's frequency", OK, "governor performance")
    return Finding(
        "processor's frequency", WEAK, f"governor {', '.join(sorted(found))}", "cpupower frequency-set -g performance"
    )


def _read(path: str) -> str:
    try:
        return Path(path).read_text(encoding="ascii").strip()
    except OSError:
        return ""


def measured_lateness(seconds: float) -> Lateness:
    """Lateness of a 1 kHz loop with absolute deadlines in this process; missed deadlines are skipped and counted."""
    late: list[float] = []
    deadlines = math.ceil(seconds / PERIOD)
    begin, k, missed = time.monotonic(), 0, 0
    while k < deadlines:
        k += 1
        left = begin + k * PERIOD - time.monotonic()
        if left > 0.0:
            time.sleep(left)
        behind = time.monotonic() - begin - k * PERIOD
        late.append(behind)
        skipped = min(int(behind / PERIOD), deadlines - k)
        missed, k = missed + skipped, k + skipped
    p50, p99, p999 = np.quantile(late, [0.5, 0.99, 0.999])
    return Lateness(len(late), float(p50), float(p99), float(p999), max(late), missed)
