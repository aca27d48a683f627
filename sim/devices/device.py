"""The device interface of the servo loop; the implementation is chosen by type when the loop is compiled.

A device is a NamedTuple with arrays `hand` (15,), `torque` (3,), `faults` and `force` (3,), and three kernels:

- `sense(device, t)` fills `hand` at time t [s], and latches an implausible reading in `faults`;
- `actuate(device, force)` commands a force on the hand [N], in H;
- `advance(device, plant, t, replay, applied)` steps the world by one servo period.

To add a device, write its type and kernels in a file of their own, and list them in the table here.
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

_KERNELS: dict[type, tuple[Any, Any, Any]] = {
    SimulatedPhantom: (sense_simulated, actuate_simulated, advance_simulated),
    ReplayedHand: (sense_replayed, actuate_replayed, advance_replayed),
    Exchange: (sense_exchange, actuate_exchange, advance_exchange),
}
"""`sense`, `actuate` and `advance` of each device."""


def sense(device: DeviceState, t: float) -> None:
    """Fill the device's hand vector with its reading at time t [s]."""
    _KERNELS[type(device)][0](device, t)


def actuate(device: DeviceState, force: Array) -> None:
    """Command a force on the hand [N], in H, shape (3,)."""
    _KERNELS[type(device)][1](device, force)


def advance(device: DeviceState, plant: Plant, t: float, replay: bool, applied: Array) -> None:
    """Step the world by one servo period; the user's torques are written to `applied`, or read from it in a replay."""
    _KERNELS[type(device)][2](device, plant, t, replay, applied)


@overload(sense, strict=False)
def _sense(device: Any, t: Any) -> Any:
    return _KERNELS[device.instance_class][0].py_func


@overload(actuate, strict=False)
def _actuate(device: Any, force: Any) -> Any:
    return _KERNELS[device.instance_class][1].py_func


@overload(advance, strict=False)
def _advance(device: Any, plant: Any, t: Any, replay: Any, applied: Any) -> Any:
    return _KERNELS[device.instance_class][2].py_func


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


def user_torques(device: DeviceState) -> int:
    """Number of joints on which the user exerts torques: θ1, θ2, θ3, and the gimbal's three if it turns the stylus."""
    return 6 if isinstance(device, SimulatedPhantom) and len(device.user.arm.turns) > 0 else 3


def measure_in_motion(device: DeviceState) -> None:
    """Initialise the velocity filter of a device whose joints already move when the run begins."""
    if isinstance(device, SimulatedPhantom):
        sense_in_motion(device.port)
