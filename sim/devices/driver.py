"""What stands behind an `Exchange`: a driver that reads one real device, and commands it.

A driver knows its device's transport and units; it knows no field, map, limit or clock of ours. The loop of the
servo is

    driver.read(reading, timeout)  ->  the compiled tick  ->  driver.write(command)

Whatever cannot be a reading raises `DriverFault`; the servo latches it, lets go, and reports why.
"""

import math
from typing import NamedTuple, Protocol

import numpy as np
from numba import njit

from controllers.safety.faults import Fault
from controllers.state import Array
from sim.errors import SimError


class DriverFault(SimError):
    """A device that can no longer be relied on.

    Parameters
    ----------
    fault : Fault
        Which.
    value : float
        What was seen, in the fault's unit.
    detail : str
        What the device says of it, where it has words.
    """

    def __init__(self, fault: Fault, value: float = 0.0, detail: str = ""):
        super().__init__(f"{fault.words(value)} ({detail})" if detail else fault.words(value))
        self.fault, self.value = fault, value


class DeviceIdentity(NamedTuple):
    """Who a device is, and what it can do.

    Attributes
    ----------
    name, transport, serial, firmware : str
        For people; empty where the device does not tell.
    forces : bool
        Whether it has motors.
    watchdog : bool
        Whether its firmware lets go by itself when commands stay out. One without is announced as such.
    calibrated : bool
        Whether its encoders know their zero.
    power_up : int
        Another number after each power-up, where the device tells one, and else 0: encoders that count from where they
        wake up have lost their zero then.
    own_weight : bool
        Whether it carries its own weight: its driver takes the Phantom's off the torques again.
    """

    name: str
    transport: str
    serial: str
    firmware: str
    forces: bool
    watchdog: bool
    calibrated: bool
    power_up: int = 0
    own_weight: bool = False


TEMPERATURE, ROUND_TRIP, LOST, READ, BAD, JITTER, STALENESS, TELEMETRY_SIZE = 0, 3, 4, 5, 6, 7, 8, 9
"""Motors' temperatures [°C] (NaN where there is no sensor), last round trip [s], readings lost, read and refused,
the arrival's jitter [s] (RFC 3550, section 6.4.1), and how much later than the quickest the last one came [s].
What a transport cannot tell is NaN."""

DRIFT = 2e-4
"""How fast two clocks may go apart: 100 ppm each, which quartz keeps; in ten minutes that is 0.12 s."""


def fresh_telemetry() -> Array:
    """Telemetry of a device that has told nothing yet: nothing read, lost or refused, all else not known."""
    telemetry = np.full(TELEMETRY_SIZE, np.nan)
    telemetry[[LOST, READ, BAD]] = 0.0
    return telemetry


@njit
def note_arrival(told: Array, clocks: Array, now: float, made: float) -> None:
    """A reading came at `now` that was made at `made` [s], each by its own clock: jitter and staleness are written.

    The two clocks began at different times and drift: only how their difference changes means something, and the
    quickest reading is forgotten at the rate of `DRIFT`. `clocks` (3,) are the last difference of the clocks, the
    least, and when the last reading came; its first is NaN before the first reading of a clock.
    """
    delay = now - made
    if math.isnan(clocks[0]):
        clocks[1], told[JITTER] = delay, 0.0
    else:
        told[JITTER] += (abs(delay - clocks[0]) - told[JITTER]) / 16.0
        clocks[1] = min(delay, clocks[1] + DRIFT * (now - clocks[2]))
    clocks[0], clocks[2] = delay, now
    told[STALENESS] = delay - clocks[1]


class Driver(Protocol):
    """A device's driver.

    Attributes
    ----------
    identity : DeviceIdentity
        Who the device is.
    telemetry : Array
        See `TEMPERATURE`, of `TELEMETRY_SIZE`; rewritten in place by `read`.
    """

    identity: DeviceIdentity
    telemetry: Array

    def read(self, reading: Array, timeout: float) -> bool:
        """Write the newest reading, its number last (`sim.devices.exchange.READING_SEQUENCE`), shape (9,).

        Returns
        -------
        bool
            Whether there was a new one within `timeout` [s].

        Raises
        ------
        DriverFault
            If the device is gone, or told what cannot be.
        """
        ...

    def write(self, torque: Array, enable: bool) -> None:
        """Command the torques of the Phantom's joints θ1…θ3 [N m], shape (3,); motors off where not `enable`.

        Raises
        ------
        DriverFault
            If the device is gone.
        """
        ...

    def let_go(self) -> None:
        """Motors off, at once; never raises."""
        ...

    def close(self) -> None:
        """Let go, and give the device back."""
        ...
