"""`hvf hardware` with no device connected: messages for people, and JSON for programs."""

import errno
import json
import subprocess
import sys

import pytest

from experiments.cli import main
from experiments.hardware.doctor import MISSING, OK, findings, measured_lateness
from sim.devices import hardware_list
from sim.devices.hardware_list import FoundDevice, list_devices

FIND = "sim.devices.vendor_library.ctypes.util.find_library"


@pytest.fixture(autouse=True)
def nothing_connected(monkeypatch: pytest.MonkeyPatch) -> None:
    class Backend:
        @staticmethod
        def enumerate() -> list[dict]:
            return []

    monkeypatch.setattr(hardware_list, "hid_backend", Backend)
    monkeypatch.setattr(FIND, lambda name: None)


def test_empty_device_list_points_to_doctor(capsys) -> None:
    assert main(["hardware", "list"]) == 0
    assert capsys.readouterr().out == "no device found; `hvf hardware doctor` says what may be missing\n"
    assert main(["hardware", "list", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == []


def test_doctor_reports_missing_drivers_and_lateness(capsys) -> None:
    assert main(["hardware", "doctor", "--seconds", "0.05", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    state = {finding["what"]: finding for finding in result["findings"]}
    assert state["hidapi"]["state"] == OK
    assert state["OpenHaptics (HD)"]["state"] == state["Force Dimension (dhd)"]["state"] == MISSING
    assert "OpenHaptics" in state["OpenHaptics (HD)"]["remedy"]
    assert {"kernel", "realtime priority", "memory lock", "processor's frequency"} <= set(state)
    assert 0.0 <= result["lateness"]["p50"] <= result["lateness"]["p99"] <= result["lateness"]["worst"]
    assert result["link"] is None


def test_missed_deadlines_are_counted() -> None:
    lateness = measured_lateness(0.1)
    assert lateness.loops + lateness.missed == 100


@pytest.mark.parametrize(
    ("device", "message"),
    [
        ("frob", "no device is called 'frob'"), ("hidraw", "no device is called 'hidraw'"),
        ("hid:7", "no devices are connected for 'hid:7'"), ("hdapi", "install 3D Systems' OpenHaptics"),
        ("dhd", "install the Force Dimension SDK"), ("dhd:3", "no device is called 'dhd:3'"),
    ],
)  # fmt: skip
def test_missing_device_is_refused_in_one_line(capsys, device, message) -> None:
    assert main(["hardware", "doctor", "--device", device, "--seconds", "0.01"]) == 2
    stderr = capsys.readouterr().err
    assert message in stderr
    assert stderr.count("\n") == 1


def test_missing_device_is_reported_before_a_certificate_is_required(capsys, tmp_path) -> None:
    old_file = tmp_path / "run" / "kept"
    old_file.parent.mkdir()
    old_file.write_text("")
    for device, message in (("frob", "no device is called 'frob'"), ("hid", "no devices are connected for 'hid'; "),
                         ("hdapi", "install 3D Systems' OpenHaptics")):  # fmt: skip
        assert main(["hardware", "run", "--device", device, "--arm", "--out", str(old_file.parent), "--overwrite"]) == 2
        assert message in capsys.readouterr().err
    assert old_file.exists()


@pytest.mark.parametrize("pose", [("9", "9", "9"), ("nan", "0", "0"), ("0", "inf", "0")])
def test_unreachable_calibration_pose_is_refused(capsys, tmp_path, pose) -> None:
    assert main(["hardware", "calibrate", "--pose", *pose, "--out", str(tmp_path / "device.json")]) == 2
    assert f"--pose {' '.join(pose)} is beyond the joints' stops" in capsys.readouterr().err
    assert not (tmp_path / "device.json").exists()


def test_emulate_option_with_a_real_device_is_refused(capsys, tmp_path) -> None:
    arguments = "--device", "hid", "--emulate", "x.json", "--out", str(tmp_path / "device.json")
    assert main(["hardware", "calibrate", *arguments]) == 2
    assert "--emulate x.json has no meaning with --device hid" in capsys.readouterr().err


def test_zero_seconds_are_refused(capsys) -> None:
    assert main(["hardware", "doctor", "--seconds", "0"]) == 2
    assert "seconds" in capsys.readouterr().err


def test_full_disk_is_reported_in_one_line(monkeypatch, capsys) -> None:
    def full() -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(hardware_list, "list_devices", full)
    assert main(["hardware", "list"]) == 2
    assert capsys.readouterr().err == "hvf: the disk is full; expected room on it, or another --out\n"


def test_missing_hidapi_is_reported_with_install_command(monkeypatch, capsys) -> None:
    monkeypatch.undo()
    monkeypatch.setitem(__import__("sys").modules, "hidraw", None)
    monkeypatch.setitem(__import__("sys").modules, "hid", None)
    assert main(["hardware", "list"]) == 2
    assert "pip install hidapi" in capsys.readouterr().err


def test_installed_library_is_listed_and_inaccessible_node_gets_udev_rule(monkeypatch) -> None:
    monkeypatch.setattr(FIND, {"HD": "libHD.so"}.get)
    (device,) = list_devices()
    assert (device.name, device.transport, device.kind) == ("hdapi", "HDAPI", "vendor")
    node = FoundDevice(
        "hid:1", "usb", "hidraw", "/dev/hidraw9", 0x16C0, 0x486, "V", "P", "1", "phantom", "no permission", False
    )
    (finding,) = (finding for finding in findings([node]) if finding.what == "/dev/hidraw9")
    assert finding.state == MISSING
    assert node.udev_rule() in finding.remedy


@pytest.mark.slow
def test_closed_stdin_is_not_a_terminal(tmp_path) -> None:
    closed = "import os, sys; os.close(0); os.execv(sys.executable, [sys.executable, *sys.argv[1:]])"
    command = ["-m", "experiments.cli", "hardware", "run", "--out", str(tmp_path / "run")]
    completed = subprocess.run(
        [sys.executable, "-c", closed, *command], capture_output=True, text=True, check=False, timeout=60
    )
    assert completed.stderr == "hvf: nobody is at a terminal to arm the device; expected --arm, or a terminal\n"
    assert completed.returncode == 2
