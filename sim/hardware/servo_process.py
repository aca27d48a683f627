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

from controllers.errors import ControllerError, ParameterError
from controllers.safety.arming import NO_REQUEST
from controllers.safety.faults import Fault
from models.errors import ModelError
from sim.devices.driver import BAD, LOST, DeviceIdentity
from sim.errors import SimError
from sim.hardware.gated_servo import GatedServo, Ticker
from sim.hardware.realtime import become_realtime, wait_until
from sim.hardware.shared import Ring, SharedNumbers
from sim.hardware.spread import Quantiles, Spread

ORDER_BEAT, ORDER_NUMBER, ORDER_REQUEST, ORDER_STOP, ORDER_SIZE = 0, 1, 2, 3, 4
"""What controls tell the servo: a number that changes, the number of a request, the request, 1 to end."""

_PARENT_EVERY = 100  # ticks between two looks at whether there are controls still


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
        Of the resident memory since the first second [MB].
    descriptors : int
        Open files more than after the first second.
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
        parts.driver.close()


def _leave(number: int, frame: object) -> None:
    raise SystemExit(0)


class ServoProcess:
    """A servo against the clock: what `serve` runs.

    Parameters
    ----------
    ticker : Ticker
        What is driven.
    channels, clock
        Of `serve`.
    """

    def __init__(self, ticker: Ticker, channels: Channels, clock: ServoClock):
        self._ticker, self._channels, self._clock = ticker, channels, clock
        self._period = ticker.parts.gate.period
        self._order = np.zeros(ORDER_SIZE)
        self._ordered = self._order.data  # whose items are Python's numbers
        self._compute, self._lateness = Spread(), Spread()
        self._ticks = self._missed = 0
        self._heard, self._beat, self._done = time.monotonic(), -1.0, 0.0
        self._resources = _resources()

    def begin(self) -> None:
        """Compile and warm up with the motors off, and take precedence."""
        for _ in range(3):
            self._ticker.tick(0)
        said = become_realtime() if self._clock.realtime else ["The servo runs like any process, as it was asked to."]
        self._ticker.tick(0)
        self._ticker.parts.driver.telemetry[[LOST, BAD]] = 0.0  # what came while nobody was there to read
        self._channels.told.send(Ready(self._ticker.parts.driver.identity, self._period, said))

    def run(self) -> None:
        """Tick at absolute deadlines, until there is an order to end, or nobody who could give one."""
        period, parent = self._period, os.getppid()
        begin = self._heard = time.monotonic()
        number, settled = 1, round(1.0 / period)
        while True:
            late = wait_until(begin + number * period)
            skipped = int(late / period)
            self._missed += skipped
            number += skipped
            if not self.turn(number, late) or (self._ticks % _PARENT_EVERY == 0 and os.getppid() != parent):
                return
            number += 1
            if self._ticks == settled:
                self._resources = _resources()

    def turn(self, number: int, late: float) -> bool:
        """Do tick `number`, which begins late by so much [s]; False, and none, if there is an order to end."""
        now, order, ticker, channels = time.monotonic(), self._ordered, self._ticker, self._channels
        channels.orders.read(self._order)
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
        compute = time.monotonic() - now
        ticker.note_time(self._missed, late, compute)
        channels.status.write(ticker.row)
        channels.rows.append(ticker.row)
        self._compute.add(compute)
        self._lateness.add(late)
        self._ticks += 1
        return True

    def ended(self, broken: str) -> Ended:
        """What to say at the end."""
        memory, descriptors = (now - then for now, then in zip(_resources(), self._resources, strict=True))
        return Ended(
            self._ticks, self._missed, self._compute.quantiles(), self._lateness.quantiles(), memory, int(descriptors),
            broken,
        )  # fmt: skip


def _resources() -> tuple[float, int]:
    """Resident memory [MB] and open files of this process; zeros where the system does not tell."""
    status = Path("/proc/self/statm")
    if not status.exists():
        return 0.0, 0
    pages = int(status.read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6, len(os.listdir("/proc/self/fd"))
