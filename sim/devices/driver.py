"""The driver interface behind an `Exchange`: it reads one real device and commands its motors.

A driver knows the transport and units of its device; it knows no field, map, limiter or clock of the servo. A servo
period is

    driver.read(reading, timeout)  ->  the compiled tick  ->  driver.write(torque, enable)

An implausible reading raises `DriverFault`; the servo latches it, switches the motors off, and reports the reason.
"""

import math
from typing import NamedTuple, Protocol

import numpy as np
from numba import njit

from controllers.safety.faults import Fault
from geometry.arrays import Array
from sim.errors import SimError


class DriverFault(SimError):
    """A fault of a device, after which it is no longer driven.

    Parameters
    ----------
    fault : Fault
        Kind of fault.
    value : float
        The offending value, in the fault's unit.
    detail : str
        The device's own message, if it has one.
    """

    def __init__(self, fault: Fault, value: float = 0.0, detail: str = ""):
        super().__init__(f"{fault.words(value)} ({detail})" if detail else fault.words(value))
        self.fault, self.value, self.detail = fault, value, detail


class DeviceIdentity(NamedTuple):
    """Identity and capabilities of a device.

    Attributes
    ----------
    name, transport, serial, firmware : str
        For display; empty where the device does not report them.
    forces : bool
        Whether it has motors.
    watchdog : bool
        Whether its firmware switches the motors off when commands stop; if not, the user is warned.
    calibrated : bool
        Whether the zero of its encoders is known.
    power_up : int
        A number that differs after each power-up, or 0 if the device reports none: incremental encoders have then lost
        their zero.
    own_weight : bool
        Whether the device compensates for its own weight: its driver then removes the Phantom's from the torques.
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


TEMPERATURE, ROUND_TRIP, LOST, READ, REFUSED, JITTER, STALENESS, TELEMETRY_SIZE = 0, 3, 4, 5, 6, 7, 8, 9
"""Places in a driver's telemetry: motor temperatures (3) [°C], last round trip [s], numbers of readings lost, read and
refused, jitter of the arrivals [s] (RFC 3550, section 6.4.1), and latency of the last reading over the least one [s].
A value that a transport or a device cannot give is NaN."""

MAX_CLOCK_DRIFT = 2e-4
"""Largest relative drift between two clocks: 100 ppm each, the accuracy of quartz; 0.12 s in ten minutes."""


def make_telemetry() -> Array:
    """Telemetry of a device before its first reading: nothing read, lost or refused, all else NaN."""
    telemetry = np.full(TELEMETRY_SIZE, np.nan)
    telemetry[[LOST, READ, REFUSED]] = 0.0
    return telemetry


@njit
def note_arrival(telemetry: Array, clocks: Array, now: float, measured_at: float) -> None:
    """Update jitter and staleness for a reading made at `measured_at` by the device's clock, received at `now` [s].

    The two clocks have different origins and drift, so only changes of their difference are used, and the least
    difference rises at the rate of `MAX_CLOCK_DRIFT`. `clocks` (3,) holds the last difference of the clocks (NaN before
    the first reading of a device's clock), the least difference, and when the last reading came.
    """
    delay = now - measured_at
    if math.isnan(clocks[0]):
        clocks[1], telemetry[JITTER] = delay, 0.0
    else:
        telemetry[JITTER] += (abs(delay - clocks[0]) - telemetry[JITTER]) / 16.0
        clocks[1] = min(delay, clocks[1] + MAX_CLOCK_DRIFT * (now - clocks[2]))
    clocks[0], clocks[2] = delay, now
    telemetry[STALENESS] = delay - clocks[1]


class Driver(Protocol):
    """A device's driver.

    Attributes
    ----------
    identity : DeviceIdentity
        Identity and capabilities of the device.
    telemetry : Array
        See `TEMPERATURE`, of `TELEMETRY_SIZE`; updated in place by `read`.
    """

    identity: DeviceIdentity
    telemetry: Array

    def read(self, reading: Array, timeout: float) -> bool:
        """Write the newest reading, shape (9,) (`sim.devices.exchange.READING_SEQUENCE`).

        Returns
        -------
        bool
            Whether there was a new one within `timeout` [s].

        Raises
        ------
        DriverFault
            If the device is gone, or its reading is impossible.
        """
        ...

    def write(self, torque: Array, enable: bool) -> None:
        """Command torques of the Phantom's joints θ1…θ3 [N m], shape (3,), or switch the motors off if not `enable`.

        Raises
        ------
        DriverFault
            If the device is gone.
        """
        ...

    def let_go(self) -> None:
        """Switch the motors off at once; never raises."""
        ...

    def close(self) -> None:
        """Switch the motors off and close the device."""
        ...
