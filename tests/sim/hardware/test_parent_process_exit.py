"""A process ends if its parent was killed while it started."""

import os
import queue
import signal
import socket
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from experiments.live.session.workers import newest
from sim.hardware import process_start
from sim.hardware.emulated_process import SHOWN_SIZE, EmulatedEnd, host_device
from sim.hardware.gated_servo import ROW_SIZE
from sim.hardware.recorder_process import RECORDER_SIZE, record_rows
from sim.hardware.shared import Ring, SharedNumbers
from tests.sim.hardware.process_factories import PERIOD
from tests.sim.hardware.test_processes import job

UNUSED_PID = 2**22 + 1  # above the largest process id


@pytest.fixture
def orphan(monkeypatch: pytest.MonkeyPatch) -> None:
    """Makes this process appear as one whose parent has died."""
    monkeypatch.setattr(process_start.multiprocessing, "parent_process", lambda: SimpleNamespace(pid=UNUSED_PID))


def test_emulated_device_ends_if_its_parent_died_while_it_started(orphan, monkeypatch) -> None:
    class Device:
        writes, torque, clock = 0, np.zeros(3), 0.0

        def write(self, torque, enable) -> None:
            self.writes += 1
            assert self.writes < 3, "the loop does not end"

        def read(self, reading, timeout) -> None: ...

    monkeypatch.setattr(signal, "signal", lambda *_: None)
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    shown = SharedNumbers(SHOWN_SIZE)
    with ours, theirs:
        host_device(Device, EmulatedEnd(theirs, shown, PERIOD), False)
    shown.close()


def test_empty_recording_of_a_killed_run_is_removed(orphan, monkeypatch, tmp_path) -> None:
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    rows, orders, report = Ring(10, ROW_SIZE), SharedNumbers(1), SharedNumbers(RECORDER_SIZE)
    record_rows(job(tmp_path / "run.h5"), rows, orders, report)
    assert not list(tmp_path.iterdir())
    for shared in (rows, orders, report):
        shared.close()


def test_worker_ends_if_its_page_died_while_it_worked(orphan) -> None:
    class EmptyQueue:
        times = 0

        def get(self, timeout: float) -> None:
            self.times += 1
            assert self.times < 3, "the loop does not end"
            raise queue.Empty

    assert newest(EmptyQueue()) is None


SCRIPT = """
import multiprocessing, os, signal, socket, time
from sim.hardware.emulated_process import SHOWN_SIZE, EmulatedEnd, host_device
from sim.hardware.shared import SharedNumbers
from tests.sim.hardware.process_factories import PERIOD, emulated_device


def late():
    os.kill(os.getppid(), signal.SIGKILL)
    time.sleep(0.2)
    return emulated_device()


if __name__ == "__main__":
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    end = EmulatedEnd(theirs, SharedNumbers(SHOWN_SIZE), PERIOD)
    process = multiprocessing.get_context("spawn").Process(target=host_device, args=(late, end, False), daemon=True)
    process.start()
    process.join()
"""


@pytest.mark.slow
def test_killed_parent_leaves_no_device_process(tmp_path) -> None:
    script = tmp_path / "parent.py"
    script.write_text(SCRIPT)
    # Its output ends only when the last process that holds it has ended.
    paths = os.environ | {"PYTHONPATH": str(Path(__file__).resolve().parents[3])}
    ended = subprocess.run([sys.executable, str(script)], capture_output=True, timeout=60, check=False, env=paths)
    assert ended.returncode == -signal.SIGKILL
