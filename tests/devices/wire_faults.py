"""What is done to a device on the wire, at seeded times while the field pulls, and what has to come of it."""

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
from tests.devices.rig import FirmwareBehind, Linkage, LockStep
from tests.sim.hardware.emulation import AT_ONCE, gated_servo

INJECTIONS = 5  # of every kind, at times and places of their own
LATER = 50  # ticks after a fault in which nothing may come back


class Wire:
    """A gated servo on the HID driver, the reference firmware behind it, and the linkage behind that, in lock-step."""

    def __init__(self, library: Path):
        self.firmware = Firmware(library)
        self.handle = FirmwareHandle(self.firmware)
        driver = LockStep(HidPhantom(self.handle, "in memory"), FirmwareBehind(self.firmware, self.handle, Linkage()))
        self.driver, self.behind = driver.driver, driver.behind
        self.parts = gated_servo(driver, dead_man=False, **AT_ONCE)
        self.ticker, self.number, self.rows = Ticker(self.parts), 0, list[np.ndarray]()

    def tick(self, request: int = NO_REQUEST) -> tuple[bool, bool]:
        """A period passes; whether no torque was commanded in it, and no motor gives any at its end."""
        self.ticker.tick(self.number, request)
        self.number += 1
        self.rows.append(self.ticker.row.copy())
        asked = self.ticker.gated.torque.any() or self.ticker.gated.force.any()
        return not asked, not self.firmware.joint_torque.any()

    def active(self, ticks: int) -> None:
        """Arm, and run for so long."""
        self.tick(ARM)
        for _ in range(ticks):
            self.tick()
        assert self.ticker.state is State.ACTIVE
        assert np.abs(self.firmware.joint_torque).max() > 1e-3

    def recorded(self, path: Path) -> bool:
        """Whether a recording of all rows opens, and has every tick and the fault."""
        rows = columns(np.array(self.rows))
        with Recorder(path, {}, 1, {"ticks": Group(1e3, CHANNELS)}, {}) as recorder:
            recorder.append("ticks", rows)
        with Recording(path) as recording:
            told = {name: recording.channel("ticks", name)[:] for name in ("tick", "fault", "torque")}
        return all(np.array_equal(told[name], rows[name]) for name in told)


class Injected(NamedTuple):
    """What came of one injection.

    Attributes
    ----------
    evident, detected, zero, off : int
        Ticks from the injection until there was enough to tell, until it was told, until no torque was commanded any
        more, and until the motors gave none.
    fault : Fault
        That was latched, to the end.
    recorded, mended : bool
        Whether the recording is whole; whether a device that is well again is back once it is cleared and armed, and
        one that is not stays off.
    """

    evident: int
    detected: int
    zero: int
    off: int
    fault: Fault
    recorded: bool
    mended: bool


def inject(order: "Order", seed: int, library: Path, folder: Path) -> Injected:
    """Do one thing to a device, and see what comes of it."""
    rng, wire = np.random.default_rng([seed, 18]), Wire(library)
    wire.active(int(rng.integers(60, 250)))
    begin, evident = wire.number, order.do(wire, rng)
    off = np.array([wire.tick() for _ in range(evident + LATER)])
    faults = columns(np.array(wire.rows[begin:]))["fault"].ravel()
    assert faults.any(), f"{order.words}, {seed}: no fault"
    assert off[-1].all(), "force to the end"
    assert wire.ticker.fault is not None
    zero, motors = (int(len(column) - np.argmin(column[::-1])) if not column.all() else 0 for column in off.T)
    fault, whole = wire.ticker.fault.fault, wire.recorded(folder / f"{order.do.__name__}-{seed}.h5")
    mended = order.mend is None or order.mend(wire)
    return Injected(evident, int(np.argmax(faults > 0)), zero, motors, fault, whole, mended)


def goes_on(wire: Wire) -> bool:
    """Whether a device that is well again pushes once it is cleared and armed, and not before."""
    wire.handle.spoil = lambda report: [report]
    wire.handle.plugged = True
    wire.firmware.sensors.amplifier_fault = wire.firmware.sensors.encoder_fault = 0
    wire.firmware.sensors.temperature[:] = [3000, 3100, protocol.NO_TEMPERATURE]
    before = [wire.tick(ARM if k == 20 else NO_REQUEST)[0] for k in range(40)]
    wire.tick(CLEAR)
    wire.tick(ARM)
    off = [wire.tick()[1] for _ in range(200)]
    return all(before) and not off[-1] and wire.ticker.state is State.ACTIVE


def stays_a_fault(wire: Wire) -> bool:
    """Whether clearing does not help a device that lost what it was armed by."""
    off = [wire.tick(CLEAR if k == 20 else ARM if k == 30 else NO_REQUEST) for k in range(60)]
    return bool(np.all(off)) and wire.ticker.state is not State.ACTIVE


class Order(NamedTuple):
    """One kind of injection: what is done, in words, what has to be latched, and what mends it (None: nothing can)."""

    do: Callable[[Wire, np.random.Generator], int]
    words: str
    fault: Fault
    mend: Callable[[Wire], bool] | None = goes_on


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
def unplug(wire: Wire, rng: np.random.Generator) -> int:
    wire.handle.plugged = False
    return 0


def _stalled(wire: Wire, milliseconds: int) -> int:
    left = [milliseconds]

    def spoil(report: bytes) -> list[bytes]:
        left[0] -= 1
        return [] if left[0] >= 0 else [report]

    wire.handle.spoil = spoil
    return 4  # five periods of silence


def stall_5(wire: Wire, rng: np.random.Generator) -> int:
    return _stalled(wire, 5)


def stall_50(wire: Wire, rng: np.random.Generator) -> int:
    return _stalled(wire, 50)


def stall_500(wire: Wire, rng: np.random.Generator) -> int:
    return _stalled(wire, 500)


def stale(wire: Wire, rng: np.random.Generator) -> int:
    kept: list[bytes] = []

    def again(report: bytes) -> list[bytes]:
        kept.append(report)
        return kept[:1]

    wire.handle.spoil = again
    return 5  # the first of them is new


def reordered(wire: Wire, rng: np.random.Generator) -> int:
    back = int(rng.integers(1, 50))
    wire.handle.spoil = lambda report: [reseal(report, sequence=field(report, "sequence") - 1 - back)]
    return 0


def swapped(wire: Wire, rng: np.random.Generator) -> int:
    kept: list[bytes] = []

    def swap(report: bytes) -> list[bytes]:
        kept.append(report)
        return [] if len(kept) == 1 else kept[-1:-3:-1]

    wire.handle.spoil = swap
    return 1


def bits(wire: Wire, rng: np.random.Generator) -> int:
    wire.handle.spoil = lambda report: [spoiled_bits(rng, report)]
    return 2  # three in a row


def short(wire: Wire, rng: np.random.Generator) -> int:
    size = int(rng.integers(1, 64))
    wire.handle.spoil = lambda report: [report[:size]]
    return 0


def long(wire: Wire, rng: np.random.Generator) -> int:
    wire.handle.spoil = lambda report: [report + rng.bytes(int(rng.integers(1, 64)))]
    return 0


def other_number(wire: Wire, rng: np.random.Generator) -> int:
    number = int(rng.integers(2, 256))
    wire.handle.spoil = lambda report: [reseal(report, report=number)]
    return 0


def deaf(wire: Wire, rng: np.random.Generator) -> int:
    """Commands go out and do not arrive: the cable's other half."""
    wire.handle.write = lambda buff: len(buff)
    return 10  # the watchdog


def hot(wire: Wire, rng: np.random.Generator) -> int:
    wire.firmware.sensors.temperature[int(rng.integers(0, 3))] = int(rng.integers(10_000, 15_000))
    return 0


def reset(wire: Wire, rng: np.random.Generator) -> int:
    wire.firmware.power_up()
    return 0


def reset_and_forgot(wire: Wire, rng: np.random.Generator) -> int:
    wire.firmware.power_up(calibrated=False)
    return 0


def other_version(wire: Wire, rng: np.random.Generator) -> int:
    """New firmware, which the next power-up brings."""
    major, genuine = int(rng.integers(2, 250)), wire.handle.get_feature_report

    def feature(report_num: int, max_length: int) -> list[int]:
        told = np.frombuffer(bytes(genuine(report_num, max_length)), protocol.LAYOUTS[report_num]).copy().reshape(())
        if report_num == protocol.IDENTITY:
            told["major"] = major
        return list(protocol.sealed(told))

    wire.handle.get_feature_report = feature
    wire.firmware.power_up()
    return 0


def amplifier(wire: Wire, rng: np.random.Generator) -> int:
    wire.firmware.sensors.amplifier_fault = 1
    return 0


def encoder(wire: Wire, rng: np.random.Generator) -> int:
    wire.firmware.sensors.encoder_fault = 1
    return 0


def jump(wire: Wire, rng: np.random.Generator) -> int:
    joint, counts = int(rng.integers(0, 3)), int(rng.integers(2000, 10_000)) * int(rng.choice([-1, 1]))

    def jumped(report: bytes) -> list[bytes]:
        told = np.frombuffer(report, protocol.INPUT_REPORT)[0]["encoder"].copy()
        told[joint] += counts
        return [reseal(report, encoder=told)]

    wire.handle.spoil = jumped
    return 0


def clock_back(wire: Wire, rng: np.random.Generator) -> int:
    """A timer that was taken for one that does not wrap."""
    back = int(rng.integers(1, 60)) * 1_000_000
    wire.handle.spoil = lambda report: [reseal(report, time_us=(field(report, "time_us") - back) % 2**64)]
    return 0


def left_off(wire: Wire, rng: np.random.Generator) -> int:
    """The motors go off, and the device does not say why."""
    wire.handle.spoil = lambda report: [reseal(report, status=field(report, "status") & ~protocol.STATUS_ENABLED)]
    return 0


def not_finite(wire: Wire, rng: np.random.Generator) -> int:
    """Integers hold no NaN; a calibration that was spoiled in memory would make one."""
    wire.driver._hid.angle[int(rng.integers(0, 6))] = np.nan
    return 0


def field_not_finite(wire: Wire, rng: np.random.Generator) -> int:
    wire.parts.servo.field.params[:] = rng.choice([np.nan, np.inf, -np.inf])
    return 0


ORDERS = (
    Order(unplug, "unplug (`read` raises, `write` returns −1)", Fault.UNPLUGGED),
    Order(stall_5, "stall of 5 ms: no reports", Fault.READING_STALE),
    Order(stall_50, "stall of 50 ms", Fault.READING_STALE),
    Order(stall_500, "stall of 500 ms", Fault.READING_STALE),
    Order(stale, "stale sequence: one report again and again", Fault.READING_STALE),
    Order(reordered, "reordered: sequence 2–50 behind", Fault.SEQUENCE_BACK),
    Order(swapped, "reordered: two reports swapped", Fault.SEQUENCE_BACK),
    Order(bits, "CRC error: 1–4 wrong bits in every report", Fault.CHECKSUM_WRONG),
    Order(short, "short report, 1–63 bytes", Fault.REPORT_MALFORMED),
    Order(long, "long report, 65–127 bytes", Fault.REPORT_MALFORMED),
    Order(other_number, "another report number", Fault.REPORT_MALFORMED),
    Order(not_finite, "NaN: in the calibration", Fault.READING_NOT_FINITE, None),
    Order(field_not_finite, "NaN or ∞: in the field", Fault.FORCE_NOT_FINITE, None),
    Order(other_version, "wrong version, after a reset", Fault.VERSION_WRONG, stays_a_fault),
    Order(hot, "over-temperature: a motor at 100–150 °C", Fault.OVER_TEMPERATURE),
    Order(reset, "device reset, zero kept", Fault.DEVICE_RESET),
    Order(reset_and_forgot, "device reset, zero lost", Fault.DEVICE_RESET, stays_a_fault),
    Order(amplifier, "amplifier fault", Fault.DEVICE_REPORTED),
    Order(encoder, "encoder fault", Fault.DEVICE_REPORTED),
    Order(jump, "encoder jumps by 2000–10 000 counts", Fault.RATE_IMPOSSIBLE),
    Order(clock_back, "device's clock back by 1–60 s", Fault.CLOCK_BACK),
    Order(left_off, "motors off, without a reason", Fault.MOTORS_OFF),
    Order(deaf, "commands do not arrive", Fault.DEVICE_REPORTED, None),
)
