"""Faults injected on the wire of a device at seeded times while the field pulls, and the fault each has to latch."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from controllers.safety.arming import ARM, CLEAR, NO_REQUEST, State
from controllers.safety.faults import Fault
from sim.devices import hid_protocol as protocol
from sim.devices.hid import HidPhantom
from sim.hardware.gated_servo import CHANNELS, Ticker, columns
from sim.recording.recorder import Group, Recorder
from sim.recording.recording import Recording
from tests.devices.firmware import Firmware, FirmwareHandle
from tests.devices.rig import FirmwareBackend, Linkage, LockStep
from tests.sim.hardware.emulation import UNRAMPED_GATE, gated_servo

REPEATS = 5  # injections of every kind, each at its own time and place
TICKS_AFTER = 50  # ticks after a fault in which no force may come back
SEED_OF_FAULTS = 18  # second word of the seed: numbers independent of those of other tests


class Wire:
    """A gated servo on the HID driver, the reference firmware behind it, and the linkage behind that, in lock-step."""

    def __init__(self, library: Path):
        self.firmware = Firmware(library)
        self.handle = FirmwareHandle(self.firmware)
        driver = LockStep(HidPhantom(self.handle, "in memory"), FirmwareBackend(self.firmware, self.handle, Linkage()))
        self.driver, self.backend = driver.driver, driver.backend
        self.parts = gated_servo(driver, dead_man=False, **UNRAMPED_GATE)
        self.ticker, self.number, self.rows = Ticker(self.parts), 0, list[np.ndarray]()

    def tick(self, request: int = NO_REQUEST) -> tuple[bool, bool]:
        """Run one period; return whether no torque was commanded in it, and whether the motors give none at its end."""
        self.ticker.tick(self.number, request)
        self.number += 1
        self.rows.append(self.ticker.row.copy())
        commanded = self.ticker.gated.torque.any() or self.ticker.gated.force.any()
        return not commanded, not self.firmware.joint_torque.any()

    def run_active(self, ticks: int) -> None:
        """Arm, and run for some ticks with force."""
        self.tick(ARM)
        for _ in range(ticks):
            self.tick()
        assert self.ticker.state is State.ACTIVE
        assert np.abs(self.firmware.joint_torque).max() > 1e-3

    def recording_complete(self, path: Path) -> bool:
        """Whether a recording of all rows opens, and has every tick and the fault."""
        rows = columns(np.array(self.rows))
        with Recorder(path, {}, 1, {"ticks": Group(1e3, CHANNELS)}, {}) as recorder:
            recorder.append("ticks", rows)
        with Recording(path) as recording:
            stored = {name: recording.channel("ticks", name)[:] for name in ("tick", "fault", "torque")}
        return all(np.array_equal(stored[name], rows[name]) for name in stored)


class InjectionResult(NamedTuple):
    """Result of one injection.

    Attributes
    ----------
    detectable_after, detected_after, command_zero_after, motors_off_after : int
        Ticks from the injection until it could be detected at the earliest, until it was detected, until no torque was
        commanded any more, and until the motors gave none.
    fault : Fault
        The fault that stayed latched to the end.
    recording_complete, recovered : bool
        Whether the recording is complete; whether a device that works again pushes once it is cleared and armed, and
        one that does not stays off.
    """

    detectable_after: int
    detected_after: int
    command_zero_after: int
    motors_off_after: int
    fault: Fault
    recording_complete: bool
    recovered: bool


def inject(injection: "Injection", seed: int, library: Path, folder: Path) -> InjectionResult:
    """Inject one fault and observe its consequences."""
    rng, wire = np.random.default_rng([seed, SEED_OF_FAULTS]), Wire(library)
    wire.run_active(int(rng.integers(60, 250)))
    begin, detectable_after = wire.number, injection.start(wire, rng)
    off = np.array([wire.tick() for _ in range(detectable_after + TICKS_AFTER)])
    faults = columns(np.array(wire.rows[begin:]))["fault"].ravel()
    assert faults.any(), f"{injection.description}, {seed}: no fault"
    assert off[-1].all(), "force to the end"
    assert wire.ticker.fault is not None
    zero, motors = (int(len(column) - np.argmin(column[::-1])) if not column.all() else 0 for column in off.T)
    fault, whole = wire.ticker.fault.fault, wire.recording_complete(folder / f"{injection.start.__name__}-{seed}.h5")
    recovered = injection.recover is None or injection.recover(wire)
    return InjectionResult(detectable_after, int(np.argmax(faults > 0)), zero, motors, fault, whole, recovered)


def recovers_after_clearing(wire: Wire) -> bool:
    """Whether a device that works again pushes once it is cleared and armed, and not before."""
    wire.handle.tamper = lambda report: [report]
    wire.handle.plugged = True
    wire.firmware.sensors.amplifier_fault = wire.firmware.sensors.encoder_fault = 0
    wire.firmware.sensors.temperature[:] = [3000, 3100, protocol.NO_TEMPERATURE]
    before = [wire.tick(ARM if k == 20 else NO_REQUEST)[0] for k in range(40)]
    wire.tick(CLEAR)
    wire.tick(ARM)
    off = [wire.tick()[1] for _ in range(200)]
    return all(before) and not off[-1] and wire.ticker.state is State.ACTIVE


def stays_faulted(wire: Wire) -> bool:
    """Whether clearing does not help a device that lost what it was armed by."""
    off = [wire.tick(CLEAR if k == 20 else ARM if k == 30 else NO_REQUEST) for k in range(60)]
    return bool(np.all(off)) and wire.ticker.state is not State.ACTIVE


class Injection(NamedTuple):
    """One kind of injected fault.

    Attributes
    ----------
    start : callable
        Injects it and returns after how many ticks it can be detected.
    description : str
        In the words of the documented table.
    fault : Fault
        What has to be latched.
    recover : callable, optional
        Ends the fault and returns whether the device then behaves as it should; None: it cannot be ended.
    """

    start: Callable[[Wire, np.random.Generator], int]
    description: str
    fault: Fault
    recover: Callable[[Wire], bool] | None = recovers_after_clearing


def with_wrong_bits(rng: np.random.Generator, report: bytes) -> bytes:
    bits = np.unpackbits(np.frombuffer(report, np.uint8))
    bits[8 + rng.choice(504, rng.integers(1, 5), replace=False)] ^= 1
    return np.packbits(bits).tobytes()


def resealed(raw: bytes, **changed: object) -> bytes:
    record = np.frombuffer(raw, protocol.INPUT_REPORT).copy().reshape(())
    for name, value in changed.items():
        record[name] = value
    return protocol.encode_report(record)


def field(report: bytes, name: str) -> int:
    return int(np.frombuffer(report, protocol.INPUT_REPORT)[0][name])


# Each injects its fault, and returns after how many ticks it can be detected.
def unplug(wire: Wire, rng: np.random.Generator) -> int:
    wire.handle.plugged = False
    return 0


def _stall(wire: Wire, milliseconds: int) -> int:
    remaining = [milliseconds]

    def tamper(report: bytes) -> list[bytes]:
        remaining[0] -= 1
        return [] if remaining[0] >= 0 else [report]

    wire.handle.tamper = tamper
    return 4  # five periods of silence


def stall_5_ms(wire: Wire, rng: np.random.Generator) -> int:
    return _stall(wire, 5)


def stall_50_ms(wire: Wire, rng: np.random.Generator) -> int:
    return _stall(wire, 50)


def stall_500_ms(wire: Wire, rng: np.random.Generator) -> int:
    return _stall(wire, 500)


def repeated_report(wire: Wire, rng: np.random.Generator) -> int:
    received: list[bytes] = []

    def again(report: bytes) -> list[bytes]:
        received.append(report)
        return received[:1]

    wire.handle.tamper = again
    return 5  # the first of them is new


def sequence_back(wire: Wire, rng: np.random.Generator) -> int:
    offset = int(rng.integers(1, 50))
    wire.handle.tamper = lambda report: [resealed(report, sequence=field(report, "sequence") - 1 - offset)]
    return 0


def swapped_reports(wire: Wire, rng: np.random.Generator) -> int:
    received: list[bytes] = []

    def swap(report: bytes) -> list[bytes]:
        received.append(report)
        return [] if len(received) == 1 else received[-1:-3:-1]

    wire.handle.tamper = swap
    return 1


def wrong_bits(wire: Wire, rng: np.random.Generator) -> int:
    wire.handle.tamper = lambda report: [with_wrong_bits(rng, report)]
    return 2  # three in a row


def short_report(wire: Wire, rng: np.random.Generator) -> int:
    size = int(rng.integers(1, 64))
    wire.handle.tamper = lambda report: [report[:size]]
    return 0


def long_report(wire: Wire, rng: np.random.Generator) -> int:
    wire.handle.tamper = lambda report: [report + rng.bytes(int(rng.integers(1, 64)))]
    return 0


def wrong_report_number(wire: Wire, rng: np.random.Generator) -> int:
    number = int(rng.integers(2, 256))
    wire.handle.tamper = lambda report: [resealed(report, report=number)]
    return 0


def commands_lost(wire: Wire, rng: np.random.Generator) -> int:
    """Commands are sent and do not arrive: only the other direction of the cable works."""
    wire.handle.write = lambda buff: len(buff)
    return 10  # the watchdog


def motor_overheated(wire: Wire, rng: np.random.Generator) -> int:
    wire.firmware.sensors.temperature[int(rng.integers(0, 3))] = int(rng.integers(10_000, 15_000))
    return 0


def reset_zero_kept(wire: Wire, rng: np.random.Generator) -> int:
    wire.firmware.power_up()
    return 0


def reset_zero_lost(wire: Wire, rng: np.random.Generator) -> int:
    wire.firmware.power_up(calibrated=False)
    return 0


def wrong_version(wire: Wire, rng: np.random.Generator) -> int:
    """Firmware of another major version, from the next power-up on."""
    major, genuine = int(rng.integers(2, 250)), wire.handle.get_feature_report

    def feature(report_num: int, max_length: int) -> list[int]:
        record = np.frombuffer(bytes(genuine(report_num, max_length)), protocol.LAYOUTS[report_num]).copy().reshape(())
        if report_num == protocol.IDENTITY:
            record["major"] = major
        return list(protocol.encode_report(record))

    wire.handle.get_feature_report = feature
    wire.firmware.power_up()
    return 0


def amplifier_fault(wire: Wire, rng: np.random.Generator) -> int:
    wire.firmware.sensors.amplifier_fault = 1
    return 0


def encoder_fault(wire: Wire, rng: np.random.Generator) -> int:
    wire.firmware.sensors.encoder_fault = 1
    return 0


def encoder_jump(wire: Wire, rng: np.random.Generator) -> int:
    joint, counts = int(rng.integers(0, 3)), int(rng.integers(2000, 10_000)) * int(rng.choice([-1, 1]))

    def jumped(report: bytes) -> list[bytes]:
        encoder = np.frombuffer(report, protocol.INPUT_REPORT)[0]["encoder"].copy()
        encoder[joint] += counts
        return [resealed(report, encoder=encoder)]

    wire.handle.tamper = jumped
    return 0


def clock_back(wire: Wire, rng: np.random.Generator) -> int:
    """As of a device timer that wraps unexpectedly."""
    offset = int(rng.integers(1, 60)) * 1_000_000
    wire.handle.tamper = lambda report: [resealed(report, time_us=(field(report, "time_us") - offset) % 2**64)]
    return 0


def motors_off(wire: Wire, rng: np.random.Generator) -> int:
    """The motors go off, and the device reports no reason."""
    wire.handle.tamper = lambda report: [resealed(report, status=field(report, "status") & ~protocol.STATUS_ENABLED)]
    return 0


def calibration_not_finite(wire: Wire, rng: np.random.Generator) -> int:
    """Integers hold no NaN; a calibration that was corrupted in memory would produce one."""
    wire.driver._hid.angle[int(rng.integers(0, 6))] = np.nan
    return 0


def field_not_finite(wire: Wire, rng: np.random.Generator) -> int:
    wire.parts.servo.field.params[:] = rng.choice([np.nan, np.inf, -np.inf])
    return 0


INJECTIONS = (
    Injection(unplug, "unplug (`read` raises, `write` returns −1)", Fault.UNPLUGGED),
    Injection(stall_5_ms, "stall of 5 ms: no reports", Fault.READING_STALE),
    Injection(stall_50_ms, "stall of 50 ms", Fault.READING_STALE),
    Injection(stall_500_ms, "stall of 500 ms", Fault.READING_STALE),
    Injection(repeated_report, "stale sequence: one report again and again", Fault.READING_STALE),
    Injection(sequence_back, "reordered: sequence 2–50 behind", Fault.SEQUENCE_BACK),
    Injection(swapped_reports, "reordered: two reports swapped", Fault.SEQUENCE_BACK),
    Injection(wrong_bits, "CRC error: 1–4 wrong bits in every report", Fault.CHECKSUM_WRONG),
    Injection(short_report, "short report, 1–63 bytes", Fault.REPORT_MALFORMED),
    Injection(long_report, "long report, 65–127 bytes", Fault.REPORT_MALFORMED),
    Injection(wrong_report_number, "another report number", Fault.REPORT_MALFORMED),
    Injection(calibration_not_finite, "NaN: in the calibration", Fault.READING_NOT_FINITE, None),
    Injection(field_not_finite, "NaN or ∞: in the field", Fault.FORCE_NOT_FINITE, None),
    Injection(wrong_version, "wrong version, after a reset", Fault.VERSION_WRONG, stays_faulted),
    Injection(motor_overheated, "over-temperature: a motor at 100–150 °C", Fault.OVER_TEMPERATURE),
    Injection(reset_zero_kept, "device reset, zero kept", Fault.DEVICE_RESET),
    Injection(reset_zero_lost, "device reset, zero lost", Fault.DEVICE_RESET, stays_faulted),
    Injection(amplifier_fault, "amplifier fault", Fault.DEVICE_REPORTED),
    Injection(encoder_fault, "encoder fault", Fault.DEVICE_REPORTED),
    Injection(encoder_jump, "encoder jumps by 2000–10 000 counts", Fault.RATE_IMPOSSIBLE),
    Injection(clock_back, "device's clock back by 1–60 s", Fault.CLOCK_BACK),
    Injection(motors_off, "motors off, without a reason", Fault.MOTORS_OFF),
    Injection(commands_lost, "commands do not arrive", Fault.DEVICE_REPORTED, None),
)
