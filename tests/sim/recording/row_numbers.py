"""Recordings whose channels hold the numbers of their rows."""

import numpy as np

from sim.recording.recorder import Group

CHANNELS = {"t": (), "p": (3,), "applied": (2, 3)}


GROUPS = {"ticks": Group(1000.0, CHANNELS), "frames": Group(100.0, {"t": ()})}


# Writes rows that hold their own number, and prints after each block how many there are.
WRITER = """
import sys
from pathlib import Path
import numpy as np
from sim.recording.recorder import Group, Recorder
channels = {"t": (), "p": (3,), "applied": (2, 3)}
recorder = Recorder(Path(sys.argv[1]), {}, 1, {"ticks": Group(1000.0, channels)}, {"xml": "x" * 300000})
n = 0
while True:
    rows = np.arange(n, n + 20.0)
    blocks = {k: np.broadcast_to(rows.reshape(-1, *[1] * len(s)), (20, *s)) for k, s in channels.items()}
    recorder.append("ticks", blocks)
    n += 20
    print(n, flush=True)
    if n == int(sys.argv[2]):
        recorder.close({"text": "y" * 20000})
"""


def block(start: int, n: int) -> dict[str, np.ndarray]:
    rows = np.arange(start, start + n, dtype=float)
    return {name: np.broadcast_to(rows.reshape(-1, *[1] * len(s)), (n, *s)) for name, s in CHANNELS.items()}


def holds_row_numbers(channel) -> bool:
    rows = channel[:]
    return bool(np.all(rows == np.arange(len(rows)).reshape(-1, *[1] * (rows.ndim - 1))))
