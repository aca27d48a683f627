"""A servo with a driver and a safety gate: one tick and its log row, independent of the clock that calls it."""

from typing import NamedTuple

import numpy as np

from controllers.safety.arming import CLEAR, NO_REQUEST, State
from controllers.safety.faults import FAULT_CODE, FAULT_GAPS, FAULT_VALUE, Fault, LatchedFault, latch, latched
from controllers.safety.gate import GATE_GAIN, GATE_SHARE, GATE_STATE, Gate
from controllers.state import HAND_TIME
from geometry.arrays import Array
from sim.compilation.bound_call import BoundCall
from sim.compilation.memory_access import addresses_of, gather, items
from sim.devices.driver import JITTER, LOST, REFUSED, ROUND_TRIP, STALENESS, TEMPERATURE, Driver, DriverFault
from sim.devices.exchange import READING_CLOCK, READING_GIMBAL, READING_SEQUENCE, READING_THETA, Exchange
from sim.errors import SimError
from sim.hardware.gated_tick import MOTOR_HEAT, MOTORS_ON, GateMemory, gated_tick
from sim.loop.channels import make_logs, tick_channels
from sim.loop.servo import Servo, rearm_servo, run_block
from sim.world.world import World

READ_SHARE = 0.3
"""Timeout of a reading as a share of the servo period; the rest is for the tick and the command."""

CHANNELS: dict[str, tuple[int, ...]] = {
    "tick": (), "t": (), "p": (3,), "quaternion": (4,), "v": (3,), "omega": (3,), "switch": (), "field": (6,),
    "force": (3,), "asked": (3,), "torque": (3,), "tank": (), "tank_scale": (), "phase": (), "nearest": (3,),
    "distance": (), "river": (), "fault": (), "fault_value": (), "gaps": (), "state": (), "gain": (), "share": (),
    "heat": (), "missed": (), "lateness": (), "compute": (), "sequence": (), "clock": (), "theta": (3,),
    "gimbal": (3,), "round_trip": (), "jitter": (), "staleness": (), "lost": (), "refused": (), "temperature": (3,),
}  # fmt: skip
"""Channels of a tick's row: of the loop, the gate (`asked` is the force before it, `force` after it), the clock and the
device."""

_ROW_SLICES: dict[str, slice] = {}
for _name, _shape in CHANNELS.items():
    _start = max((s.stop for s in _ROW_SLICES.values()), default=0)
    _ROW_SLICES[_name] = slice(_start, _start + (_shape[0] if _shape else 1))
ROW_SIZE = _ROW_SLICES["temperature"].stop
MISSED, LATENESS, COMPUTE = (_ROW_SLICES[_name].start for _name in ("missed", "lateness", "compute"))
"""Places in a row that are filled by the servo's clock (`Ticker.note_time`)."""


def columns(rows: Array) -> dict[str, Array]:
    """Rows of ticks by channel, shape (n, …) each."""
    return {name: rows[:, place].reshape(len(rows), *CHANNELS[name]) for name, place in _ROW_SLICES.items()}


class GatedServo(NamedTuple):
    """A servo, the driver of its device, and the gate between them.

    Attributes
    ----------
    servo : Servo
        The servo; its device must be an `Exchange`.
    world : World
        Kept alive here, since the servo holds addresses of its memory.
    driver : Driver
        Driver of the device.
    gate : Gate
        Limits of the gate.
    offset : Array
        Encoder offsets, subtracted from the readings [rad], shape (3,).
    """

    servo: Servo
    world: World
    driver: Driver
    gate: Gate
    offset: Array


class Ticker:
    """Runs ticks of a gated servo, and holds the row of the last one.

    Parameters
    ----------
    parts : GatedServo
        Servo, driver and gate.

    Attributes
    ----------
    row : Array
        Row of the last tick, by `CHANNELS`, shape (`ROW_SIZE`,).
    detail : str
        The device's own message on the latched fault; empty if there is none.

    Raises
    ------
    SimError
        If the servo's device is no `Exchange`.
    """

    def __init__(self, parts: GatedServo):
        if not isinstance(parts.servo.device, Exchange):
            raise SimError(f"the servo's device is a {type(parts.servo.device).__name__}; expected an Exchange")
        self.parts, self._device = parts, parts.servo.device
        self.gated = GateMemory.of(parts.gate, parts.driver.identity.own_weight)
        self._ticks, frames = make_logs(parts.servo, 1)
        field = parts.servo.field
        # All that a tick needs is in preallocated arrays, reached by views made here, so a tick allocates nothing.
        self.detail = ""
        self._timeout, self.row = READ_SHARE * parts.gate.period, np.zeros(ROW_SIZE)
        self._tick_number, self._request = np.zeros(1), np.zeros(1)
        self._theta = self._device.reading[READING_THETA : READING_THETA + 3]
        self._motors, self._faults = items(self.gated.motors), items(self._device.faults)
        self._run_block = BoundCall(run_block, (parts.servo,), self._tick_number, (1, False, self._ticks, frames))
        gate_arguments = self._device, self.gated, field.limiter, field.tank, field.force
        self._run_gate = BoundCall(gated_tick, gate_arguments, self._request)
        self._sources = self._row_sources()
        self._gather_row = BoundCall(gather, (addresses_of(self._sources), self.row))

    def _row_sources(self) -> list[Array]:
        """Views of the arrays from which a row is gathered, in the order of `CHANNELS`."""
        device, gated, telemetry = self._device, self.gated, self.parts.driver.telemetry
        single = {
            "tick": (self._tick_number, 0), "fault": (device.faults, FAULT_CODE),
            "fault_value": (device.faults, FAULT_VALUE), "gaps": (device.faults, FAULT_GAPS),
            "state": (gated.gate, GATE_STATE), "gain": (gated.gate, GATE_GAIN),
            "share": (gated.gate, GATE_SHARE), "heat": (gated.motors, MOTOR_HEAT),
            "sequence": (device.reading, READING_SEQUENCE), "clock": (device.reading, READING_CLOCK),
            "round_trip": (telemetry, ROUND_TRIP), "jitter": (telemetry, JITTER),
            "staleness": (telemetry, STALENESS), "lost": (telemetry, LOST), "refused": (telemetry, REFUSED),
        }  # fmt: skip
        sources = {name: channel.reshape(-1) for name, channel in tick_channels(self._ticks, 1).items()}
        sources |= {name: array[place : place + 1] for name, (array, place) in single.items()}
        sources |= {
            "asked": self.parts.servo.field.force, "force": gated.force, "torque": gated.torque,
            "theta": device.reading[READING_THETA : READING_THETA + 3],
            "gimbal": device.reading[READING_GIMBAL : READING_GIMBAL + 3],
            "temperature": telemetry[TEMPERATURE : TEMPERATURE + 3],
        }  # fmt: skip
        return [sources.get(name, self.row[_ROW_SLICES[name]]) for name in CHANNELS]  # the clock's channels: unchanged

    @property
    def state(self) -> State:
        """State of the gate."""
        return State(int(self.gated.gate[GATE_STATE]))

    @property
    def fault(self) -> LatchedFault | None:
        """The latched fault; None if there is none."""
        return latched(self._device.faults)

    def fail(self, fault: Fault, value: float) -> None:
        """Latch a fault, which takes effect from the next tick on."""
        latch(self._device.faults, int(fault), float(self._device.hand[HAND_TIME]), value)

    def _fail_by(self, error: DriverFault) -> None:
        if self._faults[FAULT_CODE] == 0.0:
            self.detail = error.detail
        self.fail(error.fault, error.value)

    def tick(self, number: float, request: int = NO_REQUEST) -> None:
        """Read, compute and write for tick `number`, a whole number; its time is ``number T``.

        `request` is `ARM`, `DISARM`, `CLEAR` or none (of `controllers.safety.arming`). A fault of the driver is latched
        and the motors are switched off; nothing is raised.
        """
        parts, device = self.parts, self._device
        try:
            if parts.driver.read(device.reading, self._timeout):
                np.subtract(self._theta, parts.offset, out=self._theta)
        except DriverFault as error:
            self._fail_by(error)
        if request == CLEAR:
            rearm_servo(parts.servo)
            self.detail = ""
        self._tick_number[0], self._request[0] = number, request
        self._run_block()
        self._run_gate()
        motors_on = self._motors[MOTORS_ON] > 0.0
        try:
            parts.driver.write(self.gated.torque, motors_on)
        except DriverFault as error:
            self._fail_by(error)
        if not motors_on and self._faults[FAULT_CODE] != 0.0:
            parts.driver.let_go()
        self._gather_row()

    def note_time(self, missed: float, lateness: float, compute: float) -> None:
        """Add the clock's channels to the row: deadlines missed so far, lateness and computing time of the tick [s]."""
        row = self.row
        row[MISSED], row[LATENESS], row[COMPUTE] = missed, lateness, compute
