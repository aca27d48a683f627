"""Simulated time held to the wall clock, for a person who watches."""

import time


class RealTime:
    """Waits until the wall clock has come to the simulated time.

    The clock starts with the first wait. A simulation that is late is not waited for, and not hurried.
    """

    def __init__(self) -> None:
        self._origin: float | None = None

    def wait_until(self, t: float) -> None:
        """Sleep until simulated time t [s] is now."""
        now = time.monotonic()
        if self._origin is None or now - self._origin > t:
            self._origin = now - t
        else:
            time.sleep(self._origin + t - now)
