"""What a person meets who runs a device: permits, one line where something is wrong, a folder with what happened."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from controllers.certificates.report import CertificateError
from controllers.safety.arming import TRANSITIONS, mermaid
from experiments.cli import main
from experiments.config.run_config import Phantom, RunConfig
from experiments.files.device_files import device_json, linkage_of, load_device, save_device
from experiments.hardware.permit import check_device, verified
from sim.devices.driver import DeviceIdentity
from sim.errors import SimError
from sim.hardware.identification import NAMES, Identified
from sim.recording.recording import Recording

KNOWN = DeviceIdentity("arm", "usb", "", "", forces=True, watchdog=True, calibrated=True)


def found(**values: float) -> Identified:
    return Identified(np.array([values.get(name, 1e-3) for name in NAMES]), np.full(len(NAMES), 1e-4), 1000, 0.001)


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert main(["hardware", *arguments]) == 2
    said = capsys.readouterr()
    assert said.err.count("\n") == 1
    return said.err


def test_nobody_at_the_terminal_and_no_arm_is_refused(tmp_path: Path, capsys) -> None:
    assert "expected --arm" in refused(capsys, "run", "--out", str(tmp_path / "run"))
    assert not (tmp_path / "run").exists()


def test_a_device_with_motors_needs_a_certificate(tmp_path: Path, capsys) -> None:
    said = refused(capsys, "run", "--device", "phantom", "--arm", "--out", str(tmp_path / "run"))
    assert "expected --certificate" in said


def test_a_folder_that_holds_a_run_is_kept(tmp_path: Path, capsys) -> None:
    (tmp_path / "run.h5").write_bytes(b"")
    assert "--overwrite" in refused(capsys, "run", "--arm", "--out", str(tmp_path))


def test_a_certificate_of_something_else_arms_nothing(tmp_path: Path) -> None:
    with pytest.raises(CertificateError, match="expected a certificate"):
        verified(tmp_path / "certificate.json", RunConfig(), 0.0)
    (tmp_path / "certificate.json").write_text(json.dumps({"inputs": "0" * 16, "parts": {}}))
    with pytest.raises(CertificateError, match="certify again"):
        verified(tmp_path, RunConfig(), 0.0)


def test_a_certificate_that_is_unknown_or_for_less_delay_arms_nothing(tmp_path: Path, monkeypatch) -> None:
    from controllers.certificates.report import Certificate, Verdict

    for outcome, says in (("unknown", "stability is unknown"), ("certified", "")):
        certificate = Certificate({"stability": Verdict(outcome, "because")}, "0" * 16)
        monkeypatch.setattr("experiments.hardware.permit.verify_certificate", lambda file, inputs, c=certificate: c)
        if says:
            with pytest.raises(SimError, match=says):
                verified(tmp_path, RunConfig(), 0.0)
        else:
            assert verified(tmp_path, RunConfig(), 0.0) is certificate
    save_device(device_json(found(delay=8e-4), []), tmp_path / "device.json")
    config = RunConfig(device=Phantom(device_file=str(tmp_path / "device.json")))
    with pytest.raises(SimError, match=r"a delay of 0\.0008 s"):
        verified(tmp_path, config, 0.0)
    assert verified(tmp_path, config, 1e-3)


def test_a_device_without_motors_or_zero_is_not_armed_and_one_without_a_watchdog_is_announced() -> None:
    assert check_device(KNOWN) == []
    assert "no watchdog" in check_device(KNOWN._replace(watchdog=False))[0]
    with pytest.raises(SimError, match="not calibrated"):
        check_device(KNOWN._replace(calibrated=False))
    with pytest.raises(SimError, match="no motors"):
        check_device(KNOWN._replace(forces=False))


def test_a_device_file_comes_back_as_it_was_and_changes_simulation_and_certificate(tmp_path: Path) -> None:
    from controllers.certificates.loop.hand import HandRange
    from experiments.certify.certified_field import certificate_inputs

    file = tmp_path / "device.json"
    save_device(device_json(found(coulomb2=0.02, offset3=-0.01, viscous1=-1e-6), ["a"]), file)
    linkage = load_device(file)
    assert (linkage.coulomb[1], linkage.offset, linkage.viscous[0]) == (0.02, (0.0, 1e-3, -0.01), 0.0)
    config = RunConfig(device=Phantom(device_file=str(file)))
    assert linkage_of(config.device) == linkage
    plain = certificate_inputs(RunConfig(), 0.0, HandRange(), 1.0)
    assert certificate_inputs(config, 0.0, HandRange(), 1.0)["device"] != plain["device"]


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"format": "other"}', '{"format": "hvf-device-1", "coulomb": 3}'])
def test_a_file_that_is_no_device_is_said_in_a_line(tmp_path: Path, text: str) -> None:
    (tmp_path / "device.json").write_text(text)
    with pytest.raises(SimError, match="expected what hvf hardware identify writes"):
        load_device(tmp_path / "device.json")


def test_identify_refuses_what_is_no_hardware_run(tmp_path: Path, capsys) -> None:
    assert "expected folders" in refused(capsys, "identify", "--out", str(tmp_path / "device.json"))
    (tmp_path / "device.json").write_text("{}")
    assert "--overwrite" in refused(capsys, "identify", str(tmp_path), "--out", str(tmp_path / "device.json"))


def test_the_diagram_of_the_documents_is_the_table() -> None:
    picture = (Path(__file__).parents[2] / "docs" / "pictures" / "gate-states.svg").read_text(encoding="utf-8")
    shown = {edge.replace("&gt;", ">") for edge in re.findall(r'data-edge="([^"]*)"', picture)}
    assert shown == {line.strip() for line in mermaid().splitlines() if "-->" in line}
    assert len(shown) == len(TRANSITIONS) + 1


@pytest.mark.processes
def test_a_run_on_the_emulated_device_leaves_a_recording_and_says_what_it_was(tmp_path: Path, capsys) -> None:
    out = tmp_path / "run"
    arguments = ["hardware", "run", "--arm", "--seconds", "4", "--late", "1", "--servo-period", "0.004",
                 "--physics-step", "0.00025", "--out", str(out)]  # fmt: skip
    for _ in range(3):  # a machine that is too busy for the device is no failure of ours
        code = main([*arguments, "--overwrite"])
        said = capsys.readouterr().out
        if "no new reading" not in said:
            break
    assert code == 0, said
    assert "mm RMS from the curve" in said
    summary = json.loads((out / "summary.json").read_text())
    assert summary["ticks"] > 500
    assert summary["active"] > 1.0
    assert summary["recorded"] == summary["ticks"]
    with Recording(out / "run.h5") as recording:
        assert recording.summary is not None
        assert recording.channel("ticks", "distance")[-100:].max() < 5e-3
