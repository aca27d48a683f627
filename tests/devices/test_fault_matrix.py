"""Faults of a device on the wire, at seeded times while the field pulls: the force goes, and the reason stays."""

from pathlib import Path

import numpy as np
import pytest

from controllers.safety.faults import Fault
from sim.devices.driver import BAD, LOST, READ
from tests.devices.fault_table import PAGE, PROCESSES, row_of
from tests.devices.wire_faults import INJECTIONS, ORDERS, Order, Wire, inject, spoiled_bits

TWO_TICKS = 2


def assert_lets_go_and_stays(order: Order, seed: int, library: Path, folder: Path) -> None:
    told = inject(order, seed, library, folder)
    assert told.fault is order.fault
    assert told.detected <= told.evident
    assert told.zero <= told.detected + TWO_TICKS
    assert told.off <= max(told.zero, 10)  # where the cable is cut the firmware's watchdog acts
    assert told.recorded
    assert told.mended


@pytest.mark.parametrize("order", ORDERS, ids=lambda order: order.do.__name__)
def test_force_is_zero_within_two_ticks_and_fault_is_latched(order, firmware_library, tmp_path) -> None:
    assert_lets_go_and_stays(order, 0, firmware_library, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("order", ORDERS, ids=lambda order: order.do.__name__)
def test_fault_is_handled_at_every_seeded_time_and_place(order, firmware_library, tmp_path) -> None:
    for seed in range(1, INJECTIONS):
        assert_lets_go_and_stays(order, seed, firmware_library, tmp_path)


def test_documented_table_lists_every_injection_and_at_least_100_runs() -> None:
    page = PAGE.read_text(encoding="utf-8")
    rows = [line for line in page.splitlines() if line.startswith("| ") and not line.startswith("| injected")]
    assert [row.split("|")[1].strip() for row in rows] == [order.words for order in (*ORDERS, *PROCESSES)]
    assert sum(int(row.split("|")[2]) for row in rows) >= 100
    assert row_of(PROCESSES[0], "") in page


@pytest.mark.parametrize("seed", range(INJECTIONS))
def test_occasional_bus_errors_are_counted_without_loss_of_force(firmware_library, tmp_path, seed: int) -> None:
    """Losses, duplicates, reports that bunch up, and one spoiled report at a time."""
    rng, wire = np.random.default_rng([seed, 19]), Wire(firmware_library)
    wire.active(20)
    kept: list[bytes] = []
    last = ["sound"]

    def disturb(report: bytes) -> list[bytes]:
        kind = "sound" if last[-1] != "sound" else rng.choice(["sound", "lost", "twice", "late", "bits"])
        last.append(kind)
        if kind == "lost":
            return []
        if kind == "late":
            kept.append(report)
            return []
        out = [*kept, report, *([report] if kind == "twice" else [])]
        kept.clear()
        return [spoiled_bits(rng, report)] if kind == "bits" else out

    wire.handle.spoil = disturb
    for _ in range(400):
        wire.tick()
    assert wire.ticker.fault is None
    assert wire.firmware.joint_torque.any()
    told = wire.driver.telemetry
    assert told[BAD] == last.count("twice") + last.count("bits")
    assert told[LOST] >= last.count("lost")
    assert told[READ] > 250
    assert wire.recorded(tmp_path / "run.h5")


@pytest.mark.parametrize("milliseconds", [5, 50, 500])
def test_late_host_trips_the_watchdog_and_force_ramps_in_again(
    firmware_library, tmp_path, milliseconds: int
) -> None:
    wire = Wire(firmware_library)
    wire.active(300)
    for _ in range(milliseconds):
        wire.behind.move()
        wire.behind.tell()
    assert wire.firmware.motors.on == (milliseconds < 10)
    if milliseconds > 64:  # what Linux keeps
        wire.handle.queue = type(wire.handle.queue)(list(wire.handle.queue)[:64])
    forces = []
    for _ in range(400):
        wire.tick()
        forces.append(float(np.linalg.norm(wire.ticker.gated.force)))
    assert wire.ticker.fault is None
    assert wire.firmware.motors.on
    assert max(forces[:5]) < 0.3 * max(forces)
    assert np.abs(np.diff(forces)).max() < 0.2
    assert wire.recorded(tmp_path / "run.h5")


def test_later_fault_does_not_replace_the_first(firmware_library) -> None:
    wire = Wire(firmware_library)
    wire.active(50)
    wire.firmware.sensors.amplifier_fault = 1
    wire.tick()
    wire.handle.plugged = False
    for _ in range(5):
        wire.tick()
    assert wire.ticker.fault is not None
    assert wire.ticker.fault.fault is Fault.DEVICE_REPORTED
