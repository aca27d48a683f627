"""Processes of a hardware run, killed or frozen: the servo continues or lets go, and the recording stays readable.

Tests that a busy machine cannot disturb are `slow`, the others `processes`.
"""

import contextlib
import functools
import multiprocessing
import os
import resource
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from multiprocessing.process import BaseProcess
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from controllers.safety.arming import ARM, CLEAR, State
from controllers.safety.faults import Fault
from models.world.scene import SceneConfig
from sim.errors import SimError
from sim.hardware.controls import HardwareRun, RunStatus
from sim.hardware.emulated_process import SHOWN_SIZE, SHOWN_TORQUE, SHOWN_TRIPS, EmulatedEnd, host_device
from sim.hardware.gated_servo import ROW_SIZE
from sim.hardware.recorder_process import RecordingJob, record_rows
from sim.hardware.servo_process import Ended, ServoClock
from sim.hardware.shared import SharedNumbers
from sim.recording.recording import Recording
from sim.world.linkage import Linkage
from tests.sim.hardware.process_factories import (
    PERIOD,
    emulated_device,
    servo_over_packets,
    servo_with_failing_device,
    servo_with_own_device,
)

LENIENT_CLOCK = ServoClock(late=20.0, heartbeat=20.0)
"""Limits so long that a busy machine causes no fault; tests of lateness or silence set their own."""
LATE_LIMIT, HEARTBEAT_LIMIT = 0.2, 0.6


def job(path: Path) -> RecordingJob:
    return RecordingJob(path, {"kind": "test"}, {}, 1, SceneConfig(servo_period=PERIOD, physics_step=PERIOD), Linkage())


def wait_until(run: HardwareRun, condition: Callable[[RunStatus], bool], seconds: float = 60.0) -> RunStatus:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        status = run.poll()
        if condition(status):
            return status
        time.sleep(0.01)
    raise AssertionError(f"not within {seconds} s: {run.poll()}")


def activate(run: HardwareRun) -> None:
    """Arm; repeatedly where this machine was too busy to be in time."""
    for _ in range(5):
        run.request(ARM)
        status = wait_until(run, lambda status: status.state in (State.ACTIVE, State.FAULT))
        if status.state is State.ACTIVE and np.any(
            wait_until(run, lambda status: bool(status.row["force"].any())).row["torque"]
        ):
            return
        run.request(CLEAR)
        wait_until(run, lambda status: status.state is State.DISARMED)
    raise AssertionError(f"never active: {status.fault.words(status.value)}")


@contextlib.contextmanager
def running(path: Path | None = None, clock: ServoClock = LENIENT_CLOCK) -> Iterator[HardwareRun]:
    with HardwareRun(servo_with_own_device, PERIOD, clock, job(path) if path else None) as run:
        run.start()
        activate(run)
        yield run


def assert_keeps_running(run: HardwareRun, ticks: int = 100) -> None:
    before = float(run.poll().row["tick"])
    status = wait_until(run, lambda status: float(status.row["tick"]) > before + ticks)
    assert (status.state, status.fault) == (State.ACTIVE, Fault.NONE)


def assert_complete(path: Path, ended: Ended | None) -> None:
    """The recording opens and lacks only missed deadlines; its length is the servo's count where that is known."""
    with Recording(path) as recording:
        tick, missed, dropped = (recording.channel("ticks", name)[:] for name in ("tick", "missed", "dropped"))
        for name in ("p", "force", "torque", "hand_force"):
            assert np.isfinite(recording.channel("ticks", name)[:]).all()
    assert len(tick) > 20
    assert not dropped.any()
    np.testing.assert_array_equal(np.diff(tick) - 1, np.diff(missed))
    assert ended is None or len(tick) == ended.ticks


@pytest.mark.slow
def test_run_with_a_recorder_writes_nothing_to_stderr(tmp_path: Path) -> None:
    """Neither during the run nor when its three processes end."""
    script = (
        "import pathlib, sys; from tests.sim.hardware.test_processes import running\n"
        "with running(pathlib.Path(sys.argv[1])) as run: print(run.stop().ticks)"
    )
    path = tmp_path / "run.h5"
    ended = subprocess.run([sys.executable, "-c", script, str(path)], capture_output=True, text=True, check=True)
    assert int(ended.stdout) > 20
    assert path.exists()
    assert ended.stderr == ""


@pytest.mark.slow
def test_recorder_frozen_and_killed_costs_only_rows(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    with running(path) as run:
        assert run.recorder is not None
        wait_until(run, lambda status: status.recorded is not None and status.recorded.rows > 200)
        os.kill(run.recorder.pid, signal.SIGSTOP)
        assert_keeps_running(run)
        os.kill(run.recorder.pid, signal.SIGCONT)
        status = wait_until(run, lambda status: status.recorded is not None and status.recorded.rows > 400)
        assert status.recorded.dropped == 0
        os.kill(run.recorder.pid, signal.SIGKILL)
        assert_keeps_running(run)
        assert run.poll().recorded is not None
        assert not run.poll().recorded.alive
        ended = run.stop()
        assert ended is not None
        assert not ended.broken
    with Recording(path) as recording:
        assert recording.summary is None
        ticks = recording.channel("ticks", "tick")[:]
        assert len(ticks) > 100
        assert (np.diff(ticks) > 0).all()
        assert np.isfinite(recording.channel("ticks", "hand_force")[:]).all()


@pytest.mark.processes
def test_recording_of_a_run_is_complete_and_counts_missed_deadlines(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    with running(path) as run:
        assert_keeps_running(run, 200)
        ended = run.stop()
    assert ended is not None
    assert_complete(path, ended)
    with Recording(path) as recording:
        ticks = recording.channel("ticks", "tick")[:]
        assert recording.channel("ticks", "missed")[-1] == ended.missed
        np.testing.assert_allclose(recording.channel("ticks", "t")[:], ticks * PERIOD, atol=1e-9)
    assert ended.compute.times == ended.ticks
    assert ended.compute.p50 <= ended.compute.p99 <= ended.compute.p999 <= ended.compute.longest
    assert ended.descriptors == 0


def read_as_page(status: SharedNumbers, started: SharedNumbers) -> None:
    """Reads the servo's row as a page does, until its parent has ended."""
    row, parent = np.zeros(ROW_SIZE), os.getppid()
    while os.getppid() == parent:
        status.read(row)
        started.write(np.ones(1))
        time.sleep(1.0 / 60.0)


@pytest.mark.slow
def test_servo_does_not_wait_for_a_frozen_or_killed_page(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    started, seen = SharedNumbers(1), np.zeros(1)
    context = multiprocessing.get_context("spawn")
    with running(path) as run:
        page = context.Process(target=read_as_page, args=(run.status, started), daemon=True)
        page.start()
        wait_until(run, lambda status: started.read(seen) and seen[0] > 0.0)
        assert page.pid is not None
        for sent in (signal.SIGSTOP, signal.SIGKILL):
            os.kill(page.pid, sent)
            assert_keeps_running(run)
        page.join()
        ended = run.stop()
    started.close()
    assert_complete(path, ended)


def record_with_size_limit(size: int, *arguments) -> None:
    """A recorder whose file may not grow beyond a size [bytes], as on a full disk."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
    record_rows(*arguments)


@pytest.mark.processes
def test_message_of_a_failing_device_is_in_the_fault_text() -> None:
    with HardwareRun(servo_with_failing_device, PERIOD, LENIENT_CLOCK) as run:
        run.start()
        status = wait_until(run, lambda status: bool(status.detail))
    assert status.fault_text == "the device reported error 0 (mine.py:3: ValueError: bad)"


@pytest.mark.processes
def test_full_disk_ends_the_recording_but_not_the_run(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    with HardwareRun(servo_with_own_device, PERIOD, LENIENT_CLOCK, job(path)) as run:
        assert run.recorder is not None
        run.recorder._target = functools.partial(record_with_size_limit, 1_000_000)
        run.start()
        activate(run)
        status = wait_until(run, lambda status: status.recorded is not None and status.recorded.error != 0)
        assert not status.recorded.alive
        assert_keeps_running(run)
    with Recording(path) as recording:
        ticks = recording.channel("ticks", "tick")[:]
        assert 100 < len(ticks) < 2000
        assert (np.diff(ticks) > 0).all()


@pytest.mark.processes
def test_frozen_controls_are_a_fault_that_returning_controls_can_clear(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    with running(path, ServoClock(late=20.0, heartbeat=HEARTBEAT_LIMIT)) as run:
        time.sleep(2.0 * HEARTBEAT_LIMIT)
        status = wait_until(run, lambda status: status.fault is not Fault.NONE)
        assert status.fault is Fault.CONTROL_LOST
        assert not status.row["torque"].any()
        time.sleep(0.1)
        assert wait_until(run, lambda status: True).state is State.FAULT
        run.request(ARM)
        wait_for_ticks(run)
        assert run.poll().state is State.FAULT
        run.request(CLEAR)
        wait_until(run, lambda status: status.state is State.DISARMED)
        activate(run)
        ended = run.stop()
    assert_complete(path, ended)


def wait_for_ticks(run: HardwareRun, ticks: int = 20) -> None:
    before = float(run.poll().row["tick"])
    wait_until(run, lambda status: float(status.row["tick"]) > before + ticks)


@pytest.mark.processes
@pytest.mark.parametrize("stall", [0.05, 0.5])
def test_stopped_servo_misses_deadlines_and_does_not_catch_up(tmp_path: Path, stall: float) -> None:
    """A stop of 50 ms is counted with a limit above it; one of 500 ms is a fault with a limit of 200 ms."""
    path = tmp_path / "run.h5"
    with running(path, ServoClock(late=LATE_LIMIT if stall > LATE_LIMIT else 20.0, heartbeat=20.0)) as run:
        assert run.servo.pid is not None
        begin, before = time.monotonic(), run.poll().row
        os.kill(run.servo.pid, signal.SIGSTOP)
        time.sleep(stall)
        os.kill(run.servo.pid, signal.SIGCONT)
        wait_for_ticks(run, round(stall / PERIOD) + 20)
        after = run.poll().row
        assert after["missed"] - before["missed"] >= stall / PERIOD - 2
        ran = after["tick"] - before["tick"] - (after["missed"] - before["missed"])
        assert ran <= (time.monotonic() - begin - stall) / PERIOD + 5
        if stall <= LATE_LIMIT:
            assert Fault(int(after["fault"])) is Fault.NONE
        else:
            assert Fault(int(after["fault"])) is Fault.SERVO_LATE
            assert not after["torque"].any()
        ended = run.stop()
    assert_complete(path, ended)


def test_servo_counts_as_stopped_only_beyond_its_permitted_lateness(monkeypatch: pytest.MonkeyPatch) -> None:
    with HardwareRun(servo_with_own_device, PERIOD, ServoClock(late=0.5)) as run:
        run.servo, now = cast(BaseProcess, SimpleNamespace(is_alive=lambda: True, pid=None)), time.monotonic()
        run.poll()
        for later, alive in ((0.6, True), (0.8, False)):
            monkeypatch.setattr(time, "monotonic", lambda later=later: now + later)
            assert run.poll().alive == alive


@pytest.mark.slow
def test_device_watchdog_releases_when_the_servo_is_stopped_or_killed(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    shown, seen = SharedNumbers(SHOWN_SIZE), np.zeros(SHOWN_SIZE)
    context = multiprocessing.get_context("spawn")
    device_process = context.Process(
        target=host_device, args=(emulated_device, EmulatedEnd(theirs, shown, PERIOD), True), daemon=True
    )
    device_process.start()

    def pushes() -> bool:
        shown.read(seen)
        return bool(seen[SHOWN_TORQUE : SHOWN_TORQUE + 3].any())

    try:
        with HardwareRun(
            functools.partial(servo_over_packets, ours), PERIOD, ServoClock(LATE_LIMIT, 20.0), job(path)
        ) as run:
            run.start()
            assert run.servo.pid is not None
            for signals in ((signal.SIGSTOP, signal.SIGCONT), (signal.SIGKILL,)):
                activate(run)
                wait_until(run, lambda status: pushes())
                trips = seen[SHOWN_TRIPS]
                os.kill(run.servo.pid, signals[0])
                wait_until(run, lambda status: not pushes(), 2.0)
                assert seen[SHOWN_TRIPS] > trips
                wait_until(run, lambda status: not status.alive)
                for resumed in signals[1:]:
                    time.sleep(2.0 * LATE_LIMIT)
                    os.kill(run.servo.pid, resumed)
                    status = wait_until(run, lambda status: status.fault is not Fault.NONE)
                    # Stale readings if it was stopped just before one.
                    assert status.fault in (Fault.SERVO_LATE, Fault.READING_STALE)
                    assert not pushes()
                    run.request(CLEAR)
                    wait_until(run, lambda status: status.state is State.DISARMED)
            assert run.stop() is None
        assert_complete(path, None)
    finally:
        device_process.kill()
        device_process.join()
        shown.close()
        ours.close()
        theirs.close()


@pytest.mark.processes
def test_killed_device_is_a_fault(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    shown = SharedNumbers(SHOWN_SIZE)
    context = multiprocessing.get_context("spawn")
    device_process = context.Process(
        target=host_device, args=(emulated_device, EmulatedEnd(theirs, shown, PERIOD), True), daemon=True
    )
    device_process.start()
    theirs.close()
    try:
        with HardwareRun(functools.partial(servo_over_packets, ours), PERIOD, LENIENT_CLOCK, job(path)) as run:
            run.start()
            ours.close()
            activate(run)
            device_process.kill()

            def is_unplugged(status: RunStatus) -> bool:
                if status.fault is Fault.READING_STALE:  # a killed process is silent before its socket closes
                    run.request(CLEAR)
                return status.fault is Fault.UNPLUGGED

            assert not wait_until(run, is_unplugged).row["torque"].any()
            ended = run.stop()
        assert_complete(path, ended)
    finally:
        device_process.kill()
        device_process.join()
        shown.close()


def open_missing_device() -> None:
    raise SimError("no such device; expected one that is plugged in")


@pytest.mark.processes
def test_error_on_opening_a_device_reaches_the_controls() -> None:
    with (
        HardwareRun(open_missing_device, PERIOD, LENIENT_CLOCK) as run,
        pytest.raises(SimError, match="no such device"),
    ):
        run.start()
