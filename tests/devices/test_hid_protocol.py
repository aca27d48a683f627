"""The reports have the same layout in Python and in C; and guarantees of the firmware alone."""

import subprocess
import zlib
from pathlib import Path

import numpy as np
import pytest

from models.phantom.parameters import PREMIUM_1_5
from sim.devices import hid_protocol as protocol
from sim.devices.driver import make_telemetry
from sim.devices.exchange import READING_CLOCK, READING_SWITCH, READING_THETA
from sim.devices.hid_reports import (
    IO_ENABLE,
    IO_FAULT,
    IO_NEW,
    IO_SIZE,
    N_BOOT,
    N_LAST,
    N_SENT,
    N_WATCHDOG,
    HidMemory,
    judge_report,
    make_command,
)
from sim.errors import SimError
from tests.devices.firmware import ROOT, Firmware, compile_c, output_report
from tests.devices.rig import Linkage

STRUCTS = {
    "hvf_input": protocol.INPUT_REPORT, "hvf_output": protocol.OUTPUT_REPORT,
    "hvf_identity": protocol.IDENTITY_REPORT, "hvf_calibration": protocol.CALIBRATION_REPORT,
}  # fmt: skip


def c_output(folder: Path, lines: list[str]) -> str:
    """Output of a C program that includes the header and runs these statements."""
    source = folder / "printed.c"
    body = "\n".join(lines)
    head = f'#include <stdio.h>\n#include "{ROOT}/firmware/hvf_hid.h"\n'
    source.write_text(head + f"int main(void) {{\n{body}\nreturn 0;\n}}\n")
    return subprocess.run([compile_c(folder, source, program=True)], capture_output=True, text=True, check=True).stdout


def output(
    firmware: Firmware, sequence: int, enable: bool = True, watchdog_us: int = 5000, torque: int = 20_000, **other
):
    report = protocol.empty_report(protocol.OUTPUT)
    report["flags"], report["boot"], report["sequence"] = int(enable), firmware.boot, sequence
    report["watchdog_us"], report["torque"] = watchdog_us, torque
    for name, value in other.items():
        report[name] = value
    return protocol.encode_report(report)


def test_c_and_python_field_offsets_and_sizes_agree(tmp_path: Path) -> None:
    lines = [
        f'printf("{struct} {name} %zu %zu\\n", offsetof({struct}, {name}), sizeof((({struct} *)0)->{name}));'
        for struct, layout in STRUCTS.items()
        for name in layout.names
    ]
    io = c_output(tmp_path, lines)
    expected = [
        f"{struct} {name} {layout.fields[name][1]} {layout.fields[name][0].itemsize}"
        for struct, layout in STRUCTS.items()
        for name in layout.names
    ]
    assert io.split("\n")[:-1] == expected
    assert all(layout.itemsize == protocol.REPORT_SIZE for layout in STRUCTS.values())


def test_compiled_encoding_and_decoding_follow_the_report_layout() -> None:
    rng, hid = np.random.default_rng(9), HidMemory.fresh(make_telemetry())
    hid.angle[:], hid.turns[:], hid.peak[:] = 1.0, 1.0, 1e4
    for k in range(100):
        record = np.frombuffer(rng.bytes(64), protocol.INPUT_REPORT)[0].copy()
        record["report"], record["status"], record["sequence"] = protocol.INPUT, 0, k + 1
        record["temperature"] = rng.integers(1 - 2**15, 9000, 3)
        hid.numbers[N_BOOT], hid.numbers[N_LAST] = record["boot"], k
        hid.received[:64], hid.io[IO_SIZE] = np.frombuffer(protocol.encode_report(record), np.uint8), 64
        judge_report(hid)
        assert (hid.io[IO_FAULT], hid.io[IO_NEW]) == (0.0, 1.0)
        np.testing.assert_array_equal(hid.reading[READING_THETA:], record["encoder"])
        assert hid.reading[READING_SWITCH] == record["flags"] % 2
        assert hid.reading[READING_CLOCK] == record["time_us"].astype(np.int64) * 1e-6
        np.testing.assert_allclose(hid.telemetry[:3], record["temperature"] * protocol.TEMPERATURE_UNIT)

        torque, sent = rng.integers(-(2**31), 2**31, 3), int(rng.integers(0, 2**32))
        hid.torque[:], hid.io[IO_ENABLE] = torque * protocol.TORQUE_UNIT, 1.0
        hid.numbers[N_SENT], hid.numbers[N_WATCHDOG] = sent - 1, 5000
        make_command(hid)
        report = protocol.decode_report(hid.sent.tobytes(), protocol.OUTPUT)
        assert report["torque"].tolist() == torque.tolist()
        fields = ("flags", "boot", "sequence", "watchdog_us", "answers")
        assert [int(report[name]) for name in fields] == [1, int(record["boot"]), sent, 5000, k + 1]


def test_constants_equal_those_of_the_c_header(tmp_path: Path) -> None:
    pairs = {
        "HVF_VERSION_MAJOR": protocol.VERSION[0], "HVF_VERSION_MINOR": protocol.VERSION[1], "HVF_MAGIC": protocol.MAGIC,
        "HVF_STATUS_ENABLED": protocol.STATUS_ENABLED, "HVF_STATUS_CALIBRATED": protocol.STATUS_CALIBRATED,
        "HVF_STATUS_WATCHDOG": protocol.STATUS_WATCHDOG, "HVF_STATUS_HOT": protocol.STATUS_HOT,
        "HVF_STATUS_AMPLIFIER": protocol.STATUS_AMPLIFIER, "HVF_STATUS_ENCODER": protocol.STATUS_ENCODER,
        "HVF_STATUS_REFUSED": protocol.STATUS_REFUSED, "HVF_HAS_MOTORS": protocol.HAS_MOTORS,
        "HVF_HAS_WATCHDOG": protocol.HAS_WATCHDOG, "HVF_HAS_TEMPERATURE": protocol.HAS_TEMPERATURE,
        "HVF_HAS_GIMBAL": protocol.HAS_GIMBAL, "HVF_NO_TEMPERATURE": protocol.NO_TEMPERATURE,
        "HVF_INPUT": protocol.INPUT, "HVF_OUTPUT": protocol.OUTPUT, "HVF_IDENTITY": protocol.IDENTITY,
        "HVF_CALIBRATION": protocol.CALIBRATION, "HVF_SWITCH": protocol.SWITCH, "HVF_ENABLE": protocol.ENABLE,
        "HVF_CALIBRATED": protocol.CALIBRATED,
    }  # fmt: skip
    io = c_output(tmp_path, [f'printf("%lld\\n", (long long){name});' for name in pairs])
    assert [int(line) for line in io.split()] == list(pairs.values())


def test_c_and_python_checksums_are_ethernet_crc_32(firmware: Firmware) -> None:
    crc = firmware.c.hvf_crc32
    crc.restype = __import__("ctypes").c_uint32
    assert crc(b"123456789", 9) == 0xCBF43926 == zlib.crc32(b"123456789")  # the check value of its catalogue entry
    rng = np.random.default_rng(1)
    for n in range(0, 200, 7):
        data = rng.bytes(n)
        assert crc(data, n) == zlib.crc32(data)


def test_reports_with_four_wrong_bits_or_a_32_bit_burst_are_rejected() -> None:
    rng = np.random.default_rng(2)
    report = protocol.encode_report(protocol.empty_report(protocol.INPUT))
    for _ in range(5000):
        bits = np.unpackbits(np.frombuffer(report, np.uint8))
        bits[rng.choice(512, rng.integers(1, 5), replace=False)] ^= 1
        assert not protocol.has_valid_checksum(np.packbits(bits).tobytes())
        bits = np.unpackbits(np.frombuffer(report, np.uint8), bitorder="little")
        first = rng.integers(0, 480)
        bits[first : first + 32] ^= np.append(1, rng.integers(0, 2, 31)).astype(np.uint8)
        assert not protocol.has_valid_checksum(np.packbits(bits, bitorder="little").tobytes())


def test_malformed_feature_report_error_names_size_and_number() -> None:
    with pytest.raises(SimError, match=r"has 3 bytes and number 9; expected 64"):
        protocol.decode_report(b"\x09\x00\x00", protocol.IDENTITY)


def test_reference_main_loop_compiles_with_a_board_and_runs(tmp_path: Path) -> None:
    """The main program with an empty board runs a thousand periods, and its last report is sound."""
    board = tmp_path / "board.c"
    board.write_text(f"""#include <stdio.h>
#include "{ROOT}/firmware/phantom_board.h"
static uint64_t now; static hvf_input last;
void board_begin(hvf_identity *i, hvf_calibration *c, uint16_t *boot) {{ i->rate_hz = 1000; c->flags = 1; *boot = 7; }}
int board_period(void) {{ now += 100; return now > 1000000 ? -1 : now % 1000 == 0; }}
uint64_t board_time_us(void) {{ return now; }}
void board_sense(hvf_sensors *s) {{ s->time_us = now; s->encoder[1] = (int32_t)now; }}
void board_drive(const hvf_motors *m) {{ (void)m; }}
size_t board_receive(uint8_t *b, size_t n) {{ (void)b; (void)n; return 0; }}
void board_send(const hvf_input *r) {{ last = *r; if (now == 1000000) fwrite(&last, 1, sizeof last, stdout); }}
void board_feed_hardware_watchdog(void) {{}}
""")
    program = compile_c(
        tmp_path, ROOT / "firmware" / "phantom_main.c", ROOT / "firmware" / "hvf_hid.c", board, program=True
    )
    raw = subprocess.run([program], capture_output=True, check=True).stdout
    assert protocol.has_valid_checksum(raw)
    report = np.frombuffer(raw, protocol.INPUT_REPORT)[0]
    assert (report["sequence"], report["time_us"], report["encoder"][1], report["boot"]) == (1000, 10**6, 10**6, 7)


def test_firmware_watchdog_switches_off_until_disabled_and_enabled_again(firmware: Firmware) -> None:
    assert firmware.take(output(firmware, 1))
    firmware.tick()
    assert firmware.motors.on
    for _ in range(4):
        firmware.tick()
    assert firmware.motors.on  # 5 ms
    report = np.frombuffer(firmware.tick(), protocol.INPUT_REPORT)[0]
    assert not firmware.motors.on
    assert not any(firmware.motors.torque)
    assert report["status"] & protocol.STATUS_WATCHDOG
    firmware.take(output(firmware, 2))
    firmware.tick()
    assert not firmware.motors.on  # a late command is not enough
    firmware.take(output(firmware, 3, enable=False))
    firmware.take(output(firmware, 4))
    firmware.tick()
    assert firmware.motors.on


@pytest.mark.parametrize(
    "corrupted",
    [
        lambda f: output(f, 1)[:-1],
        lambda f: output(f, 1) + b"\0",
        lambda f: bytes([output(f, 1)[0]]) + b"\xff" + output(f, 1)[2:],
        lambda f: output(f, 1, boot=f.boot - 1),
        lambda f: output(f, 1, watchdog_us=0),
        lambda f: output(f, 1, watchdog_us=100_001),
    ],
    ids=["short", "long", "bit", "of another power-up", "no watchdog", "too slow a watchdog"],
)
def test_firmware_refuses_unsound_commands_and_counts_them(firmware, corrupted) -> None:
    assert not firmware.take(corrupted(firmware))
    report = np.frombuffer(firmware.tick(), protocol.INPUT_REPORT)[0]
    assert not firmware.motors.on
    assert report["refused"] == 1
    assert report["status"] & protocol.STATUS_REFUSED
    assert firmware.take(output(firmware, 1))


def test_firmware_accepts_each_command_number_once_and_in_order_across_wraparound(firmware: Firmware) -> None:
    assert firmware.take(output(firmware, 2**32 - 2))
    for number, taken in [(2**32 - 2, False), (2**32 - 3, False), (2**32 - 1, True), (0, True), (2**32 - 1, False)]:
        assert firmware.take(output(firmware, number)) is taken


def test_firmware_never_exceeds_peak_torque_nor_drives_a_hot_motor(firmware: Firmware) -> None:
    rng = np.random.default_rng(3)
    limit = round(PREMIUM_1_5.stall_motor_torque * 1e6)
    for k in range(1, 500):
        firmware.sensors.temperature[:] = rng.choice([2000, 9400, 9600, 10_100, protocol.NO_TEMPERATURE], 3).tolist()
        torque = rng.integers(-(2**31), 2**31, 3)
        firmware.take(output(firmware, k, enable=rng.random() < 0.8, torque=torque))
        firmware.tick()
        assert max(abs(t) for t in firmware.motors.torque) <= limit
        if max(firmware.sensors.temperature) >= 10_000:
            assert not firmware.motors.on


def test_hot_motor_has_to_cool_by_five_degrees_before_it_is_driven(firmware: Firmware) -> None:
    def driven(k: int, hundredths: int) -> bool:
        firmware.sensors.temperature[0] = hundredths
        firmware.tick()
        firmware.take(output(firmware, 2 * k, enable=False))
        firmware.take(output(firmware, 2 * k + 1))
        firmware.tick()
        return bool(firmware.motors.on)

    assert [driven(k, t) for k, t in enumerate([9900, 10_000, 9900, 9501, 9499, 9900])] == [
        True, False, False, False, True, True,
    ]  # fmt: skip


def documented_bytes(report: int) -> bytes:
    """The example of a report on the protocol's documentation page."""
    page = (ROOT / "docs" / "reference" / "hid-protocol.md").read_text(encoding="utf-8")
    (line,) = [line for line in page.splitlines() if line.startswith(f"{report:02x} ") and set(line) <= set(HEX)]
    return bytes.fromhex(line)


HEX = "0123456789abcdef "


def test_documented_bytes_equal_those_of_firmware_and_driver(firmware: Firmware) -> None:
    """Units and signs, number by number: 1, −2, 3 mN m; 1000, −2000, 3000, 0, 100, −100 counts; 30 and 31 °C."""
    command = documented_bytes(protocol.OUTPUT)
    assert command == output_report(True, 1, 7, 10_000, [1000, -2000, 3000], 42)
    assert firmware.take(command)
    np.testing.assert_allclose(firmware.joint_torque, np.array([1e-3, -2e-3, 3e-3]) * PREMIUM_1_5.capstan, rtol=1e-12)
    firmware.sensors.encoder[:] = [1000, -2000, 3000, 0, 100, -100]
    firmware.sensors.pressed = 1
    io = firmware.tick()
    assert io == documented_bytes(protocol.INPUT)
    report = np.frombuffer(io, protocol.INPUT_REPORT)[0]
    fields = ("flags", "status", "sequence", "time_us", "boot", "answered", "held_us", "refused")
    assert [int(report[name]) for name in fields] == [1, 3, 1, 1000, 1, 7, 1000, 0]
    assert report["encoder"].tolist() == [1000, -2000, 3000, 0, 100, -100]
    assert report["temperature"].tolist() == [3000, 3100, protocol.NO_TEMPERATURE]


@pytest.mark.parametrize("joint", range(3))
def test_positive_torque_makes_its_encoder_count_up(firmware, joint: int) -> None:
    def counts(torque: int) -> np.ndarray:
        firmware.power_up()
        linkage, k = Linkage(), 0
        for k in range(30):
            shafts = [torque * (i == joint) for i in range(3)]
            assert firmware.take(output_report(True, firmware.boot, k + 1, 10_000, shafts, 0))
            linkage.step(firmware.joint_torque)
            firmware.turn_to(linkage.angles())
            firmware.tick()
        return np.array(firmware.sensors.encoder[:3])

    assert (counts(20_000) - counts(-20_000))[joint] > 100
