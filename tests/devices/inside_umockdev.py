"""Tests of an unmodified hidapi on a /dev/hidraw0: run by `test_hidraw_nodes.py`, which preloads umockdev."""

import contextlib
import json
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from controllers.safety.faults import Fault
from experiments.cli import main
from experiments.files.device_files import calibration_from, read_device_file
from experiments.hardware.arming_checks import check_device
from sim.devices.driver import READ, ROUND_TRIP, DriverFault
from sim.devices.hardware_list import hid_backend, list_devices, open_device
from sim.errors import SimError
from tests.devices.follow import LAP, device_follow, gated_follow, rms, simulated_follow
from tests.devices.hidraw_node import SPACEMOUSE_DESCRIPTOR, HidrawNode, NodeFirmware, NodeRig
from tests.devices.rig import HeldLinkage, LockStep

MOUSE = bytes.fromhex("05010902a1010901a10005091901290315002501950375018102c0c0")


@pytest.fixture
def phantom(tmp_path):
    node_firmware = NodeFirmware(tmp_path)
    yield node_firmware
    node_firmware.node.close()


def test_hidapi_from_the_wheel_lists_the_node(phantom) -> None:
    (row,) = hid_backend().enumerate()
    assert (row["vendor_id"], row["usage_page"], row["usage"]) == (0x16C0, 0xFF48, 0x56)
    (device,) = list_devices()
    assert (device.name, device.bus, device.kind, device.usable) == ("hid:HVF-0001", "usb", "phantom", True)


@pytest.mark.parametrize("name", ["hid", "hid:HVF-0001", "hidraw:/dev/hidraw0"])
def test_phantom_opens_by_each_of_its_names(phantom, name) -> None:
    driver = open_device(name)
    phantom.publish_reading()
    reading = np.zeros(9)
    assert driver.read(reading, 0.5)
    assert driver.identity.serial == "HVF-0001"
    driver.close()


def test_read_waits_until_its_timeout_or_a_report(phantom) -> None:
    driver, reading = open_device("hid"), np.zeros(9)
    begin = time.perf_counter()
    assert not driver.read(reading, 0.05)
    assert time.perf_counter() - begin > 0.045
    phantom.publish_reading()
    begin = time.perf_counter()
    assert driver.read(reading, 60.0)
    assert time.perf_counter() - begin < 30.0
    driver.close()


def test_unplugging_faults_reads_and_writes_but_not_release(phantom) -> None:
    driver = open_device("hid")
    driver.write(np.zeros(3), True)
    phantom.node.unplug()
    for action in (lambda: driver.read(np.zeros(9), 0.0), lambda: driver.read(np.zeros(9), 0.05),
               lambda: driver.write(np.zeros(3), True)):  # fmt: skip
        with pytest.raises(DriverFault) as refused:
            action()
        assert refused.value.fault is Fault.UNPLUGGED
    driver.let_go()
    driver.close()


def test_malformed_reports_arrive_unaltered(phantom) -> None:
    driver, reading = open_device("hid"), np.zeros(9)
    valid_report = phantom.firmware.tick()
    for size in (1, 63, 65):
        phantom.node.post((valid_report + b"\0")[:size])
        with pytest.raises(DriverFault, match=f"a report of {size} bytes"):
            driver.read(reading, 0.0)
    for _ in range(2):
        phantom.node.post(valid_report[:40] + b"\xff" + valid_report[41:])
        assert not driver.read(reading, 0.0)
    phantom.node.post(valid_report[:40] + b"\xff" + valid_report[41:])
    with pytest.raises(DriverFault, match="3 reports in a row had a wrong checksum"):
        driver.read(reading, 0.0)
    driver.close()


def test_follow_through_hidapi_and_firmware_matches_simulation_within_1_mm(tmp_path) -> None:
    backend = NodeFirmware(tmp_path)
    places, rig = device_follow(lambda device: NodeRig(device, open_device("hid"), backend, backend.node))
    assert rig.fault == Fault.NONE
    assert rig.driver.telemetry[READ] == LAP * 1e3
    assert np.isfinite(rig.driver.telemetry[ROUND_TRIP])
    rig.driver.close()
    assert rms(places, simulated_follow()) < 1e-3


def test_follow_through_hidapi_firmware_and_gate_matches_simulation_within_1_mm(phantom) -> None:
    driver = LockStep(open_device("hid"), phantom)
    places = gated_follow(driver)["p"]
    assert driver.telemetry[READ] == LAP * 1e3
    driver.close()
    print("apart:", rms(places, simulated_follow()))
    assert rms(places, simulated_follow()) < 1e-3


def test_touch_is_listed_but_refused_and_nothing_is_sent_to_it(capsys) -> None:
    node = HidrawNode(MOUSE, 0x2988, 0x0304, "Touch", "T-1")
    (device,) = list_devices()
    assert (device.kind, device.name) == ("touch", "")
    for name in ("hid:T-1", "hidraw:/dev/hidraw0"):
        with pytest.raises(SimError, match="its HID reports are not public, so nothing is sent to it; use hdapi"):
            open_device(name)
    assert main(["hardware", "list"]) == 0
    assert "2988:0304" in capsys.readouterr().out
    assert node.written() == []
    node.close()


def test_unrelated_hid_device_is_listed_but_refused() -> None:
    node = HidrawNode(MOUSE, 0x046D, 0xC077, "Mouse")
    (device,) = list_devices()
    assert (device.kind, device.name, device.product) == ("other", "", "Mouse")
    with pytest.raises(SimError, match="is Mouse, no phantom: not a device that moves a stylus"):
        open_device("hidraw:/dev/hidraw0")
    with pytest.raises(SimError, match="no devices are connected for 'spacemouse'"):
        open_device("spacemouse")
    assert node.written() == []
    node.close()


def test_spacemouse_opens_by_kind_and_by_node() -> None:
    node = HidrawNode(SPACEMOUSE_DESCRIPTOR, 0x256F, 0xC635, "SpaceMouse Compact")
    for name in ("spacemouse", "spacemouse:/dev/hidraw0"):
        driver = open_device(name)
        assert driver.identity.name == "SpaceMouse Compact"
        driver.close()
    assert node.written() == []
    node.close()


def test_node_without_permission_is_reported_with_its_udev_rule(phantom, capsys, monkeypatch) -> None:
    monkeypatch.setattr("sim.devices.hardware_list.os.access", lambda path, mode: path != "/dev/hidraw0")
    (device,) = list_devices()
    assert not device.usable
    assert main(["hardware", "doctor", "--seconds", "0.05"]) == 0
    output = capsys.readouterr().out
    assert 'ATTRS{idVendor}=="16c0", ATTRS{idProduct}=="0486", MODE="0660", TAG+="uaccess"' in output
    assert "/etc/udev/rules.d/70-hvf.rules" in output


def test_doctor_measures_link_with_motors_off(phantom, capsys) -> None:
    done = threading.Event()

    def serve() -> None:
        while not done.is_set():
            phantom.receive_commands()
            phantom.publish_reading()
            time.sleep(1e-3)

    device = threading.Thread(target=serve)
    device.start()
    try:
        assert main(["hardware", "doctor", "--device", "hid", "--seconds", "2"]) == 0
    finally:
        done.set()
        device.join()
    output = capsys.readouterr().out
    assert "link     Reference HVF-0001 (/dev/hidraw0)" in output
    assert "0 lost, 0 refused" in output
    assert "round trip" in output
    assert "unknown" not in output
    assert not phantom.firmware.motors.on


PERIOD = 4e-3
RATES = "--servo-period", "0.004", "--physics-step", "0.0005"


@pytest.fixture
def held_device(tmp_path):
    """A device whose stylus a hand holds on the run's curve until the motors are on, with the switch pressed."""
    node_firmware = NodeFirmware(tmp_path, period=PERIOD)
    node_firmware.linkage = HeldLinkage(np.array(Trajectory.circle(0.0477, 4.0).point(0.0)), PERIOD)
    node_firmware.firmware.sensors.pressed = 1
    yield node_firmware
    node_firmware.node.close()


@contextlib.contextmanager
def running(device: NodeFirmware) -> Iterator[None]:
    """Advance the device by a period with each command, and by itself while none arrives."""
    done = threading.Event()
    device.linkage.step(np.zeros(3))  # compile before anybody waits for a reading

    def serve() -> None:
        last = 0.0
        while not done.is_set():
            if device.receive_commands() or time.monotonic() - last > 10.0 * PERIOD:
                device.linkage.step(device.firmware.joint_torque)
                device.publish_reading()
                last = time.monotonic()
            else:
                time.sleep(2e-4)

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()


def hardware(*arguments: str) -> int:
    return main(["hardware", *arguments])


def test_device_is_calibrated_certified_run_and_reported_from_the_command_line(held_device, tmp_path, capsys) -> None:
    """With a real certificate, through hidapi and the node, in separate processes."""
    field = ("--mode", "follow", *RATES)
    assert main(["certify", *field, "--out", str(tmp_path / "certificate")]) == 0
    run = ("run", "--device", "hid", "--arm", "--late", "5", "--seconds", "4", "--out", str(tmp_path / "run"))
    armed = (*run, "--certificate", str(tmp_path / "certificate"))
    assert hardware(*run, *field) == 2
    assert "expected --certificate" in capsys.readouterr().err
    assert hardware(*armed, *field, "--stiffness", "400") == 2
    assert "stiffness 300.0 (here 400.0)" in capsys.readouterr().err
    with running(held_device):
        for _ in range(3):  # a busy machine may be too slow for the device
            code = hardware(*armed, *field, "--overwrite")
            output = capsys.readouterr().out
            if "no new reading" not in output:
                break
    assert code == 0, output
    content = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert (content["device"], content["transport"]) == ("Reference", "/dev/hidraw0")
    assert content["active"] > 1.0
    assert content["distance"] < 3e-3
    assert content["recorded"] == content["ticks"]
    held_device.receive_commands()
    assert not held_device.firmware.motors.on
    assert main(["report", str(tmp_path / "run")]) == 0


def test_calibration_of_an_earlier_power_up_is_refused_for_a_device_without_stored_zero(held_device, tmp_path) -> None:
    held_device.power_up(calibrated=False)
    file = str(tmp_path / "device.json")
    with running(held_device):
        theta = held_device.linkage.angles()[:3]
        assert hardware("calibrate", "--device", "hid", "--pose", *map(str, theta), "--out", file) == 0
    content = read_device_file(Path(file))
    assert np.abs(content["offset"]["value"]).max() < 5e-3  # a hand sags
    calibration = calibration_from(content)
    assert check_device(open_device("hid").identity, calibration) == []
    held_device.power_up(calibrated=False)
    with pytest.raises(SimError, match="calibrated before the device was switched off"):
        check_device(open_device("hid").identity, calibration)
