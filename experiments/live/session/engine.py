"""The engine of a live session: runs the servo block by block while a person drags the stylus and changes gains."""

import time
from collections import deque
from typing import NamedTuple, cast

import numpy as np

from controllers.curves.deformation import redo, undo
from controllers.errors import ParameterError
from controllers.fields.algebra.law import Program
from controllers.fields.stretchy_tubes import StretchyGains, StretchyTubes
from controllers.state import HAND_SWITCH, POSITION
from experiments.config.run_config import RunConfig
from experiments.setups.session import Session
from experiments.setups.setups import parts_of
from geometry.arrays import Array
from sim.compilation.compiled import entry_point
from sim.devices.simulated import SimulatedPhantom
from sim.loop.channels import make_logs
from sim.loop.servo import Field, FrameLog, TickLog, rearm_servo, run_block
from sim.loop.snapshots import Snapshot, restore_snapshot, take_snapshot
from sim.users.hand.dragged import dragged, relaxed, tremor

BLOCK_TICKS = 8  # ticks between two updates of the hand's target: 8 ms, too short to be visible as a pause
MAX_HAND_FORCE = 8.0  # [N] largest force of the hand, about the motors' peak force
MAX_HAND_SPEED = 0.6  # [m/s] largest speed of the hand: a quick reach over the Phantom's workspace
HAND_TIME_CONSTANT = 0.03  # [s] time constant with which the hand follows the mouse: two or three frames of the page
SNAPSHOT_INTERVAL, MAX_SNAPSHOTS = 1.0, 120  # [s] between stored states, and their largest number


@entry_point
def _undo_bend(memory: Array, record: int) -> bool:
    """Undo the last edit of the curve whose edit record begins at ``memory[record]``; False if there is none."""
    return undo(memory, record)


@entry_point
def _redo_bend(memory: Array, record: int) -> bool:
    """Redo the edit that was undone last; False if there is none."""
    return redo(memory, record)


class Drag(NamedTuple):
    """A person's target for the stylus in H [m], and whether its switch is pressed."""

    target: Array
    pressed: bool = False


class Engine:
    """A session that a person drives.

    Parameters
    ----------
    session : Session
        Session that has not been run yet.

    Attributes
    ----------
    config : RunConfig
        Configuration with the current gains.
    tick : int
        Number of the next tick.
    """

    def __init__(self, session: Session):
        self.session, self.world = session, session.world
        self.config = cast(RunConfig, session.config)
        assert isinstance(session.servo.device, SimulatedPhantom)
        field = session.servo.field
        # A copy, as the gains change here and the law must keep its own parameters.
        self._servo = session.servo._replace(field=field._replace(params=field.params.copy()))
        self._device, self._arm = session.servo.device, session.servo.device.user.arm
        self._block = self._servo.figure_ticks * max(1, BLOCK_TICKS // self._servo.figure_ticks)
        self.logs = make_logs(self._servo, self._block)
        self._tick_times: deque[float] = deque(maxlen=1000)
        self._intended_position = np.full(3, np.nan)
        self.drag: Drag | None = None
        self.tick = 0
        self._end_parameter = self._find_end_parameter()
        self.perform(False)
        self._initial_state = take_snapshot(self._servo, self.world, 0)
        self._states: deque[Snapshot] = deque([self._initial_state], maxlen=MAX_SNAPSHOTS)

    @property
    def period(self) -> float:
        """Period of the servo [s]."""
        return self._servo.plant.period

    @property
    def seconds(self) -> float:
        """Duration of a block [s]."""
        return self._block * self.period

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.tick * self.period

    @property
    def stylus(self) -> Array:
        """Measured position of the stylus in H [m], shape (3,)."""
        return self._device.hand[POSITION]

    @property
    def memory(self) -> Array:
        """Memory of the field."""
        return self._servo.field.memory

    @property
    def field(self) -> Field:
        """The compiled field with its current parameters."""
        return self._servo.field

    @property
    def tubes(self) -> StretchyTubes | None:
        """The law in whose memory a curve is bent, if there is one."""
        law = self.session.field
        return law if isinstance(law, StretchyTubes) else None

    def advance(self) -> tuple[TickLog, FrameLog]:
        """Run a block and return its logs, which the next block overwrites."""
        t, seconds = self.time, self.seconds
        if self.drag is None or self.tick == 0:  # before the first tick the position of the stylus is not measured
            arm = relaxed(self._arm)
            self._intended_position[:] = np.nan
        else:
            start = self.stylus.copy() if np.isnan(self._intended_position[0]) else self._intended_position
            share = 1.0 - np.exp(-seconds / HAND_TIME_CONSTANT)
            wanted = _clamp_to_ball(start + share * (self.drag.target - start), start, MAX_HAND_SPEED * seconds)
            end = _clamp_to_ball(wanted, self.stylus, MAX_HAND_FORCE / self._arm.stiffness)
            arm = dragged(self._arm, t, seconds, start + tremor(t), end + tremor(t + seconds), self.drag.pressed)
            self._intended_position = end
        device = self._device._replace(user=self._device.user._replace(arm=arm))
        begin = time.thread_time()  # processor time of this thread, without the time that other programs take
        run_block(self._servo._replace(device=device), self.tick, self._block, False, *self.logs)
        self._tick_times.append((time.thread_time() - begin) / self._block)
        self.tick += self._block
        if self.time >= self._states[-1].tick * self.period + SNAPSHOT_INTERVAL:
            self._states.append(take_snapshot(self._servo, self.world, self.tick))
        return self.logs

    def cost(self) -> tuple[float, float]:
        """Median and 99th percentile of the processor time per tick over recent blocks [s]; zeros before the first."""
        if not self._tick_times:
            return 0.0, 0.0
        median, high = np.percentile(self._tick_times, (50.0, 99.0))
        return float(median), float(high)

    def set_gains(self, config: RunConfig) -> None:
        """Apply the gains of a configuration's mode during the run.

        A curve that is bent in the field's memory keeps its original timing, as bends are stored by phase.

        Raises
        ------
        ControllerError
            If a number is outside its interval, or the structure of the field would change.
        """
        parts = parts_of(config, self.session.parts.maps)
        new, old, field = parts.program, self.session.parts.program, self._servo.field
        if not np.array_equal(new.ops, old.ops) or len(new.params) != len(old.params):
            raise ParameterError("another field than the one that runs; expected other gains of the same mode and map")
        field.params[:] = new.params
        state = slice(0, len(old.memory) if self.tubes is None else self._bend_record)
        before, after = self._initial_memory[state], new.memory[state]
        changed = (before != after) & ~(np.isnan(before) & np.isnan(after))
        field.memory[state][changed] = after[changed]
        self._initial_memory[state] = after
        self._changed_by_gains[state] |= changed
        field.budget[:] = parts.tank.params()
        if self.tubes is not None:
            field.params[self._end_parameter] = self._performance_start
        self.config = cast(RunConfig, parts.config)

    def perform(self, now: bool) -> None:
        """Perform the bent curve from now on, or make it bendable again, in a mode that has both."""
        self._performance_start = self.time if now else np.inf
        if self.tubes is not None:
            self._servo.field.params[self._end_parameter] = self._performance_start

    @property
    def performs(self) -> bool:
        """Whether a bent curve is being performed."""
        return bool(np.isfinite(self._performance_start))

    @property
    def grabs_or_leads(self) -> bool:
        """Whether the drag leads a figure or holds a curve that it can bend; any other drag is a push."""
        if self.drag is None:
            return False
        return self.config.leads or (self.tubes is not None and not self.performs and self.drag.pressed)

    def undo(self) -> bool:
        """Undo the last bend; False if there is none."""
        return self._can_edit() and _undo_bend(self.memory, self._bend_record)

    def redo(self) -> bool:
        """Redo the last undone bend; False if there is none."""
        return self._can_edit() and _redo_bend(self.memory, self._bend_record)

    def _can_edit(self) -> bool:
        """Whether the mode bends a curve and nobody holds it, neither by a drag nor by the switch as last sensed."""
        return self.tubes is not None and self.drag is None and self._device.hand[HAND_SWITCH] == 0.0

    def bends(self) -> int:
        """Number of bends in force."""
        return 0 if self.tubes is None else len(self.tubes.edits(self.memory))

    def rearm(self) -> None:
        """Clear a latched fault of the device; the force is ramped in from zero."""
        rearm_servo(self._servo)

    def reset(self) -> None:
        """Return to the beginning; the gains are kept."""
        self._restore(self._initial_state)

    def back_to(self, t: float) -> float:
        """Go back to the last stored state at or before the time t [s]; returns the time of that state [s]."""
        state = next((old for old in reversed(self._states) if old.tick * self.period <= t), self._states[0])
        self._restore(state)
        return self.time

    def _restore(self, state: Snapshot) -> None:
        restore_snapshot(self._servo, self.world, state)
        self.memory[self._changed_by_gains] = self._initial_memory[self._changed_by_gains]
        self.tick = state.tick
        while len(self._states) > 1 and self._states[-1].tick > self.tick:
            self._states.pop()
        if self._states[0].tick > self.tick:
            self._states = deque([state], maxlen=MAX_SNAPSHOTS)
        self.drag = None
        self._intended_position[:] = np.nan

    def _find_end_parameter(self) -> int:
        """Index of the parameter with the time at which stretching ends; also stores the field's initial memory."""
        program: Program = self.session.parts.program
        self._initial_memory = program.memory.copy()
        self._changed_by_gains = np.zeros(len(program.memory), dtype=bool)
        for place in program.places():
            if self.tubes is not None and place.law is self.tubes:
                self._bend_record = self.tubes.record_at(place.memory)
                return place.params + StretchyGains._fields.index("until")
        return 0


def _clamp_to_ball(point: Array, centre: Array, reach: float) -> Array:
    """The point, or if it is outside a ball around `centre`, the nearest point of the ball."""
    offset = point - centre
    distance = float(np.linalg.norm(offset))
    return point if distance <= reach else centre + offset * (reach / distance)
