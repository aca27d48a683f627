"""The servo's own process: absolute deadlines, a heartbeat each way, and nobody who can make it wait.

It writes each tick's row into shared memory and goes on: who reads them, how late, or whether at all, is not its
affair. A deadline that was missed is counted and left out, so the time of a tick is the time that it is, and no burst
of ticks follows a stop.
"""

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

from controllers.errors import ControllerError, ParameterError
from controllers.safety.arming import NO_REQUEST
from controllers.safety.faults import Fault
from controllers.state import Array, IntArray
from models.errors import ModelError
from sim.compilation.compiled import entry_point
from sim.compilation.kept_call import KeptCall
from sim.compilation.memory_access import items
from sim.compilation.sequence_lock import read_whole, write_whole
from sim.devices.driver import BAD, LOST, DeviceIdentity
from sim.errors import SimError
from sim.hardware.gated_servo import COMPUTE, LATENESS, GatedServo, Ticker
from sim.hardware.realtime import become_realtime, wait_until
from sim.hardware.shared import Ring, SharedNumbers, append_row
from sim.hardware.spread import Quantiles, Spread, count_time

ORDER_BEAT, ORDER_NUMBER, ORDER_REQUEST, ORDER_STOP, ORDER_SIZE = 0, 1, 2, 3, 4
"""What controls tell the servo: a number that changes, the number of a request, the request, 1 to end."""

_getppid = types.ExternalFunction("getppid", types.int32())


@dataclass(frozen=True)
class ServoClock:
    """How exactly a servo keeps its time.

    Parameters
    ----------
    late : float
        Lateness of a tick that is a fault [s]; below it, missed deadlines are counted, and a device whose firmware let
        go meanwhile is ramped in again.
    heartbeat : float
        Time without a sign of the controls that is a fault [s].
    realtime : bool
        Whether to ask the system for precedence.

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
    """A servo that has begun: its device, its period [s], and what the system gave it."""

    identity: DeviceIdentity
    period: float
    said: list[str]


class Refused(NamedTuple):
    """A servo that could not begin, and why."""

    why: str


class Ended(NamedTuple):
    """A servo that has ended.

    Attributes
    ----------
    ticks, missed : int
        Run, and deadlines missed.
    compute, lateness : Quantiles
        Of a tick.
    memory_growth : float
        Of the resident memory since the first tick [MB].
    descriptors : int
        Open files more than at the first tick.
    broken : str
        The program's own failure, if that was the end.
    """

    ticks: int
    missed: int
    compute: Quantiles
    lateness: Quantiles
    memory_growth: float
    descriptors: int
    broken: str = ""


class Channels(NamedTuple):
    """What the servo's process shares with others: orders in; the last row, all rows, and `Ready` and `Ended` out."""

    orders: SharedNumbers
    status: SharedNumbers
    rows: Ring
    told: Connection


def serve(make: Callable[[], GatedServo], channels: Channels, clock: ServoClock) -> None:
    """Run a servo until it is told to end, or nobody is there to tell; the target of a process.

    Parameters
    ----------
    make : callable
        Opens the device, and makes what is driven; called here, so it has to be picklable.
    channels : Channels
        Shared.
    clock : ServoClock
        See there.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the controls' to deal with
    signal.signal(signal.SIGTERM, _leave)
    try:
        parts = make()
    except (SimError, ControllerError, ModelError, OSError) as error:
        channels.told.send(Refused(str(error)))
        return
    process = ServoProcess(Ticker(parts), channels, clock)
    broken = ""
    try:
        process.begin()
        process.run()
    except Exception:  # whatever it is: the motors go off, and who controls is told
        broken = traceback.format_exc()
    finally:
        parts.driver.let_go()
        channels.told.send(process.ended(broken))
        process.close()
        parts.driver.close()


def _leave(number: int, frame: object) -> None:
    raise SystemExit(0)


@entry_point
def hear_orders(count: IntArray, shared: Array, whole: Array, order: Array, parent: Array) -> None:
    """Read what the controls order (as `read_whole`), and whose child this process is, (1,)."""
    read_whole(count, shared, whole, order)
    parent[0] = _getppid()


@entry_point
def leave_row(
    row: Array, status_count: IntArray, status: Array, count: IntArray, rows: Array, compute: Spread, lateness: Spread
) -> None:
    """Show a tick's row to the others, and count its times."""
    write_whole(status_count, status, row)
    append_row(count, rows, row)
    count_time(compute, float(row[COMPUTE]))
    count_time(lateness, float(row[LATENESS]))


class ServoProcess:
    """A servo against the clock: what `serve` runs.

    A tick takes nothing from the heap: compiled code works on arrays that are kept, and what Python counts and
    compares are floating-point numbers, which it takes from a list of its own; whole numbers above 256 it makes anew.

    Parameters
    ----------
    ticker : Ticker
        What is driven.
    channels, clock
        Of `serve`.
    """

    def __init__(self, ticker: Ticker, channels: Channels, clock: ServoClock):
        self._ticker, self._told, self._clock = ticker, channels.told, clock
        self._period = ticker.parts.gate.period
        order, parent = np.zeros(ORDER_SIZE), np.zeros(1)
        self._order, self._parent = items(order), items(parent)
        self._compute, self._lateness = Spread.empty(), Spread.empty()
        orders, status, rows = channels.orders, channels.status, channels.rows
        self._hear = KeptCall(hear_orders, (orders.count, orders.numbers, orders.whole, order, parent))
        self._rows, shown = rows.numbers, (status.count, status.numbers, rows.count, rows.numbers)
        self._leave = KeptCall(leave_row, (ticker.row, *shown, self._compute, self._lateness))
        self._ticks = self._missed = 0.0
        self._heard, self._beat, self._done = time.monotonic(), -1.0, 0.0
        self._resources = _resources()

    def begin(self) -> None:
        """Compile and warm up with the motors off, and take precedence."""
        for _ in range(3):
            self._ticker.tick(0)
        said = become_realtime() if self._clock.realtime else ["The servo runs like any process, as it was asked to."]
        self._ticker.tick(0)
        self._rows.sum()  # what is touched for the first time takes a page from the system
        self._ticker.parts.driver.telemetry[[LOST, BAD]] = 0.0  # what came while nobody was there to read
        self._resources = _resources()
        self._told.send(Ready(self._ticker.parts.driver.identity, self._period, said))

    def run(self) -> None:
        """Tick at absolute deadlines, until there is an order to end, or nobody who could give one."""
        period, parent = self._period, float(os.getppid())
        begin = self._heard = time.monotonic()
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
        """Do tick `number`, which begins late by so much [s]; False, and none, if there is an order to end."""
        now, order, ticker = time.monotonic(), self._order, self._ticker
        self._hear()
        if order[ORDER_STOP] > 0.0:
            return False
        if late > self._clock.late:
            ticker.fail(Fault.SERVO_LATE, late)
        if order[ORDER_BEAT] != self._beat:
            self._beat, self._heard = order[ORDER_BEAT], now
        elif now - self._heard > self._clock.heartbeat:
            ticker.fail(Fault.CONTROL_LOST, now - self._heard)
        new, self._done = order[ORDER_NUMBER] != self._done, order[ORDER_NUMBER]
        ticker.tick(number, int(order[ORDER_REQUEST]) if new else NO_REQUEST)
        ticker.note_time(self._missed, late, time.monotonic() - now)
        self._leave()
        self._ticks += 1.0
        return True

    def close(self) -> None:
        """Let go of the memory that is shared, before it is closed."""
        del self._hear, self._leave, self._rows

    def ended(self, broken: str) -> Ended:
        """What to say at the end."""
        memory, descriptors = (now - then for now, then in zip(_resources(), self._resources, strict=True))
        return Ended(
            int(self._ticks), int(self._missed), self._compute.quantiles(), self._lateness.quantiles(), memory,
            int(descriptors), broken,
        )  # fmt: skip


def _resources() -> tuple[float, int]:
    """Resident memory [MB] and open files of this process; zeros where the system does not tell."""
    status = Path("/proc/self/statm")
    if not status.exists():
        return 0.0, 0
    pages = int(status.read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6, len(os.listdir("/proc/self/fd"))
