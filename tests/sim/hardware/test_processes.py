"""Kill or freeze whom you like: the servo goes on, or lets go; and what was recorded can be read.

Those that no busy machine disturbs are `slow`, the others `processes`.
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
from pathlib import Path

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
from tests.sim.hardware.process_factories import PERIOD, device, in_process, over_packets

CLOCK = ServoClock(late=20.0, heartbeat=20.0)
"""So long that a busy machine makes no fault of its own; a test of lateness or silence has a clock of its own."""
LATE, SILENT = 0.2, 0.6


def job(path: Path) -> RecordingJob:
    return RecordingJob(path, {"kind": "test"}, {}, 1, SceneConfig(servo_period=PERIOD, physics_step=PERIOD))


def until(run: HardwareRun, what: Callable[[RunStatus], bool], seconds: float = 60.0) -> RunStatus:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        look = run.poll()
        if what(look):
            return look
        time.sleep(0.01)
    raise AssertionError(f"not within {seconds} s: {run.poll()}")


def active(run: HardwareRun) -> None:
    """Arm, again where this machine was too busy to be in time."""
    for _ in range(5):
        run.request(ARM)
        look = until(run, lambda look: look.state in (State.ACTIVE, State.FAULT))
        if look.state is State.ACTIVE and np.any(until(run, lambda look: bool(look.row["force"].any())).row["torque"]):
            return
        run.request(CLEAR)
        until(run, lambda look: look.state is State.DISARMED)
    raise AssertionError(f"never active: {look.fault.words(look.value)}")


@contextlib.contextmanager
def running(path: Path | None = None, clock: ServoClock = CLOCK) -> Iterator[HardwareRun]:
    with HardwareRun(in_process, PERIOD, clock, job(path) if path else None) as run:
        run.start()
        active(run)
        yield run


def assert_goes_on(run: HardwareRun, ticks: int = 100) -> None:
    before = float(run.poll().row["tick"])
    look = until(run, lambda look: float(look.row["tick"]) > before + ticks)
    assert (look.state, look.fault) == (State.ACTIVE, Fault.NONE)


def assert_whole(path: Path, ended: Ended | None) -> None:
    """The recording opens, and leaves out missed deadlines only: what the servo ran, where it could still say so."""
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
    """Neither while it runs, nor when its three processes end."""
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
        until(run, lambda look: look.recorded is not None and look.recorded.rows > 200)
        os.kill(run.recorder.pid, signal.SIGSTOP)
        assert_goes_on(run)
        os.kill(run.recorder.pid, signal.SIGCONT)
        look = until(run, lambda look: look.recorded is not None and look.recorded.rows > 400)
        assert look.recorded.dropped == 0
        os.kill(run.recorder.pid, signal.SIGKILL)
        assert_goes_on(run)
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
        assert_goes_on(run, 200)
        ended = run.stop()
    assert ended is not None
    assert_whole(path, ended)
    with Recording(path) as recording:
        ticks = recording.channel("ticks", "tick")[:]
        assert recording.channel("ticks", "missed")[-1] == ended.missed
        np.testing.assert_allclose(recording.channel("ticks", "t")[:], ticks * PERIOD, atol=1e-9)
    assert ended.compute.times == ended.ticks
    assert ended.compute.p50 <= ended.compute.p99 <= ended.compute.p999 <= ended.compute.longest
    assert ended.descriptors == 0


def bystander(status: SharedNumbers, began: SharedNumbers) -> None:
    """Reads the servo's row as a page does, until whoever started it is gone."""
    row, parent = np.zeros(ROW_SIZE), os.getppid()
    while os.getppid() == parent:
        status.read(row)
        began.write(np.ones(1))
        time.sleep(1.0 / 60.0)


@pytest.mark.slow
def test_servo_does_not_wait_for_a_frozen_or_killed_page(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    began, seen = SharedNumbers(1), np.zeros(1)
    context = multiprocessing.get_context("spawn")
    with running(path) as run:
        page = context.Process(target=bystander, args=(run.status, began), daemon=True)
        page.start()
        until(run, lambda look: began.read(seen) and seen[0] > 0.0)
        assert page.pid is not None
        for sent in (signal.SIGSTOP, signal.SIGKILL):
            os.kill(page.pid, sent)
            assert_goes_on(run)
        page.join()
        ended = run.stop()
    began.close()
    assert_whole(path, ended)


def limited(size: int, *arguments) -> None:
    """A recorder whose disk is full at so many bytes."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
    record_rows(*arguments)


@pytest.mark.processes
def test_full_disk_ends_the_recording_but_not_the_run(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    with HardwareRun(in_process, PERIOD, CLOCK, job(path)) as run:
        assert run.recorder is not None
        run.recorder._target = functools.partial(limited, 1_000_000)
        run.start()
        active(run)
        look = until(run, lambda look: look.recorded is not None and look.recorded.error != 0)
        assert not look.recorded.alive
        assert_goes_on(run)
    with Recording(path) as recording:
        ticks = recording.channel("ticks", "tick")[:]
        assert 100 < len(ticks) < 2000
        assert (np.diff(ticks) > 0).all()


@pytest.mark.processes
def test_frozen_controls_are_a_fault_that_returning_controls_can_clear(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    with running(path, ServoClock(late=20.0, heartbeat=SILENT)) as run:
        time.sleep(2.0 * SILENT)
        look = until(run, lambda look: look.fault is not Fault.NONE)
        assert look.fault is Fault.CONTROL_LOST
        assert not look.row["torque"].any()
        time.sleep(0.1)
        assert until(run, lambda look: True).state is State.FAULT
        run.request(ARM)
        goes_past(run)
        assert run.poll().state is State.FAULT
        run.request(CLEAR)
        until(run, lambda look: look.state is State.DISARMED)
        active(run)
        ended = run.stop()
    assert_whole(path, ended)


def goes_past(run: HardwareRun, ticks: int = 20) -> None:
    before = float(run.poll().row["tick"])
    until(run, lambda look: float(look.row["tick"]) > before + ticks)


@pytest.mark.processes
@pytest.mark.parametrize("stall", [0.05, 0.5])
def test_stopped_servo_misses_deadlines_and_does_not_catch_up(tmp_path: Path, stall: float) -> None:
    """A stop of 50 ms is counted where more is allowed; one of 500 ms is a fault where 200 ms are."""
    path = tmp_path / "run.h5"
    with running(path, ServoClock(late=LATE if stall > LATE else 20.0, heartbeat=20.0)) as run:
        assert run.servo.pid is not None
        begin, before = time.monotonic(), run.poll().row
        os.kill(run.servo.pid, signal.SIGSTOP)
        time.sleep(stall)
        os.kill(run.servo.pid, signal.SIGCONT)
        goes_past(run, round(stall / PERIOD) + 20)
        after = run.poll().row
        assert after["missed"] - before["missed"] >= stall / PERIOD - 2
        ran = after["tick"] - before["tick"] - (after["missed"] - before["missed"])
        assert ran <= (time.monotonic() - begin - stall) / PERIOD + 5
        if stall <= LATE:
            assert Fault(int(after["fault"])) is Fault.NONE
        else:
            assert Fault(int(after["fault"])) is Fault.SERVO_LATE
            assert not after["torque"].any()
        ended = run.stop()
    assert_whole(path, ended)


@pytest.mark.slow
def test_device_watchdog_releases_when_the_servo_is_stopped_or_killed(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    shown, seen = SharedNumbers(SHOWN_SIZE), np.zeros(SHOWN_SIZE)
    context = multiprocessing.get_context("spawn")
    hosted = context.Process(target=host_device, args=(device, EmulatedEnd(theirs, shown, PERIOD), True), daemon=True)
    hosted.start()

    def pushes() -> bool:
        shown.read(seen)
        return bool(seen[SHOWN_TORQUE : SHOWN_TORQUE + 3].any())

    try:
        with HardwareRun(functools.partial(over_packets, ours), PERIOD, ServoClock(LATE, 20.0), job(path)) as run:
            run.start()
            assert run.servo.pid is not None
            for signals in ((signal.SIGSTOP, signal.SIGCONT), (signal.SIGKILL,)):
                active(run)
                until(run, lambda look: pushes())
                trips = seen[SHOWN_TRIPS]
                os.kill(run.servo.pid, signals[0])
                until(run, lambda look: not pushes(), 2.0)
                assert seen[SHOWN_TRIPS] > trips
                until(run, lambda look: not look.alive)
                for back in signals[1:]:
                    time.sleep(2.0 * LATE)
                    os.kill(run.servo.pid, back)
                    look = until(run, lambda look: look.fault is not Fault.NONE)
                    assert look.fault in (Fault.SERVO_LATE, Fault.READING_STALE)  # the latter if just before
                    assert not pushes()
                    run.request(CLEAR)
                    until(run, lambda look: look.state is State.DISARMED)
            assert run.stop() is None
        assert_whole(path, None)
    finally:
        hosted.kill()
        hosted.join()
        shown.close()
        ours.close()
        theirs.close()


@pytest.mark.processes
def test_killed_device_is_a_fault(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    shown = SharedNumbers(SHOWN_SIZE)
    context = multiprocessing.get_context("spawn")
    hosted = context.Process(target=host_device, args=(device, EmulatedEnd(theirs, shown, PERIOD), True), daemon=True)
    hosted.start()
    theirs.close()
    try:
        with HardwareRun(functools.partial(over_packets, ours), PERIOD, CLOCK, job(path)) as run:
            run.start()
            ours.close()
            active(run)
            hosted.kill()

            def gone(look: RunStatus) -> bool:
                if look.fault is Fault.READING_STALE:  # a process that is killed is silent before its socket closes
                    run.request(CLEAR)
                return look.fault is Fault.UNPLUGGED

            assert not until(run, gone).row["torque"].any()
            ended = run.stop()
        assert_whole(path, ended)
    finally:
        hosted.kill()
        hosted.join()
        shown.close()


def refuses() -> None:
    raise SimError("no such device; expected one that is plugged in")


@pytest.mark.processes
def test_error_on_opening_a_device_reaches_the_controls() -> None:
    with HardwareRun(refuses, PERIOD, CLOCK) as run, pytest.raises(SimError, match="no such device"):
        run.start()
