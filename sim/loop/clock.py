"""Real-time pacing: simulated time kept in step with the wall clock, for a person who watches."""

import time


class RealTime:
    """Sleeps until the wall clock has caught up with the simulated time.

    The clock starts with the first wait. A simulation that is late is not made to catch up: the origin of the wall
    clock is moved instead.
    """

    def __init__(self) -> None:
        self._origin: float | None = None

    def wait_until(self, t: float) -> None:
        """Sleep until the wall clock reaches simulated time t [s]."""
        now = time.monotonic()
        if self._origin is None or now - self._origin > t:
            self._origin = now - t
        else:
            time.sleep(self._origin + t - now)
