"""Stand-ins for a driver's clock and for the HID handle of a SpaceMouse, which tests set by hand."""

from collections import deque

import numpy as np


class Clock:
    """A clock that the test sets."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


class Cap:
    """A HID handle whose reports the test queues."""

    def __init__(self) -> None:
        self.queue, self.plugged = deque[bytes](), True

    def push(self, x: int, y: int, z: int) -> None:
        self.queue.append(b"\x01" + np.array([x, y, z], "<i2").tobytes())

    def turn(self, x: int, y: int, z: int) -> None:
        self.queue.append(b"\x02" + np.array([x, y, z], "<i2").tobytes())

    def read(self, max_length: int, timeout_ms: int = 0) -> list[int]:
        if not self.plugged:
            raise OSError("read error")
        return list(self.queue.popleft()[:max_length]) if self.queue else []

    def set_nonblocking(self, value: bool) -> int:
        return 0

    def close(self) -> None:
        self.plugged = False
