"""Device files: written files are read back, and implausible values are refused by name."""

import json
from pathlib import Path

import numpy as np
import pytest

from experiments.files.device_files import calibrated_json, identified_json, read_device_file, save_device
from sim.devices.driver import DeviceIdentity
from sim.errors import SimError
from sim.hardware.identification import NAMES, IdentificationResult

FOUND = IdentificationResult(np.full(len(NAMES), -1e-6), np.full(len(NAMES), np.inf), 1000, 0.001)
ARM = DeviceIdentity("arm", "usb", "", "", forces=True, watchdog=True, calibrated=False)


def refusal(file: Path, **content: object) -> str:
    file.write_text(json.dumps({"format": "hvf-device-1", **content}))
    with pytest.raises(SimError, match="expected what hvf hardware identify or calibrate writes") as refused:
        read_device_file(file)
    return str(refused.value)


def test_files_of_identify_and_calibrate_are_read_back(tmp_path: Path) -> None:
    file, content = tmp_path / "device.json", json.loads(Path("examples/hidden.json").read_text())
    for step in (
        lambda base: identified_json(FOUND, ["a"], base),  # the offset of this base has no margin
        lambda base: calibrated_json([0.01, -0.02, 0.03], [1e-4] * 3, ARM, base),
        lambda base: identified_json(FOUND, ["b"], base),
    ):
        save_device(step(content), file)
        content = read_device_file(file)
    file.write_text(file.read_text(encoding="utf-8"), encoding="utf-8-sig")  # by an editor on Windows
    assert read_device_file(file) == content
    assert content["offset"]["margin"] == [1e-4, None, None]
    assert content["recordings"] == ["b"]


def test_unknown_keys_are_refused_with_the_known_ones(tmp_path: Path) -> None:
    file, three = tmp_path / "device.json", {"value": [0.01, 0.01, 0.01]}
    assert "(couloumb is not known, only format, coulomb, viscous, inertia, offset, delay" in refusal(
        file, couloumb=three
    )
    assert "coulomb.margins is not known, only value, margin" in refusal(file, coulomb=three | {"margins": [1, 1, 1]})
    calibration = {"name": "arm", "serial": "", "power_up": 0, "by": "me"}
    assert "calibration.by is not known, only name, serial, power_up" in refusal(file, calibration=calibration)


@pytest.mark.parametrize(
    ("name", "entry", "message"),
    [("coulomb", {"value": [0.01, 0.01]}, "coulomb.value has 2 numbers, not 3"),
     ("offset", {"value": [0, 0, 0], "margin": [1e-4, 1e-4]}, "offset.margin has 2 numbers, not 3"),
     ("delay", {"value": [1e-4, 1e-4]}, "delay.value has 2 numbers, not 1"),
     ("weight", {"value": [5.0, 0.1]}, "weight.value 5.0 is not from -1.72 to 1.72"),
     ("coulomb", {"value": [0.01, 0.01, 2.0]}, "coulomb.value 2.0 is not from -1.72 to 1.72"),
     ("viscous", {"value": [True, 0, 0]}, "viscous.value True is not from"),
     ("offset", {"value": [0, 0, 0], "margin": [1e-4, -1e-4, 0]}, "offset.margin -0.0001 is not from 0 to inf")],
)  # fmt: skip
def test_implausible_device_numbers_are_refused(tmp_path: Path, name: str, entry: dict, message: str) -> None:
    assert message in refusal(tmp_path / "device.json", **{name: entry})
