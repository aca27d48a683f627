"""The device of a run: a Phantom with the parameters of its device file, or the hand of a recording."""

import hashlib
from collections.abc import Callable
from pathlib import Path

from controllers.errors import ParameterError
from experiments.config.run_config import Replay
from experiments.files.device_files import linkage_of
from experiments.results.folder import RECORDING
from experiments.setups.parts.part_types import Settings
from geometry.arrays import Array
from sim.devices.device import DeviceState
from sim.devices.replayed import ReplayedHand, recorded_hand, replayed_hand
from sim.errors import SimError
from sim.recording.recording import Recording
from sim.world.world import World

DeviceOf = Callable[[World], DeviceState]
"""Makes the device of a world; without it a simulated Phantom held by the run's user is made."""


def device_of(settings: Settings, world: World, seconds: float | None) -> DeviceOf | None:
    """The device of a run in a world; of a Phantom the world gets the parameters, and the result is None.

    Parameters
    ----------
    settings : Settings
        Device, clock and figure of the run.
    world : World
        The world that is stepped.
    seconds : float, optional
        Duration of the run [s]; by default as long as the device delivers.

    Raises
    ------
    ParameterError
        If a recorded hand moves for less time than the run lasts.
    SimError
        If the device file or the recording cannot be read, or the hand was recorded at another period.
    """
    device = settings.device
    if not isinstance(device, Replay):
        if device.device_file:
            linkage_of(device).into(world)
        return None
    rows, period = _read_hand(device)
    servo = settings.clock.servo_period
    if abs(period - servo) > 1e-9:
        raise SimError(
            f"{device.run}: the hand was recorded every {period:g} s, and the servo runs every {servo:g} s; expected "
            f"--servo-period {period:g}"
        )
    every, available = settings.figure.figure_ticks, len(rows) * period
    if seconds is not None and every * round(seconds / (servo * every)) > len(rows):
        raise ParameterError(
            f"{device.run}: the recorded hand moves for {available:g} s, and the run lasts {seconds:g} s; expected "
            f"--seconds {available:g} or less"
        )
    return lambda world: replayed_hand(rows, world, period)


def recorded_as(settings: Settings, device: DeviceState) -> dict[str, str]:
    """Texts that a recording stores about a replayed hand: its source and its hash; empty for another device."""
    if isinstance(settings.device, Replay) and isinstance(device, ReplayedHand):
        return {"replayed": settings.device.run, "hand_sha256": _digest(device.rows)}
    return {}


def check_hand(settings: Settings, recording: Recording) -> None:
    """Refuse a recorded hand that has changed since a run with it was recorded.

    Raises
    ------
    SimError
        If it has, or its recording cannot be read.
    """
    recorded, device = recording.texts.get("hand_sha256"), settings.device
    if recorded is None or not isinstance(device, Replay):
        return
    found = _digest(_read_hand(device)[0])
    if found != recorded:
        raise SimError(
            f"{device.run}: the recorded hand has changed since the run was recorded: its SHA-256 is {found[:12]}…, "
            f"expected {recorded[:12]}…; put the run back whose hand was replayed"
        )


def _read_hand(device: Replay) -> tuple[Array, float]:
    """Hand vectors of a recording, shape (n, 15), and the period between them [s]."""
    with Recording(Path(device.run) / RECORDING) as recording:
        return recorded_hand(recording), 1.0 / recording.rates["ticks"]


def _digest(rows: Array) -> str:
    return hashlib.sha256(rows.tobytes()).hexdigest()
