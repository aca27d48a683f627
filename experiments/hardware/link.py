"""Quality of the link to a device: round trip, loss, jitter and staleness, with its motors off or during a run."""

import time
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from geometry.arrays import Array
from sim.devices.driver import JITTER, LOST, READ, REFUSED, ROUND_TRIP, STALENESS, Driver
from sim.devices.exchange import READING_SIZE

PERIOD = 1e-3
"""Nominal period of the commands while a link is measured [s]."""


class Link(NamedTuple):
    """Measured quality of the link to a device.

    Attributes
    ----------
    seconds : float
        Duration of the measurement [s].
    readings, lost, refused : int
        Number of readings received, lost on the way, and refused for a wrong checksum or an old sequence number.
    round_trip, round_trip_p99 : float
        Time from a command to the reading that answers it [s]: median and 99th percentile; NaN if the device does not
        report it.
    jitter : float
        Median interarrival jitter (RFC 3550, section 6.4.1) [s].
    staleness_p99 : float
        99th percentile of the delay of a reading relative to the quickest one [s].
    """

    seconds: float
    readings: int
    lost: int
    refused: int
    round_trip: float
    round_trip_p99: float
    jitter: float
    staleness_p99: float

    @classmethod
    def of(cls, seconds: float, counts: tuple[float, float, float], times: Array) -> "Link":
        """From the counts of readings, losses and refusals, and from round trip, jitter and staleness [s], (n, 3)."""

        def quantile(column: int, share: float) -> float:
            known = times[:, column][~np.isnan(times[:, column])]
            return float(np.quantile(known, share)) if len(known) else float("nan")

        readings, lost, refused = (int(count) for count in counts)
        return cls(
            seconds, readings, lost, refused, quantile(0, 0.5), quantile(0, 0.99), quantile(1, 0.5), quantile(2, 0.99)
        )

    def lines(self) -> list[str]:
        """The link in words."""
        return [
            f"{self.readings} readings in {self.seconds:.2f} s, {self.lost} lost, {self.refused} refused",
            f"round trip {in_us(self.round_trip)} (p99 {in_us(self.round_trip_p99)}), jitter {in_us(self.jitter)}, "
            f"p99 {in_us(self.staleness_p99)} later than the quickest",
        ]


def in_us(seconds: float) -> str:
    """Text of a time [s] in microseconds."""
    return "unknown" if np.isnan(seconds) else f"{seconds * 1e6:.0f} µs"


def link_now(row: Mapping[str, Array]) -> str:
    """The link in one line, from the channels of a tick (`sim.hardware.gated_servo.CHANNELS`)."""
    trip, jitter, stale = (in_us(float(row[name])) for name in ("round_trip", "jitter", "staleness"))
    return (
        f"round trip {trip}, jitter {jitter}, staleness {stale}, {float(row['lost']):.0f} readings lost, "
        f"{float(row['refused']):.0f} refused, {float(row['missed']):.0f} deadlines missed"
    )


def measured_link(driver: Driver, seconds: float) -> Link:
    """Measure the link for `seconds` [s] with commands that leave the motors off."""
    reading, telemetry = np.zeros(READING_SIZE), driver.telemetry
    times: list[Array] = []
    begin, first = time.monotonic(), telemetry.copy()
    while time.monotonic() - begin < seconds:
        driver.write(np.zeros(3), False)
        if driver.read(reading, 2.0 * PERIOD):
            times.append(telemetry[[ROUND_TRIP, JITTER, STALENESS]])
        time.sleep(0.5 * PERIOD)  # limits the rate for devices that answer without waiting
    counts = telemetry - first
    return Link.of(
        time.monotonic() - begin,
        (counts[READ], counts[LOST], counts[REFUSED]),
        np.array(times) if times else np.full((1, 3), np.nan),
    )
