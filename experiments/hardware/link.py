"""How a device answers: round trip, loss, jitter and staleness, measured with its motors off or as a run shows them."""

import time
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from controllers.state import Array
from sim.devices.driver import BAD, JITTER, LOST, READ, ROUND_TRIP, STALENESS, Driver
from sim.devices.exchange import READING_SIZE

PERIOD = 1e-3
"""Between two commands while a link is measured [s]."""


class Link(NamedTuple):
    """How a device answers.

    Attributes
    ----------
    seconds : float
        For how long it was measured [s].
    readings, lost, refused : int
        Readings that came, were lost on the way, and were refused for a wrong checksum or an old number.
    round_trip, round_trip_p99 : float
        From a command to the reading that answers it [s]: median and 99 of 100. NaN where it does not tell.
    jitter : float
        Of the arrivals (RFC 3550, section 6.4.1) [s], median.
    staleness_p99 : float
        How much later than the quickest a reading came [s], 99 of 100.
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
        """From readings, losses and refusals, and round trip, jitter and staleness at each reading, shape (n, 3)."""

        def quantile(column: int, share: float) -> float:
            known = times[:, column][~np.isnan(times[:, column])]
            return float(np.quantile(known, share)) if len(known) else float("nan")

        readings, lost, refused = (int(count) for count in counts)
        return cls(
            seconds, readings, lost, refused, quantile(0, 0.5), quantile(0, 0.99), quantile(1, 0.5), quantile(2, 0.99)
        )

    def lines(self) -> list[str]:
        """In lines for a person."""
        return [
            f"{self.readings} readings in {self.seconds:.2f} s, {self.lost} lost, {self.refused} refused",
            f"round trip {in_us(self.round_trip)} (p99 {in_us(self.round_trip_p99)}), jitter {in_us(self.jitter)}, "
            f"p99 {in_us(self.staleness_p99)} later than the quickest",
        ]


def in_us(seconds: float) -> str:
    """A time [s] in microseconds, in words."""
    return "not told" if np.isnan(seconds) else f"{seconds * 1e6:.0f} µs"


def link_now(row: Mapping[str, Array]) -> str:
    """The link as a tick of `sim.hardware.gated_servo.CHANNELS` has it, in a line."""
    trip, jitter, stale = (in_us(float(row[name])) for name in ("round_trip", "jitter", "staleness"))
    return (
        f"round trip {trip}, jitter {jitter}, staleness {stale}, {float(row['lost']):.0f} readings lost, "
        f"{float(row['refused']):.0f} refused, {float(row['missed']):.0f} deadlines missed"
    )


def measured_link(driver: Driver, seconds: float = 1.0) -> Link:
    """How a device answers commands that leave its motors off, for so long [s]."""
    reading, told = np.zeros(READING_SIZE), driver.telemetry
    times: list[Array] = []
    begin, first = time.monotonic(), told.copy()
    while time.monotonic() - begin < seconds:
        driver.write(np.zeros(3), False)
        if driver.read(reading, 2.0 * PERIOD):
            times.append(told[[ROUND_TRIP, JITTER, STALENESS]])
        time.sleep(0.5 * PERIOD)  # a device that waits for nothing is not asked as often as it can answer
    counts = told - first
    return Link.of(
        time.monotonic() - begin,
        (counts[READ], counts[LOST], counts[BAD]),
        np.array(times) if times else np.full((1, 3), np.nan),
    )
