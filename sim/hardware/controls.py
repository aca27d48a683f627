"""The control side of a hardware run: it starts the servo and recorder processes, arms, monitors and stops them.

Each `poll` sends a heartbeat; without it, the servo switches the motors off. In turn, `poll` checks that the servo
ticks.
"""

import multiprocessing
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import NamedTuple

import numpy as np

from controllers.safety.arming import NO_REQUEST, State
from controllers.safety.faults import Fault
from geometry.arrays import Array
from sim.errors import SimError
from sim.hardware import recorder_process as recording
from sim.hardware import servo_process as servo
from sim.hardware.gated_servo import ROW_SIZE, GatedServo, columns
from sim.hardware.process_start import start_without_sigint
from sim.hardware.recorder_process import RecordingJob
from sim.hardware.servo_process import Channels, Ended, Ready, Refused, ServoClock, serve
from sim.hardware.shared import Ring, SharedNumbers

SERVO_TIMEOUT = 0.2
"""Time without a tick, beyond its largest permitted lateness, after which the servo counts as dead [s]."""
_START_TIMEOUT, _END_TIMEOUT = 600.0, 10.0  # [s] timeouts for a process to start, which may compile, and to end


class RecorderStatus(NamedTuple):
    """Status of the recorder.

    Attributes
    ----------
    alive : bool
        Whether its process runs without an error.
    rows, dropped : int
        Ticks written, and ticks lost because it did not keep up.
    error : int
        errno of the error that stopped it, or 0.
    hand_force : Array
        The twin's estimate of the hand's force [N], in H, shape (3,).
    apart : float
        Distance from the twin's predicted tip to the device's [m].
    """

    alive: bool
    rows: int
    dropped: int
    error: int
    hand_force: Array
    apart: float


class RunStatus(NamedTuple):
    """Status of a hardware run.

    Attributes
    ----------
    alive : bool
        Whether the servo ticks.
    state : State
        State of the gate.
    fault : Fault
        The latched fault, if any.
    value : float
        Value of the fault.
    row : dict
        The last tick, by `sim.hardware.gated_servo.CHANNELS`.
    recorded : RecorderStatus, optional
        Status of the recorder; None if nothing is recorded.
    detail : str
        The device's own message on the fault; empty if there is none.
    """

    alive: bool
    state: State
    fault: Fault
    value: float
    row: dict[str, Array]
    recorded: RecorderStatus | None
    detail: str = ""

    @property
    def fault_text(self) -> str:
        """The fault in words, with the device's message."""
        return self.fault.words(self.value) + (f" ({self.detail})" if self.detail else "")


class HardwareRun:
    """Servo and recorder in processes of their own, controlled from here; a context manager that ends them.

    Parameters
    ----------
    make : callable
        Opens the device and makes the gated servo, in the servo's process; picklable.
    period : float
        Servo period [s].
    clock : ServoClock
        Timing limits of the servo.
    job : RecordingJob, optional
        What is recorded; by default nothing.

    Attributes
    ----------
    servo : BaseProcess
        The servo's process.
    recorder : BaseProcess or None
        The recorder's process.
    status : SharedNumbers
        The servo's last row, also for other processes that display it.
    recorder_status : SharedNumbers
        The recorder's status, likewise.
    """

    def __init__(
        self, make: Callable[[], GatedServo], period: float, clock: ServoClock, job: RecordingJob | None = None
    ):
        context = multiprocessing.get_context("spawn")
        self._orders, self.status = SharedNumbers(servo.ORDER_SIZE), SharedNumbers(ROW_SIZE)
        self._rows = Ring(round(recording.RING_SECONDS / period), ROW_SIZE)
        self._stop_recording, self.recorder_status = SharedNumbers(1), SharedNumbers(recording.RECORDER_SIZE)
        self._reports, report_sender = context.Pipe(duplex=False)
        self._order, self._row, self._last_tick = np.zeros(servo.ORDER_SIZE), np.zeros(ROW_SIZE), (-1.0, 0.0)
        self._timeout = SERVO_TIMEOUT + clock.late
        self._detail = SharedNumbers(servo.DETAIL_SIZE)
        channels = Channels(self._orders, self.status, self._rows, self._detail, report_sender)
        self.servo: BaseProcess = context.Process(target=serve, args=(make, channels, clock), name="servo", daemon=True)
        self.recorder: BaseProcess | None = None
        if job is not None:
            arguments = job, self._rows, self._stop_recording, self.recorder_status
            self.recorder = context.Process(target=recording.record_rows, args=arguments, name="recorder", daemon=True)
        self._report_sender: Connection = report_sender
        self._final_report: Ended | None = None

    def __enter__(self) -> "HardwareRun":
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
        for shared in (self._orders, self.status, self._rows, self._detail, self._stop_recording, self.recorder_status):
            shared.close()

    def start(self) -> Ready:
        """Start the processes, and wait until the servo ticks.

        Raises
        ------
        SimError
            If the servo could not start; the message says why.
        """
        if self.recorder is not None:
            start_without_sigint(self.recorder)
            self._wait_for_recorder(self.recorder)
        start_without_sigint(self.servo)
        self._report_sender.close()
        report = self._receive_report(_START_TIMEOUT)
        if isinstance(report, Ready):
            self.poll()
            return report
        raise SimError(report.why if isinstance(report, Refused) else "the servo's process ended before it began")

    def _wait_for_recorder(self, recorder: BaseProcess) -> None:
        """Wait until the recorder is ready or has ended; `poll` then shows whether it could start."""
        status, deadline = np.zeros(recording.RECORDER_SIZE), time.monotonic() + _START_TIMEOUT
        while recorder.is_alive() and status[recording.RECORDER_READY] == 0.0 and time.monotonic() < deadline:
            time.sleep(0.01)
            self.recorder_status.read(status)

    def _receive_report(self, timeout: float) -> Ready | Refused | Ended | None:
        try:
            return self._reports.recv() if self._reports.poll(timeout) else None
        except EOFError:
            return None

    def request(self, event: int) -> None:
        """Send `ARM`, `DISARM` or `CLEAR` (of `controllers.safety.arming`)."""
        self._order[servo.ORDER_NUMBER] += 1.0
        self._order[servo.ORDER_REQUEST] = event
        self._orders.write(self._order)

    def poll(self) -> RunStatus:
        """Send a heartbeat to the servo, and return the status of the run."""
        self._order[servo.ORDER_BEAT] += 1.0
        self._orders.write(self._order)
        self.status.read(self._row)
        row, now = {name: channel[0] for name, channel in columns(self._row[None].copy()).items()}, time.monotonic()
        tick = float(row["tick"])
        if tick != self._last_tick[0]:
            self._last_tick = tick, now
        alive = self.servo.is_alive() and now - self._last_tick[1] < self._timeout
        state, fault = State(int(row["state"])), Fault(int(row["fault"]))
        codes = np.zeros(servo.DETAIL_SIZE)
        self._detail.read(codes)
        detail = "".join(map(chr, codes.astype(int))).rstrip("\0")
        return RunStatus(alive, state, fault, float(row["fault_value"]), row, self._read_recorder_status(), detail)

    def _read_recorder_status(self) -> RecorderStatus | None:
        if self.recorder is None:
            return None
        status = np.zeros(recording.RECORDER_SIZE)
        self.recorder_status.read(status)
        error = int(status[recording.RECORDER_ERROR])
        force = status[recording.RECORDER_FORCE : recording.RECORDER_FORCE + 3]
        alive = self.recorder.is_alive() and error == 0
        return RecorderStatus(
            alive, int(status[recording.RECORDER_ROWS]), int(status[recording.RECORDER_DROPPED]), error, force,
            float(status[recording.RECORDER_APART]),
        )  # fmt: skip

    def stop(self) -> Ended | None:
        """End the servo, then the recorder once it has written all rows; returns the servo's final report, if any."""
        if self._final_report is None and self.servo.pid is not None:
            self._order[servo.ORDER_STOP], self._order[servo.ORDER_REQUEST] = 1.0, NO_REQUEST
            self._orders.write(self._order)
            report = self._receive_report(_END_TIMEOUT)
            self._final_report = report if isinstance(report, Ended) else None
            _end_process(self.servo)
        if self.recorder is not None and self.recorder.pid is not None:
            self._stop_recording.write(np.ones(1))
            _end_process(self.recorder)
        return self._final_report


def _end_process(process: BaseProcess) -> None:
    process.join(_END_TIMEOUT)
    if process.is_alive():
        process.kill()
        process.join()
