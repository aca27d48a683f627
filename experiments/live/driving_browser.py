"""Choice of the one browser that may drive; all others watch."""

import time

MAX_IDLE_TIME = 10.0  # [s] without an action after which another browser may take over


class DrivingBrowser:
    """The browser whose input counts: the first that acts, until it disconnects or another one takes over."""

    def __init__(self) -> None:
        self._client: int | None = None
        self._last_action_time = 0.0

    @property
    def client(self) -> int | None:
        """Id of the driving browser; None if there is none."""
        return self._client

    def may(self, client: int | None) -> bool:
        """Whether a browser's action counts; a browser that acts while nobody drives becomes the driver."""
        if self._client is None:
            self._client = client
        if client != self._client:
            return False
        self._last_action_time = time.monotonic()
        return True

    def take_over(self, client: int | None) -> bool:
        """Let another browser drive, if the driver has been idle for `MAX_IDLE_TIME`; returns whether it drives now."""
        is_active = time.monotonic() - self._last_action_time < MAX_IDLE_TIME
        if self._client is not None and client != self._client and is_active:
            return False
        self._client, self._last_action_time = client, time.monotonic()
        return True

    def leave(self, client: int) -> bool:
        """Handle the disconnection of a browser; returns whether it was the driver."""
        was_driver = client == self._client
        if was_driver:
            self._client = None
        return was_driver
