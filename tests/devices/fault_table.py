"""`make fault-table`: measures every injected fault and writes the table of the documentation.

Faults on the wire are injected here. Faults of processes are tests in real time: a row tells whether its test passes.
"""

import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from tests.devices.firmware import ROOT, compile_c
from tests.devices.wire_faults import INJECTIONS, REPEATS, Injection, inject

PAGE = ROOT / "docs" / "validation" / "fault-matrix.md"
BEGIN = "| injected | times | evident after | no torque commanded after | motors off after | latched | recording |"
TESTS = "tests/sim/hardware/test_processes.py", "tests/devices/test_fault_matrix.py"


class ProcessFault(NamedTuple):
    """A fault of a process, whose evidence is a test: cells of the table, and the beginning of the test's name."""

    description: str
    count: int
    detected_after: str
    command_zero_after: str
    motors_off_after: str
    latched: str
    recording: str
    test: str


_BUS_ERRORS = "test_occasional_bus_errors"
_SERVO_STOPPED = "test_stopped_servo_misses_deadlines"
_WATCHDOG = "test_device_watchdog_releases"
_RECORDER = "test_recorder_frozen_and_killed"
_PAGE = "test_servo_does_not_wait_for_a_frozen_or_killed_page"
PROCESS_FAULTS = (
    ProcessFault("duplicated, lost, late and singly spoiled reports, a third of all", 5, "at once", "not", "not",
                 "nothing: they are counted", "whole", _BUS_ERRORS),
    ProcessFault("host away for 5, 50, 500 ms", 3, "its next tick", "not", "10 (firmware's watchdog)",
                 "nothing: a gap, ramped in again", "whole", "test_late_host_trips_the_watchdog"),
    ProcessFault("servo SIGSTOP, 50 ms", 1, "when it goes on", "not", "not", "nothing: missed deadlines are counted",
                 "whole", _SERVO_STOPPED),
    ProcessFault("servo SIGSTOP, 500 ms", 1, "when it goes on", "0", "0", "SERVO_LATE", "whole", _SERVO_STOPPED),
    ProcessFault("servo SIGSTOP, device on packets", 1, "20 ms (device's watchdog)", "it is stopped", "at once",
                 "SERVO_LATE or CONTROL_LOST when it goes on", "whole", _WATCHDOG),
    ProcessFault("servo SIGKILL, device on packets", 1, "20 ms (device's watchdog)", "it is dead", "at once",
                 "none: the controls say that it is gone", "up to then", _WATCHDOG),
    ProcessFault("device's process killed", 1, "next tick", "0", "it is dead",
                 "UNPLUGGED, or READING_STALE before its socket closes", "whole", "test_killed_device"),
    ProcessFault("controls frozen", 1, "the heartbeat's time", "0", "0", "CONTROL_LOST", "whole",
                 "test_frozen_controls"),
    ProcessFault("page SIGSTOP", 1, "never", "not", "not", "nothing: nobody waits for it", "whole", _PAGE),
    ProcessFault("page SIGKILL", 1, "never", "not", "not", "nothing: nobody waits for it", "whole", _PAGE),
    ProcessFault("recorder SIGSTOP", 1, "never", "not", "not", "nothing: nobody waits for it",
                 "whole after 5 s or less", _RECORDER),
    ProcessFault("recorder SIGKILL", 1, "controls' next look", "not", "not", "nothing: controls say it", "up to then",
                 _RECORDER),
    ProcessFault("disk full", 1, "controls' next look", "not", "not", "nothing: controls say it", "up to then",
                 "test_full_disk_ends_the_recording"),
)  # fmt: skip


def row_of(process: ProcessFault, note: str) -> str:
    """A row of the table; the note says that its test has failed, or is empty."""
    return f"| {' | '.join(str(cell) for cell in process[:7])}{note} |"


def wire_row(injection: Injection, library: Path, folder: Path) -> str:
    """A row of the table, measured."""
    results = [inject(injection, seed, library, folder) for seed in range(REPEATS)]

    def worst(name: str) -> int:
        return max(getattr(each, name) for each in results)

    faults = ", ".join(sorted({each.fault.name for each in results}))
    whole = "whole" if all(each.recording_complete for each in results) else "**not whole**"
    zero = max(each.command_zero_after - each.detected_after for each in results)
    detected, off = worst("detected_after"), worst("motors_off_after")
    return f"| {injection.description} | {len(results)} | {detected} | {zero} | {off} | {faults} | {whole} |"


def table() -> Iterator[str]:
    """The table's lines."""
    yield BEGIN
    yield "|" + "---|" * (BEGIN.count("|") - 1)
    with tempfile.TemporaryDirectory() as name:
        library = compile_c(Path(name), ROOT / "firmware" / "hvf_hid.c")
        for injection in INJECTIONS:
            yield wire_row(injection, library, Path(name))
    names = " or ".join(dict.fromkeys(process.test for process in PROCESS_FAULTS))
    output = subprocess.run(
        [sys.executable, "-m", "pytest", "-o", "addopts=", "-v", "-k", names, *TESTS],
        cwd=ROOT, capture_output=True, text=True, check=False,
    ).stdout  # fmt: skip
    if "failed" in output.splitlines()[-1]:
        print(output, file=sys.stderr)
    for process in PROCESS_FAULTS:
        lines = [line for line in output.splitlines() if f"::{process.test}" in line]
        passed = bool(lines) and all("PASSED" in line for line in lines)
        yield row_of(process, "" if passed else " (**test failed**)")


def main() -> None:
    """Write the table into the page, between its marks."""
    page = PAGE.read_text(encoding="utf-8")
    before, _, rest = page.partition("<!-- table -->\n")
    _, _, after = rest.partition("<!-- end -->")
    PAGE.write_text(f"{before}<!-- table -->\n" + "\n".join(table()) + f"\n<!-- end -->{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
