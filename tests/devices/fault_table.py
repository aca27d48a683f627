"""`make fault-table`: every injected fault in one table of the documents, measured anew.

Those on the wire are injected here. Those of processes are tests against the clock: a row is there if its test passes.
"""

import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from tests.devices.firmware import ROOT, compiled
from tests.devices.wire_faults import INJECTIONS, ORDERS, Order, inject

PAGE = ROOT / "docs" / "validation" / "fault-matrix.md"
BEGIN = "| injected | times | evident after | no torque commanded after | motors off after | latched | recording |"
TESTS = "tests/sim/hardware/test_processes.py", "tests/devices/test_fault_matrix.py"


class Process(NamedTuple):
    """An injection whose evidence is a test: in words, how often, what comes of it, and the test's name."""

    words: str
    times: int
    evident: str
    zero: str
    off: str
    latched: str
    recording: str
    test: str


_COUNTED = "test_occasional_bus_errors"
_SERVO_STOPPED = "test_stopped_servo_misses_deadlines"
_WATCHDOG = "test_device_watchdog_releases"
_RECORDER = "test_recorder_frozen_and_killed"
_PAGE = "test_servo_does_not_wait_for_a_frozen_or_killed_page"
PROCESSES = (
    Process("duplicated, lost, late and singly spoiled reports, a third of all", 5, "at once", "not", "not",
            "nothing: they are counted", "whole", _COUNTED),
    Process("host away for 5, 50, 500 ms", 3, "its next tick", "not", "10 (firmware's watchdog)",
            "nothing: a gap, ramped in again", "whole", "test_late_host_trips_the_watchdog"),
    Process("servo SIGSTOP, 50 ms", 1, "when it goes on", "not", "not", "nothing: missed deadlines are counted",
            "whole", _SERVO_STOPPED),
    Process("servo SIGSTOP, 500 ms", 1, "when it goes on", "0", "0", "SERVO_LATE", "whole", _SERVO_STOPPED),
    Process("servo SIGSTOP, device on packets", 1, "20 ms (device's watchdog)", "it is stopped", "at once",
            "SERVO_LATE or CONTROL_LOST when it goes on", "whole", _WATCHDOG),
    Process("servo SIGKILL, device on packets", 1, "20 ms (device's watchdog)", "it is dead", "at once",
            "none: the controls say that it is gone", "up to then", _WATCHDOG),
    Process("device's process killed", 1, "next tick", "0", "it is dead",
            "UNPLUGGED, or READING_STALE before its socket closes", "whole", "test_killed_device"),
    Process("controls frozen", 1, "the heartbeat's time", "0", "0", "CONTROL_LOST", "whole",
            "test_frozen_controls"),
    Process("page SIGSTOP", 1, "never", "not", "not", "nothing: nobody waits for it", "whole", _PAGE),
    Process("page SIGKILL", 1, "never", "not", "not", "nothing: nobody waits for it", "whole", _PAGE),
    Process("recorder SIGSTOP", 1, "never", "not", "not", "nothing: nobody waits for it", "whole after 5 s or less",
            _RECORDER),
    Process("recorder SIGKILL", 1, "controls' next look", "not", "not", "nothing: controls say it", "up to then",
            _RECORDER),
    Process("disk full", 1, "controls' next look", "not", "not", "nothing: controls say it", "up to then",
            "test_full_disk_ends_the_recording"),
)  # fmt: skip


def row_of(process: Process, note: str) -> str:
    """A row of the table; the note is why it has failed, or empty."""
    return f"| {' | '.join(str(cell) for cell in process[:7])}{note} |"


def wire_row(order: Order, library: Path, folder: Path) -> str:
    """A row of the table, measured."""
    told = [inject(order, seed, library, folder) for seed in range(INJECTIONS)]

    def worst(name: str) -> int:
        return max(getattr(each, name) for each in told)

    faults = ", ".join(sorted({each.fault.name for each in told}))
    whole = "whole" if all(each.recorded for each in told) else "**not whole**"
    zero = max(each.zero - each.detected for each in told)
    return f"| {order.words} | {len(told)} | {worst('detected')} | {zero} | {worst('off')} | {faults} | {whole} |"


def table() -> Iterator[str]:
    """The table's lines."""
    yield BEGIN
    yield "|" + "---|" * (BEGIN.count("|") - 1)
    with tempfile.TemporaryDirectory() as name:
        library = compiled(Path(name), ROOT / "firmware" / "hvf_hid.c")
        for order in ORDERS:
            yield wire_row(order, library, Path(name))
    names = " or ".join(dict.fromkeys(process.test for process in PROCESSES))
    told = subprocess.run(
        [sys.executable, "-m", "pytest", "-o", "addopts=", "-v", "-k", names, *TESTS],
        cwd=ROOT, capture_output=True, text=True, check=False,
    ).stdout  # fmt: skip
    if "failed" in told.splitlines()[-1]:
        print(told, file=sys.stderr)
    for process in PROCESSES:
        lines = [line for line in told.splitlines() if f"::{process.test}" in line]
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
