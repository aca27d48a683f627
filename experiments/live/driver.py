"""Who drives: of all who watch the page, one."""

import time

IDLE = 10.0  # [s] after which a driver who does nothing may be relieved


class Driver:
    """The one browser whose mouse and buttons count: the first that does something, until it leaves or is relieved."""

    def __init__(self) -> None:
        self._client: int | None = None
        self._acted = 0.0

    @property
    def client(self) -> int | None:
        """Who drives, if anybody."""
        return self._client

    def may(self, client: int | None) -> bool:
        """Whether what a browser does counts; one that does something while nobody drives is the driver then."""
        if self._client is None:
            self._client = client
        if client != self._client:
            return False
        self._acted = time.monotonic()
        return True

    def take_over(self, client: int | None) -> bool:
        """Let another browser drive, if the driver has done nothing for `IDLE`; whether it does then."""
        if self._client is not None and client != self._client and time.monotonic() - self._acted < IDLE:
            return False
        self._client, self._acted = client, time.monotonic()
        return True

    def leave(self, client: int) -> bool:
        """A browser has gone; whether it was the driver."""
        was = client == self._client
        if was:
            self._client = None
        return was
