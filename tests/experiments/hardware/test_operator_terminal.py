"""Keys of the operator beside a device: Enter arms and disarms; keys typed earlier are ignored."""

import errno
import os
import sys
from collections.abc import Callable, Iterator
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console

from controllers.safety.arming import ARM, CLEAR, DISARM, State
from controllers.safety.faults import Fault
from experiments.hardware.operator_terminal import attend
from sim.hardware.controls import RecorderStatus, RunStatus
from sim.hardware.gated_servo import ROW_SIZE, columns

ROW = {name: channel[0] for name, channel in columns(np.zeros((1, ROW_SIZE))).items()}
Script = dict[int, Callable[["ScriptedRun"], object]]


class ScriptedRun:
    """A run without processes: requests take effect at once, and a script has further events by poll number."""

    def __init__(self, script: Script):
        self.script, self.looks, self.requests = script, 0, list[int]()
        self.state, self.fault, self.recorded = State.DISARMED, Fault.NONE, None

    def request(self, event: int) -> None:
        self.requests.append(event)
        if event == CLEAR:
            self.state, self.fault = State.DISARMED, Fault.NONE
        elif self.state is not State.FAULT:
            self.state = State.ACTIVE if event == ARM else State.DISARMED

    def fails(self) -> None:
        self.state, self.fault = State.FAULT, Fault.TOO_FAST

    def poll(self) -> RunStatus:
        self.script.get(self.looks, lambda stand: None)(self)
        self.looks += 1
        return RunStatus(True, self.state, self.fault, 1.6, ROW, self.recorded)


@pytest.fixture
def type_keys(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[bytes], object]]:
    """A pseudo-terminal as stdin; the function types into it."""
    ours, theirs = os.openpty()
    with open(theirs, encoding="utf-8") as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        yield lambda typed: os.write(ours, typed)
    os.close(ours)


def test_end_of_recording_is_reported_once_with_its_reason(type_keys, capsys) -> None:
    stand, console = ScriptedRun({5: _fills_the_disk, 30: _interrupt}), Console(force_terminal=False)
    attend(stand, 60.0, SimpleNamespace(arm=False, dead_man=True), console)  # type: ignore[arg-type]
    stdout = capsys.readouterr().out
    assert stdout.count("The recording has ended (No space left on device) after 700 ticks") == 1


def _fills_the_disk(stand: ScriptedRun) -> None:
    stand.recorded = RecorderStatus(False, 700, 0, errno.ENOSPC, np.zeros(3), 0.0)


def requests_of(script: Script, arm: bool = False) -> list[int]:
    """Requests to a run that ends with Ctrl-C, unless the script ends it before."""
    stand = ScriptedRun(script | {30: _interrupt})
    attend(stand, 60.0, SimpleNamespace(arm=arm, dead_man=True), Console(quiet=True))  # type: ignore[arg-type]
    return stand.requests


def _interrupt(stand: ScriptedRun) -> None:
    raise KeyboardInterrupt


@pytest.mark.slow
def test_enter_toggles_arming(type_keys) -> None:
    assert requests_of({3: lambda _: type_keys(b"\n")}) == [ARM, DISARM]
    assert requests_of({3: lambda _: type_keys(b"\n"), 6: lambda _: type_keys(b"\n")}) == [ARM, DISARM, DISARM]
    assert (
        requests_of({3: lambda _: type_keys(b"\n"), 6: lambda _: type_keys(b"\n"), 9: lambda _: type_keys(b"\n")})[2]
        == ARM
    )


def test_keys_typed_before_the_prompt_are_ignored(type_keys) -> None:
    type_keys(b"\n\n")
    assert requests_of({}) == [DISARM]


def test_enter_typed_before_a_fault_does_not_clear_it(type_keys) -> None:
    def typed_and_fails(stand: ScriptedRun) -> None:
        type_keys(b"\n")
        stand.fails()

    assert requests_of({3: lambda _: type_keys(b"\n"), 6: typed_and_fails}) == [ARM, DISARM]


def test_enter_after_a_fault_clears_it(type_keys) -> None:
    assert requests_of({3: lambda _: type_keys(b"\n"), 6: ScriptedRun.fails, 9: lambda _: type_keys(b"\n")}) == [
        ARM,
        CLEAR,
        ARM,
        DISARM,
    ]


def test_end_of_input_ends_the_run_without_arming(type_keys) -> None:
    stand = ScriptedRun({3: lambda _: type_keys(b"\x04")})
    attend(stand, 60.0, SimpleNamespace(arm=False, dead_man=True), Console(quiet=True))
    assert stand.requests == [DISARM]
    assert stand.looks < 10


def test_unattended_run_ends_at_a_fault(type_keys) -> None:
    type_keys(b"\n")
    assert requests_of({4: ScriptedRun.fails}, arm=True) == [ARM]
