"""What a page sends to a browser that needs no time to draw: ``python -m tests.live.watcher PORT SECONDS [stalled]``.

It speaks viser's protocol, in a process of its own, and prints the times [s] at which pictures came, as JSON. One that
is stalled reads nothing, as a browser whose machine hangs.
"""

import base64
import json
import socket
import subprocess
import sys
import time

import msgspec
import numpy as np
import viser
import zstandard
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin, Subprotocol

from experiments.live.page import Page

CONNECTING = 2.0  # [s] for the initial messages of the page
HEADER = 16  # bytes: lengths of what is packed, unpacked and packed
PROTOCOL = Subprotocol(f"viser-v{viser.__version__}")
MOVES = "/phantom/"  # it moves in every picture


def start_watcher(port: int, seconds: float, stalled: bool = False) -> "subprocess.Popen[str]":
    """Begin to watch a page."""
    command = [sys.executable, "-m", "tests.live.watcher", str(port), str(seconds), *["stalled"] * stalled]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def sent_and_drawn(page: Page, seconds: float) -> tuple[float, float]:
    """Pictures a second that a watcher gets of a page of this process, and that the page draws meanwhile."""
    watcher = start_watcher(page.port, CONNECTING + seconds)
    drawn: list[tuple[float, int]] = []
    while watcher.poll() is None:
        drawn.append((time.perf_counter(), page.pictures))
        time.sleep(0.05)
    assert watcher.stdout is not None
    times = np.array(json.loads(watcher.stdout.read()))
    times = times[times > times[-1] - seconds]
    span = times[-1] - times[0]
    first, last = np.interp([times[0], times[-1]], *np.array(drawn).T)
    return (len(times) - 1) / span, (last - first) / span


def pictures(port: int, seconds: float) -> list[float]:
    """Times at which pictures came [s], by the clock that processes share."""
    unpack, found = zstandard.ZstdDecompressor(), list[float]()
    with _page(port) as page:
        end = time.perf_counter() + seconds
        while time.perf_counter() < end:
            raw = page.recv(timeout=seconds)
            size = int.from_bytes(raw[8:HEADER], "little")
            messages = msgspec.msgpack.decode(unpack.decompress(raw[HEADER : HEADER + size]))["messages"]
            if any(one["type"] == "SetOrientationMessage" and one["name"].startswith(MOVES) for one in messages):
                found.append(time.perf_counter())
    return found


def stall(port: int, seconds: float) -> None:
    """Connect and read nothing, so that the buffers fill up."""
    with socket.create_connection(("127.0.0.1", port)) as line:
        line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        key = base64.b64encode(bytes(16)).decode()
        head = (
            "GET / HTTP/1.1", f"Host: 127.0.0.1:{port}", "Upgrade: websocket", "Connection: Upgrade",
            f"Sec-WebSocket-Key: {key}", "Sec-WebSocket-Version: 13", f"Sec-WebSocket-Protocol: {PROTOCOL}", "", "",
        )  # fmt: skip
        line.sendall("\r\n".join(head).encode())
        time.sleep(seconds)


def _page(port: int) -> ClientConnection:
    here = f"127.0.0.1:{port}"
    return connect(f"ws://{here}", origin=Origin(f"http://{here}"), subprotocols=[PROTOCOL], max_size=None)


if __name__ == "__main__":
    if sys.argv[3:] == ["stalled"]:
        stall(int(sys.argv[1]), float(sys.argv[2]))
    else:
        print(json.dumps(pictures(int(sys.argv[1]), float(sys.argv[2]))))
