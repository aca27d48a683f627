"""The device interface of the servo loop; the implementation is chosen by type when the loop is compiled.

A device is a NamedTuple with arrays `hand` (15,), `torque` (3,), `faults` and `force` (3,), and three kernels:

- `sense(device, t)` fills `hand` at time t [s], and latches an implausible reading in `faults`;
- `actuate(device, force)` commands a force on the hand [N], in H;
- `advance(device, plant, t, replay, applied)` steps the world by one servo period.

To add a device, write its type and kernels in a file of their own, and list them in the tables here.
"""

from typing import Any, TypeAlias

from numba.extending import overload

from controllers.state import HandState
from geometry.arrays import Array
from sim.compilation.compiled import entry_point
from sim.compilation.units import Unit
from sim.devices.exchange import Exchange, actuate_exchange, advance_exchange, sense_exchange
from sim.devices.replayed import ReplayedHand, actuate_replayed, advance_replayed, sense_replayed
from sim.devices.simulated import SimulatedPhantom, actuate_simulated, advance_simulated, sense_simulated
from sim.world.phantom_port import sense_in_motion
from sim.world.plant import Plant

DeviceState: TypeAlias = SimulatedPhantom | ReplayedHand | Exchange

_SENSE: dict[type, Any] = {SimulatedPhantom: sense_simulated, ReplayedHand: sense_replayed, Exchange: sense_exchange}
_ACTUATE: dict[type, Any] = {
    SimulatedPhantom: actuate_simulated, ReplayedHand: actuate_replayed, Exchange: actuate_exchange,
}  # fmt: skip
_ADVANCE: dict[type, Any] = {
    SimulatedPhantom: advance_simulated, ReplayedHand: advance_replayed, Exchange: advance_exchange,
}  # fmt: skip


def sense(device: DeviceState, t: float) -> None:
    """Fill the device's hand vector with its reading at time t [s]."""
    _SENSE[type(device)](device, t)


def actuate(device: DeviceState, force: Array) -> None:
    """Command a force on the hand [N], in H, shape (3,)."""
    _ACTUATE[type(device)](device, force)


def advance(device: DeviceState, plant: Plant, t: float, replay: bool, applied: Array) -> None:
    """Step the world by one servo period; the user's torques are written to `applied`, or read from it in a replay."""
    _ADVANCE[type(device)](device, plant, t, replay, applied)


@overload(sense, strict=False)
def _sense(device: Any, t: Any) -> Any:
    return _SENSE[device.instance_class].py_func


@overload(actuate, strict=False)
def _actuate(device: Any, force: Any) -> Any:
    return _ACTUATE[device.instance_class].py_func


@overload(advance, strict=False)
def _advance(device: Any, plant: Any, t: Any, replay: Any, applied: Any) -> Any:
    return _ADVANCE[device.instance_class].py_func


@entry_point
def read_device(device: DeviceState, t: float) -> None:
    """Call `sense` from Python before the loop's tick of the same time t; that tick then does not sense again."""
    sense(device, t)


def device_units(device: DeviceState) -> tuple[Unit, ...]:
    """Compilation units that a device calls by address."""
    return device.units() if isinstance(device, SimulatedPhantom) else ()


def link_device(device: DeviceState) -> None:
    """Set the addresses that a device calls; compiles the units that are not in the cache."""
    if isinstance(device, SimulatedPhantom):
        device.link()


def available_ticks(device: DeviceState) -> int | None:
    """Number of ticks that a device can deliver; None if unlimited."""
    return len(device.rows) if isinstance(device, ReplayedHand) else None


def first_reading(device: DeviceState) -> HandState | None:
    """First reading of a device if it is known before the run; otherwise None."""
    return HandState.of(device.rows[0]) if isinstance(device, ReplayedHand) else None


def measure_in_motion(device: DeviceState) -> None:
    """Initialise the velocity filter of a device whose joints already move when the run begins."""
    if isinstance(device, SimulatedPhantom):
        sense_in_motion(device.port)
