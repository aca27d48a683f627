"""The servo's process: absolute deadlines, a heartbeat in each direction, and no blocking on other processes.

Each tick's row is written to shared memory without waiting for any reader. A missed deadline is counted and skipped, so
the number of a tick always gives its time, and no burst of ticks follows a stall.
"""

import contextlib
import os
import signal
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numba import types

from controllers.errors import ParameterError
from controllers.safety.arming import NO_REQUEST
from controllers.safety.faults import Fault
from geometry.arrays import Array, IntArray
from geometry.errors import HvfError
from sim.compilation.bound_call import BoundCall
from sim.compilation.compiled import entry_point
from sim.compilation.memory_access import items
from sim.compilation.sequence_lock import read_whole, write_whole
from sim.devices.driver import LOST, REFUSED, DeviceIdentity
from sim.hardware.duration_histogram import DurationHistogram, Quantiles, add_duration
from sim.hardware.gated_servo import COMPUTE, LATENESS, GatedServo, Ticker
from sim.hardware.process_start import parent_id
from sim.hardware.realtime import become_realtime, wait_until
from sim.hardware.shared import Ring, SharedNumbers, append_row

ORDER_BEAT, ORDER_NUMBER, ORDER_REQUEST, ORDER_STOP, ORDER_SIZE = 0, 1, 2, 3, 4
"""Places in an order to the servo: the heartbeat, a number that changes; number of the request; the request; 1 to end
the servo."""

DETAIL_SIZE = 300
"""Largest length of a device's message on a fault [characters]."""

_getppid = types.ExternalFunction("getppid", types.int32())


@dataclass(frozen=True)
class ServoClock:
    """Timing limits of a servo.

    Parameters
    ----------
    late : float
        Lateness of a tick above which a fault is latched [s]; below it, missed deadlines are only counted, and if the
        firmware's watchdog switched the motors off meanwhile, the force is ramped in again.
    heartbeat : float
        Time without a heartbeat of the controls above which a fault is latched [s].
    realtime : bool
        Whether to request real-time scheduling.

    Raises
    ------
    ParameterError
        If a time is not positive.
    """

    late: float = 0.04
    heartbeat: float = 0.5
    realtime: bool = True

    def __post_init__(self) -> None:
        for name in ("late", "heartbeat"):
            if not getattr(self, name) > 0.0:
                raise ParameterError(f"{name} of the servo's clock must be positive, got {getattr(self, name)}")


class Ready(NamedTuple):
    """Report of a servo that has started: its device, its period [s], and the results of `become_realtime`."""

    identity: DeviceIdentity
    period: float
    said: list[str]


class Refused(NamedTuple):
    """Report of a servo that could not start, with the reason."""

    why: str


class Ended(NamedTuple):
    """Final report of a servo.

    Attributes
    ----------
    ticks, missed : int
        Ticks run, and deadlines missed.
    compute, lateness : Quantiles
        Computing time and lateness of a tick.
    memory_growth : float
        Growth of the resident memory since the first tick [MB].
    descriptors : int
        Growth of the number of open files since the first tick.
    broken : str
        Traceback of an internal error that ended the servo; empty if there was none.
    """

    ticks: int
    missed: int
    compute: Quantiles
    lateness: Quantiles
    memory_growth: float
    descriptors: int
    broken: str = ""


class Channels(NamedTuple):
    """Connections of the servo's process. In: orders. Out: the last row, a ring of rows, fault message, reports."""

    orders: SharedNumbers
    status: SharedNumbers
    rows: Ring
    detail: SharedNumbers
    reports: Connection


def serve(make: Callable[[], GatedServo], channels: Channels, clock: ServoClock) -> None:
    """Run a servo until it is ordered to end or its parent process has ended; the target of a process.

    Parameters
    ----------
    make : callable
        Opens the device and makes the gated servo, in this process; picklable.
    channels : Channels
        Connections to the controls and the recorder.
    clock : ServoClock
        Timing limits.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is handled by the controls
    signal.signal(signal.SIGTERM, _exit_on_signal)
    try:
        parts = make()
    except (HvfError, OSError) as error:
        channels.reports.send(Refused(str(error)))
        return
    process = ServoProcess(Ticker(parts), channels, clock)
    broken = ""
    try:
        process.begin()
        process.run()
    except Exception:  # on any error the motors are switched off, and the controls get the traceback
        broken = traceback.format_exc()
    finally:
        parts.driver.let_go()
        with contextlib.suppress(OSError):  # the controls are gone
            channels.reports.send(process.ended(broken))
        process.close()
        parts.driver.close()


def _exit_on_signal(number: int, frame: object) -> None:
    raise SystemExit(0)


@entry_point
def read_orders(count: IntArray, shared: Array, whole: Array, order: Array, parent: Array) -> None:
    """Read the controls' order (see `read_whole`), and the id of the parent process, shape (1,)."""
    read_whole(count, shared, whole, order)
    parent[0] = _getppid()


@entry_point
def publish_row(
    row: Array, status_count: IntArray, status: Array, count: IntArray, rows: Array, compute: DurationHistogram,
    lateness: DurationHistogram,
) -> None:  # fmt: skip
    """Publish a tick's row in status and ring, and count its computing time and lateness."""
    write_whole(status_count, status, row)
    append_row(count, rows, row)
    add_duration(compute, float(row[COMPUTE]))
    add_duration(lateness, float(row[LATENESS]))


class ServoProcess:
    """A servo that ticks in real time, as run by `serve`.

    A tick allocates nothing on the heap: compiled code works on preallocated arrays, and Python counts and compares
    only floats, which CPython takes from a free list, whereas integers above 256 would be allocated.

    Parameters
    ----------
    ticker : Ticker
        Runs the ticks.
    channels, clock
        Those of `serve`.
    """

    def __init__(self, ticker: Ticker, channels: Channels, clock: ServoClock):
        self._ticker, self._reports, self._clock = ticker, channels.reports, clock
        self._period = ticker.parts.gate.period
        order, parent = np.zeros(ORDER_SIZE), np.zeros(1)
        self._order, self._parent = items(order), items(parent)
        self._compute, self._lateness = DurationHistogram.empty(), DurationHistogram.empty()
        orders, status, rows = channels.orders, channels.status, channels.rows
        self._read_orders = BoundCall(read_orders, (orders.count, orders.numbers, orders.whole, order, parent))
        self._rows, shown = rows.numbers, (status.count, status.numbers, rows.count, rows.numbers)
        self._publish_row = BoundCall(publish_row, (ticker.row, *shown, self._compute, self._lateness))
        self._shown_detail, self._detail = channels.detail, ticker.detail
        self._ticks = self._missed = 0.0
        self._last_beat_time, self._last_beat, self._last_request = time.monotonic(), -1.0, 0.0
        self._initial_resources = _resource_use()

    def begin(self) -> None:
        """Compile and warm up with the motors off, then request real-time scheduling and report `Ready`."""
        for _ in range(3):
            self._ticker.tick(0)
        report = become_realtime() if self._clock.realtime else ["The servo runs like any process, as requested."]
        self._ticker.tick(0)
        self._rows.sum()  # touch all pages of the ring now, to avoid page faults later
        self._ticker.parts.driver.telemetry[[LOST, REFUSED]] = 0.0  # losses before the start do not count
        self._initial_resources = _resource_use()
        self._reports.send(Ready(self._ticker.parts.driver.identity, self._period, report))

    def run(self) -> None:
        """Tick at absolute deadlines, until there is an order to end or the parent process is gone."""
        period, parent = self._period, float(parent_id())
        begin = self._last_beat_time = time.monotonic()
        number = 1.0
        while True:
            late = wait_until(begin + number * period)
            skipped = late // period
            self._missed += skipped
            number += skipped
            if not self.turn(number, late) or self._parent[0] != parent:
                return
            number += 1.0

    def turn(self, number: float, late: float) -> bool:
        """Run tick `number`, `late` [s] after its deadline; returns False, without running it, on an order to end."""
        now, order, ticker = time.monotonic(), self._order, self._ticker
        self._read_orders()
        if order[ORDER_STOP] > 0.0:
            return False
        if late > self._clock.late:
            ticker.fail(Fault.SERVO_LATE, late)
        if order[ORDER_BEAT] != self._last_beat:
            self._last_beat, self._last_beat_time = order[ORDER_BEAT], now
        elif now - self._last_beat_time > self._clock.heartbeat:
            ticker.fail(Fault.CONTROL_LOST, now - self._last_beat_time)
        is_new_request, self._last_request = order[ORDER_NUMBER] != self._last_request, order[ORDER_NUMBER]
        ticker.tick(number, int(order[ORDER_REQUEST]) if is_new_request else NO_REQUEST)
        ticker.note_time(self._missed, late, time.monotonic() - now)
        self._publish_row()
        if ticker.detail != self._detail:  # only when a fault comes or goes
            self._detail = ticker.detail
            self._shown_detail.write(
                np.array([ord(c) for c in self._detail[:DETAIL_SIZE].ljust(DETAIL_SIZE, "\0")], float)
            )
        self._ticks += 1.0
        return True

    def close(self) -> None:
        """Drop all views of the shared memory, so that it can be closed."""
        del self._read_orders, self._publish_row, self._rows, self._shown_detail

    def ended(self, broken: str) -> Ended:
        """The final report."""
        memory, descriptors = (now - then for now, then in zip(_resource_use(), self._initial_resources, strict=True))
        return Ended(
            int(self._ticks), int(self._missed), self._compute.quantiles(), self._lateness.quantiles(), memory,
            int(descriptors), broken,
        )  # fmt: skip


def _resource_use() -> tuple[float, int]:
    """Resident memory [MB] and number of open files of this process; zeros where ``/proc`` is missing."""
    status = Path("/proc/self/statm")
    if not status.exists():
        return 0.0, 0
    pages = int(status.read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6, len(os.listdir("/proc/self/fd"))
