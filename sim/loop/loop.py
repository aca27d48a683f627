"""A run: compiled blocks of servo ticks one after the other, streamed to a recorder in constant memory."""

import resource
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from controllers.state import HandState
from geometry.arrays import Array
from sim.compilation.lost_interrupts import reraise_lost_interrupts
from sim.devices.device import available_ticks, read_device
from sim.errors import SimError
from sim.loop.channels import make_logs
from sim.loop.servo import FrameLog, Servo, TickLog, run_block
from sim.world.world import World

BLOCK_SECONDS = 0.2  # simulated time of a block [s]: the clock and the recorder are served once per block


class RunTimes(NamedTuple):
    """Simulated time of a run, and the wall-clock time it took [s]."""

    simulated: float
    wall: float

    @property
    def real_time_factor(self) -> float:
        """Simulated time divided by wall-clock time."""
        return self.simulated / self.wall if self.wall > 0.0 else float("inf")


_STATUS = Path("/proc/self/status")


def peak_memory_mb() -> float:
    """Largest resident memory of this process so far [MB].

    Linux reports it in ``/proc/self/status`` (VmHWM, man 5 proc). Its ``getrusage`` would include the peak that the
    parent had reached when it started this process.
    """
    if _STATUS.exists():
        line = next(line for line in _STATUS.read_text().splitlines() if line.startswith("VmHWM:"))
        return int(line.split()[1]) / 1e3
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e6 if sys.platform == "darwin" else peak / 1e3


Observer = Callable[[TickLog, FrameLog, int], None]
"""Called after each block with its logs and the number of ticks in them; the logs are reused for the next block."""


def ignore(ticks: TickLog, frames: FrameLog, n: int) -> None:
    """An `Observer` that does nothing."""


class Loop:
    """A servo and its world, run block by block.

    Parameters
    ----------
    servo : Servo
        See `sim.loop.servo`.
    world : World
        Kept alive here, since the servo holds addresses of its memory.
    observe : Observer, optional
        Called with each block; `sim.loop.channels.record_into` makes one that records.
    block_seconds : float
        Simulated time of a block [s], rounded to whole figure updates.
    python_laws : sequence of callable
        `Program.python_laws` of the servo's field: each maps the measured hand to a wrench of six numbers. If there are
        any, blocks run tick by tick: the hand is sensed, the laws are called, the compiled loop does the rest.
    before_tick : callable, optional
        Called with the number of each tick before it runs, for example by a driver in Python that writes the readings
        of an `Exchange` and takes its commands; it may wait for the time of the tick. Blocks then run tick by tick.
    ask : callable, optional
        Called with the time [s] every `ask_seconds`, rounded up to whole figure updates, before the tick: it sets what
        a simulated person at the device intends (see `sim.users.intents.own`). A block ends before each call.

    Raises
    ------
    SimError
        If the number of laws differs from the number of slots that the field has for them.
    """

    def __init__(
        self, servo: Servo, world: World, observe: Observer = ignore,
        block_seconds: float = BLOCK_SECONDS, python_laws: Sequence[Callable[[HandState], Array]] = (),
        before_tick: Callable[[int], None] | None = None, ask: Callable[[float], None] | None = None,
        ask_seconds: float = BLOCK_SECONDS,
    ):  # fmt: skip
        self.servo, self.world, self._observe = servo, world, observe
        every = servo.figure_ticks
        self._block_ticks = every * max(1, round(block_seconds / servo.plant.period / every))
        self._tick = 0
        self._step_logs: tuple[TickLog, FrameLog] | None = None
        self._law_slots: list[int] = servo.field.slots.tolist()
        self._laws = tuple(python_laws)
        self._before_tick = before_tick
        self._ask, self._ask_ticks = ask, every * max(1, -int(-ask_seconds / servo.plant.period // every))
        if len(self._laws) != len(self._law_slots):
            raise SimError(
                f"the field has {len(self._law_slots)} slots for laws in Python, {len(self._laws)} are given; "
                "expected the program's python_laws"
            )

    @property
    def time(self) -> float:
        """Simulated time so far [s]."""
        return self._tick * self.servo.plant.period

    def run(self, seconds: float, progress: Callable[[float], None] = lambda _: None) -> RunTimes:
        """Continue the run for some simulated time.

        Parameters
        ----------
        seconds : float
            Rounded to whole figure updates.
        progress : callable
            Called with the simulated time after every block.

        Raises
        ------
        SimError
            If the device cannot deliver that many ticks, because a replayed hand ends.
        """
        plant, every = self.servo.plant, self.servo.figure_ticks
        requested = every * round(seconds / (plant.period * every))
        limit, first = available_ticks(self.servo.device), self._tick
        if limit is not None and first + requested > limit:
            end, rest = (first + requested) * plant.period, (limit - first) * plant.period
            raise SimError(
                f"the replayed hand ends after {limit} ticks ({limit * plant.period:g} s), the run would end after "
                f"{end:g} s; ask for {rest:g} s or less"
            )
        ticks, frames = make_logs(self.servo, self._block_ticks)
        begin = time.perf_counter()
        while self._tick < first + requested:
            n = min(self._block_ticks, first + requested - self._tick)
            if self._ask is not None:
                n = min(n, self._ask_ticks - self._tick % self._ask_ticks)
                self._ask_if_due()
            self._run_block(n, ticks, frames)
            self._tick += n
            self._observe(ticks, frames, n)
            progress(self.time)
        return RunTimes(requested * plant.period, time.perf_counter() - begin)

    def step(self) -> tuple[TickLog, FrameLog]:
        """Run one tick; its logs have one row each: this tick, and the figure's last update."""
        if self._step_logs is None:
            self._step_logs = make_logs(self.servo, 1)
        ticks, frames = self._step_logs
        self._ask_if_due()
        self._run_block(1, ticks, frames)
        self._tick += 1
        return ticks, frames

    def _ask_if_due(self) -> None:
        if self._ask is not None and self._tick % self._ask_ticks == 0:
            self._ask(self.time)

    def _run_block(self, n: int, ticks: TickLog, frames: FrameLog) -> None:
        with reraise_lost_interrupts():
            if self._laws or self._before_tick is not None:
                self._run_tick_by_tick(n, ticks, frames)
            else:
                run_block(self.servo, self._tick, n, False, ticks, frames)

    def _run_tick_by_tick(self, n: int, ticks: TickLog, frames: FrameLog) -> None:
        servo, every = self.servo, self.servo.figure_ticks
        for k in range(n):
            tick, row = self._tick + k, k // every
            if self._before_tick is not None:
                self._before_tick(tick)
            read_device(servo.device, tick * servo.plant.period)
            for slot, law in zip(self._law_slots, self._laws, strict=True):
                # Of its own, so that a law that changes its arrays (p -= centre) does so for itself alone.
                servo.field.memory[slot : slot + 6] = law(HandState.of(servo.device.hand))
            tick_rows = TickLog(*(channel[k : k + 1] for channel in ticks))
            frame_rows = FrameLog(*(channel[row : row + 1] for channel in frames))
            run_block(servo, tick, 1, False, tick_rows, frame_rows)
