"""Faults of a device on the wire, at seeded times while the field pulls: the force goes, and the reason stays."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest

from controllers.safety.faults import FAULT_VALUE, Fault
from sim.devices import hid_protocol as protocol
from sim.devices.exchange import exchange
from sim.devices.hid import HidPhantom
from sim.loop.loop import Loop
from tests.devices.firmware import Firmware, FirmwareHandle
from tests.devices.rig import FirmwareBehind, Linkage, Rig
from tests.sim.bare_servos import CUTOFF, bare_servo, device_world

INJECTIONS = 5  # of every kind, at times and places of their own
TWO_TICKS = 2


class Fixture(NamedTuple):
    rig: Rig
    loop: Loop
    handle: FirmwareHandle
    firmware: Firmware

    def torque(self) -> np.ndarray:
        return self.firmware.joint_torque


@pytest.fixture(scope="module")
def runs(firmware_library) -> Callable[[], Fixture]:
    def made() -> Fixture:
        firmware = Firmware(firmware_library)
        handle = FirmwareHandle(firmware)
        world = device_world()
        device = exchange(world, CUTOFF)
        rig = Rig(device, HidPhantom(handle, "in memory"), FirmwareBehind(firmware, handle, Linkage()))
        return Fixture(rig, Loop(bare_servo(world, device), world, before_tick=rig), handle, firmware)

    return made


def spoiled_bits(rng: np.random.Generator, report: bytes) -> bytes:
    bits = np.unpackbits(np.frombuffer(report, np.uint8))
    bits[8 + rng.choice(504, rng.integers(1, 5), replace=False)] ^= 1
    return np.packbits(bits).tobytes()


def reseal(raw: bytes, **changed: object) -> bytes:
    record = np.frombuffer(raw, protocol.INPUT_REPORT).copy().reshape(())
    for name, value in changed.items():
        record[name] = value
    return protocol.sealed(record)


def field(report: bytes, name: str) -> int:
    return int(np.frombuffer(report, protocol.INPUT_REPORT)[0][name])


# Each orders its fault, and says how many ticks it takes to be evident.
def unplug(run: Fixture, rng: np.random.Generator) -> int:
    run.handle.plugged = False
    return 0


def stall(run: Fixture, rng: np.random.Generator) -> int:
    run.handle.spoil = lambda report: []
    return 6  # the silence, 5 periods, has to be exceeded


def stale(run: Fixture, rng: np.random.Generator) -> int:
    kept: list[bytes] = []

    def again(report: bytes) -> list[bytes]:
        kept.append(report)
        return kept[:1]

    run.handle.spoil = again
    return 7  # the first of them is new


def reordered(run: Fixture, rng: np.random.Generator) -> int:
    back = int(rng.integers(1, 50))
    run.handle.spoil = lambda report: [reseal(report, sequence=field(report, "sequence") - 1 - back)]
    return 0


def swapped(run: Fixture, rng: np.random.Generator) -> int:
    kept: list[bytes] = []

    def swap(report: bytes) -> list[bytes]:
        kept.append(report)
        return [] if len(kept) == 1 else kept[-1:-3:-1]

    run.handle.spoil = swap
    return 1


def bits(run: Fixture, rng: np.random.Generator) -> int:
    run.handle.spoil = lambda report: [spoiled_bits(rng, report)]
    return 2  # three in a row


def short(run: Fixture, rng: np.random.Generator) -> int:
    size = int(rng.integers(1, 64))
    run.handle.spoil = lambda report: [report[:size]]
    return 0


def long(run: Fixture, rng: np.random.Generator) -> int:
    run.handle.spoil = lambda report: [report + rng.bytes(int(rng.integers(1, 64)))]
    return 0


def other_number(run: Fixture, rng: np.random.Generator) -> int:
    number = int(rng.integers(2, 256))
    run.handle.spoil = lambda report: [reseal(report, report=number)]
    return 0


def deaf(run: Fixture, rng: np.random.Generator) -> int:
    """Commands go out and do not arrive: the cable's other half."""
    run.handle.write = lambda buff: len(buff)
    return 13  # the watchdog, and the report that tells


def hot(run: Fixture, rng: np.random.Generator) -> int:
    run.firmware.sensors.temperature[int(rng.integers(0, 3))] = int(rng.integers(10_000, 15_000))
    return 0


def reset(run: Fixture, rng: np.random.Generator) -> int:
    run.firmware.power_up()
    return 0


def amplifier(run: Fixture, rng: np.random.Generator) -> int:
    run.firmware.sensors.amplifier_fault = 1
    return 0


def encoder(run: Fixture, rng: np.random.Generator) -> int:
    run.firmware.sensors.encoder_fault = 1
    return 0


def jump(run: Fixture, rng: np.random.Generator) -> int:
    joint, counts = int(rng.integers(0, 3)), int(rng.integers(2000, 10_000)) * int(rng.choice([-1, 1]))

    def jumped(report: bytes) -> list[bytes]:
        told = np.frombuffer(report, protocol.INPUT_REPORT)[0]["encoder"].copy()
        told[joint] += counts
        return [reseal(report, encoder=told)]

    run.handle.spoil = jumped
    return 0


def not_finite(run: Fixture, rng: np.random.Generator) -> int:
    """Integers hold no NaN; a calibration that was spoiled in memory would make one."""
    run.rig.driver._angle[int(rng.integers(0, 6))] = np.nan
    return 0


FAULTS = {
    unplug: Fault.UNPLUGGED, stall: Fault.READING_STALE, stale: Fault.READING_STALE, reordered: Fault.SEQUENCE_BACK,
    swapped: Fault.SEQUENCE_BACK, bits: Fault.CHECKSUM_WRONG, short: Fault.REPORT_MALFORMED,
    long: Fault.REPORT_MALFORMED, other_number: Fault.REPORT_MALFORMED, hot: Fault.OVER_TEMPERATURE,
    deaf: Fault.DEVICE_REPORTED, reset: Fault.DEVICE_RESET, amplifier: Fault.DEVICE_REPORTED,
    encoder: Fault.DEVICE_REPORTED, jump: Fault.RATE_IMPOSSIBLE, not_finite: Fault.READING_NOT_FINITE,
}  # fmt: skip


@pytest.mark.parametrize("order", FAULTS, ids=lambda order: order.__name__)
def test_the_force_is_zero_within_two_ticks_and_the_reason_is_latched(runs, order) -> None:
    assert INJECTIONS * len(FAULTS) >= 60
    for seed in range(INJECTIONS):
        rng, run = np.random.default_rng([seed, 18]), runs()
        for _ in range(int(rng.integers(150, 400))):
            run.loop.step()
        assert np.abs(run.torque()).max() > 1e-3
        assert run.rig.fault == Fault.NONE
        evident = order(run, rng)
        codes = []
        for _ in range(evident + 1 + TWO_TICKS):
            ticks, _ = run.loop.step()
            codes.append((run.rig.fault, float(np.abs(ticks.force).max())))
        detected = next(k for k, (code, _) in enumerate(codes) if code)
        assert detected <= evident, codes
        assert all(force == 0.0 for _, force in codes[detected:])
        # The motor itself: by command where the cable holds, by the firmware's watchdog where it does not.
        if order is not unplug:
            assert not run.torque().any()
        for _ in range(50):
            ticks, _ = run.loop.step()
            assert not ticks.force.any()
        assert run.rig.fault == FAULTS[order]
        assert not run.torque().any() or order is unplug
        assert np.isfinite(run.rig.device.faults[FAULT_VALUE]) or order is not_finite


def test_an_unplugged_device_lets_go_by_its_own_watchdog(runs) -> None:
    run = runs()
    for _ in range(300):
        run.loop.step()
    run.handle.plugged = False
    assert run.torque().any()
    for _ in range(12):
        run.loop.step()
    assert not run.torque().any()


@pytest.mark.parametrize("seed", range(INJECTIONS))
def test_what_a_bus_does_now_and_then_is_counted_and_takes_no_force(runs, seed: int) -> None:
    """Losses, duplicates, reports that bunch up, and one spoiled report at a time."""
    rng, run = np.random.default_rng([seed, 19]), runs()
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

    run.handle.spoil = disturb
    for _ in range(400):
        run.loop.step()
    assert run.rig.fault == Fault.NONE
    assert run.torque().any()
    lost, read, bad = run.rig.driver.telemetry[4:7]
    assert bad == last.count("twice") + last.count("bits")
    assert lost >= last.count("lost")
    assert read > 250


@pytest.mark.parametrize("milliseconds", [5, 50, 500])
def test_a_host_that_was_away_lets_go_of_the_device_and_ramps_in_again(runs, milliseconds: int) -> None:
    run = runs()
    for _ in range(300):
        run.loop.step()
    for _ in range(milliseconds):
        run.rig.behind.move()
        run.rig.behind.tell()
    assert run.firmware.motors.on == (milliseconds < 10)
    if milliseconds > 64:  # what Linux keeps
        run.handle.queue = type(run.handle.queue)(list(run.handle.queue)[:64])
    forces = []
    for _ in range(400):
        ticks, _ = run.loop.step()
        forces.append(float(np.linalg.norm(ticks.force)))
    assert run.rig.fault == Fault.NONE
    assert run.firmware.motors.on
    assert max(forces[:5]) < 0.3 * max(forces)
    assert np.abs(np.diff(forces)).max() < 0.2
