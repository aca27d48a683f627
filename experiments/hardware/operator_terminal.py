"""Operator's terminal of a hardware run: Enter arms and disarms, Ctrl-C ends, and changes of state are printed.

Enter never does more than the screen says: keys pressed before a prompt or a fault are discarded, Enter under force
disarms, and the end of the input, such as by Ctrl-D, ends the run.
"""

import contextlib
import enum
import os
import select
import sys
import time

from rich.console import Console

from controllers.safety.arming import ARM, CLEAR, DISARM, State
from controllers.safety.faults import Fault
from experiments.hardware.link import link_now
from experiments.hardware.run_options import RunHardware
from sim.hardware.controls import HardwareRun, RunStatus

_POLL_INTERVAL = 0.05  # [s] between two polls, each of which is also the heartbeat of the controls
_DISARMED_TEXT = "Disarmed: the motors are off."


class _Key(enum.Enum):
    NONE = 0
    ENTER = 1
    END = 2


def attend(run: HardwareRun, seconds: float, options: RunHardware, console: Console) -> RunStatus:
    """Arm, poll and print changes of state for `seconds` [s] from the first arming on; returns the last poll.

    With `options.arm` no operator is asked: the device is armed at once, and a fault ends the run.
    """
    terminal = sys.stdin.isatty() and not options.arm
    end_time, state, status, was_recording = None, None, run.poll(), True
    if terminal:
        _discard_pending_keys()
        console.print("Hold the stylus on its curve, with the switch pressed, and press Enter to arm; Ctrl-C ends.")
    else:
        run.request(ARM)
        end_time = time.monotonic() + seconds
    with contextlib.suppress(KeyboardInterrupt), console.status("") as line:
        while end_time is None or time.monotonic() < end_time:
            time.sleep(_POLL_INTERVAL)
            status = run.poll()
            line.update(link_now(status.row))
            if not status.alive:
                console.print("The servo has stopped; the motors are off if the device has a watchdog.")
                return status
            if status.recorded is not None and not status.recorded.alive and was_recording:
                was_recording = False
                reason = f" ({os.strerror(status.recorded.error)})" if status.recorded.error else ""
                rows = f"after {status.recorded.rows} ticks; they are kept, and the run goes on."
                console.print(f"The recording has ended{reason} {rows}", highlight=False)
            if status.state is not state:
                state = status.state
                console.print(_status_line(status, options.dead_man, terminal), highlight=False)
                if terminal and state is State.FAULT:
                    _discard_pending_keys()
            if status.fault is not Fault.NONE and not terminal:
                return status
            key = _pressed_key() if terminal else _Key.NONE
            if key is _Key.END:
                break
            if key is _Key.ENTER and _handle_enter(run, status):
                end_time = end_time or time.monotonic() + seconds
    run.request(DISARM)
    return status


def _handle_enter(run: HardwareRun, status: RunStatus) -> bool:
    """Do what Enter means in the current state; returns whether it arms the device."""
    if status.state not in (State.DISARMED, State.FAULT):
        run.request(DISARM)
        return False
    if status.state is State.FAULT:
        run.request(CLEAR)
        time.sleep(2.0 * _POLL_INTERVAL)
    run.request(ARM)
    return True


def _pressed_key() -> _Key:
    """The key that was pressed, without waiting."""
    if not select.select([sys.stdin], [], [], 0.0)[0]:
        return _Key.NONE
    return _Key.ENTER if sys.stdin.readline() else _Key.END


def _discard_pending_keys() -> None:
    """Discard pending input."""
    import termios  # not on Windows

    termios.tcflush(sys.stdin.fileno(), termios.TCIFLUSH)


def _status_line(status: RunStatus, dead_man: bool, terminal: bool) -> str:
    hint = " Enter arms it." if terminal else ""
    texts = {
        State.DISARMED: _DISARMED_TEXT + hint,
        State.ARMING: "Arming: no force yet"
        + (", the switch has to be held, and" if dead_man else ";")
        + " the requested force has to be small first.",
        State.RAMPING: "The force ramps up.",
        State.ACTIVE: "Active." + (" Enter switches the motors off." if terminal else ""),
        State.FAULT: f"Motors switched off at {float(status.row['t']):.3f} s: {status.fault_text}."
        + (" Enter clears it, and arms again." if terminal else ""),
    }
    return f"{float(status.row['t']):8.2f} s  {texts[status.state]}"
