"""Faults injected on the wire at seeded times while the field pulls: force ends, and the fault stays latched."""

from pathlib import Path

import numpy as np
import pytest

from controllers.safety.faults import Fault
from sim.devices.driver import LOST, READ, REFUSED
from tests.devices.fault_table import PAGE, PROCESS_FAULTS, row_of
from tests.devices.wire_faults import INJECTIONS, REPEATS, Injection, Wire, inject, with_wrong_bits

TWO_TICKS = 2
SEED_OF_BUS_ERRORS = 19  # second word of the seed: numbers independent of those of other tests


def assert_releases_and_latches(injection: Injection, seed: int, library: Path, folder: Path) -> None:
    result = inject(injection, seed, library, folder)
    assert result.fault is injection.fault
    assert result.detected_after <= result.detectable_after
    assert result.command_zero_after <= result.detected_after + TWO_TICKS
    assert result.motors_off_after <= max(
        result.command_zero_after, 10
    )  # without commands the firmware's watchdog acts
    assert result.recording_complete
    assert result.recovered


@pytest.mark.parametrize("injection", INJECTIONS, ids=lambda injection: injection.start.__name__)
def test_force_is_zero_within_two_ticks_and_fault_is_latched(injection, firmware_library, tmp_path) -> None:
    assert_releases_and_latches(injection, 0, firmware_library, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("injection", INJECTIONS, ids=lambda injection: injection.start.__name__)
def test_fault_is_handled_at_every_seeded_time_and_place(injection, firmware_library, tmp_path) -> None:
    for seed in range(1, REPEATS):
        assert_releases_and_latches(injection, seed, firmware_library, tmp_path)


def test_documented_table_lists_every_injection_and_at_least_100_runs() -> None:
    page = PAGE.read_text(encoding="utf-8")
    rows = [line for line in page.splitlines() if line.startswith("| ") and not line.startswith("| injected")]
    assert [row.split("|")[1].strip() for row in rows] == [
        fault.description for fault in (*INJECTIONS, *PROCESS_FAULTS)
    ]
    assert sum(int(row.split("|")[2]) for row in rows) >= 100
    assert row_of(PROCESS_FAULTS[0], "") in page


@pytest.mark.parametrize("seed", range(REPEATS))
def test_occasional_bus_errors_are_counted_without_loss_of_force(firmware_library, tmp_path, seed: int) -> None:
    """Losses, duplicates, reports that bunch up, and one spoiled report at a time."""
    rng, wire = np.random.default_rng([seed, SEED_OF_BUS_ERRORS]), Wire(firmware_library)
    wire.run_active(20)
    delayed: list[bytes] = []
    kinds = ["sound"]

    def disturb(report: bytes) -> list[bytes]:
        kind = "sound" if kinds[-1] != "sound" else rng.choice(["sound", "lost", "twice", "late", "bits"])
        kinds.append(kind)
        if kind == "lost":
            return []
        if kind == "late":
            delayed.append(report)
            return []
        out = [*delayed, report, *([report] if kind == "twice" else [])]
        delayed.clear()
        return [with_wrong_bits(rng, report)] if kind == "bits" else out

    wire.handle.tamper = disturb
    for _ in range(400):
        wire.tick()
    assert wire.ticker.fault is None
    assert wire.firmware.joint_torque.any()
    telemetry = wire.driver.telemetry
    assert telemetry[REFUSED] == kinds.count("twice") + kinds.count("bits")
    assert telemetry[LOST] >= kinds.count("lost")
    assert telemetry[READ] > 250
    assert wire.recording_complete(tmp_path / "run.h5")


@pytest.mark.parametrize("milliseconds", [5, 50, 500])
def test_late_host_trips_the_watchdog_and_force_ramps_in_again(firmware_library, tmp_path, milliseconds: int) -> None:
    wire = Wire(firmware_library)
    wire.run_active(300)
    for _ in range(milliseconds):
        wire.backend.advance()
        wire.backend.publish_reading()
    assert wire.firmware.motors.on == (milliseconds < 10)
    if milliseconds > 64:  # the length of the queue in Linux
        wire.handle.queue = type(wire.handle.queue)(list(wire.handle.queue)[:64])
    forces = []
    for _ in range(400):
        wire.tick()
        forces.append(float(np.linalg.norm(wire.ticker.gated.force)))
    assert wire.ticker.fault is None
    assert wire.firmware.motors.on
    assert max(forces[:5]) < 0.3 * max(forces)
    assert np.abs(np.diff(forces)).max() < 0.2
    assert wire.recording_complete(tmp_path / "run.h5")


def test_later_fault_does_not_replace_the_first(firmware_library) -> None:
    wire = Wire(firmware_library)
    wire.run_active(50)
    wire.firmware.sensors.amplifier_fault = 1
    wire.tick()
    wire.handle.plugged = False
    for _ in range(5):
        wire.tick()
    assert wire.ticker.fault is not None
    assert wire.ticker.fault.fault is Fault.DEVICE_REPORTED
