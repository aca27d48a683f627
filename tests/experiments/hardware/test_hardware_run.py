"""`hvf hardware run`, calibrate and identify: permits, refusals in one line, device files, and recordings."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from controllers.certificates.loop.hand import HandRange
from controllers.certificates.report import Certificate, CertificateError, ChangedInputs, Verdict, hash_of, hashes_of
from controllers.safety.arming import TRANSITIONS
from experiments.certify.certified_clips import run_and_clips
from experiments.certify.certified_field import certificate_inputs, certified_options
from experiments.cli import main
from experiments.config.modes import Follow
from experiments.config.options import run_config
from experiments.config.part import to_dict
from experiments.config.run_config import Clock, Phantom, RunConfig
from experiments.files.certificate_files import OPTIONS
from experiments.files.device_files import (
    Calibration,
    calibrated_json,
    identified_json,
    linkage_from,
    linkage_of,
    read_device_file,
    save_device,
)
from experiments.files.json_text import json_text
from experiments.hardware.arming_checks import DEFAULT_HAND_PUSH, check_device, ignored_options, verified
from experiments.hardware.calibrate import Fixture, still_readings
from experiments.setups.parts.defaults import resolved
from models.mocap.library import embedded
from models.mocap.readers.own_bvh import write_bvh
from models.world.scene import SceneConfig
from sim.devices.driver import DeviceIdentity
from sim.errors import SimError
from sim.hardware.emulated import EmulatedPhantom
from sim.hardware.identification import NAMES, IdentificationResult
from sim.recording.recorder import Group, Recorder
from sim.recording.recording import Recording
from sim.world.linkage import Linkage
from tests.experiments.refused_command import refused

KNOWN = DeviceIdentity("arm", "usb", "", "", forces=True, watchdog=True, calibrated=True)


def found(**values: float) -> IdentificationResult:
    return IdentificationResult(
        np.array([values.get(name, 1e-3) for name in NAMES]), np.full(len(NAMES), 1e-4), 1000, 0.001
    )


def test_run_without_terminal_or_arm_option_is_refused(tmp_path: Path, capsys) -> None:
    assert "expected --arm" in refused(["hardware", "run", "--out", str(tmp_path / "run")], capsys)
    assert not (tmp_path / "run").exists()


def test_device_with_motors_requires_a_certificate(tmp_path: Path, capsys, monkeypatch) -> None:
    monkeypatch.setattr("experiments.hardware.run.check_present", lambda name: None)
    stderr = refused(["hardware", "run", "--device", "phantom", "--arm", "--out", str(tmp_path / "run")], capsys)
    assert "expected --certificate" in stderr


@pytest.mark.parametrize(
    "limit", [("--force", "20"), ("--speed", "9"), ("--small", "5"), ("--silence", "6"), ("--ramp", "0.01")]
)
def test_unsafe_limits_are_refused_on_a_real_device(tmp_path: Path, capsys, limit) -> None:
    stderr = refused(
        ["hardware", "run", "--device", "phantom", "--arm", *limit, "--out", str(tmp_path / "run")], capsys
    )
    assert limit[0] in stderr
    assert "on a real device" in stderr
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("option", "message"),
    [(("--user", "push"), "on a device: whoever holds the stylus is the hand"),
     (("--person", "median"), "on a device: whoever holds the stylus is the hand"),
     (("--figure", "physical"), "on a device: its figure is the animation"),
     (("--residual-force", "0.4"), "on a device: its figure is the animation"),
     (("--mass", "60.0"), "on a device: its figure is the animation"),
     (("--delay", "5"), "without --certificate"), (("--emulate", "x.json", "--device", "hid"), "with --device hid")],
)  # fmt: skip
def test_options_without_effect_on_a_device_are_refused_by_name(tmp_path: Path, capsys, option, message) -> None:
    stderr = refused(["hardware", "run", "--arm", *option, "--out", str(tmp_path / "run")], capsys)
    assert f"{option[0]} {option[1]} has no meaning {message}" in stderr
    assert not (tmp_path / "run").exists()


def test_excessive_silence_limit_is_refused(tmp_path: Path, capsys) -> None:
    stderr = refused(["hardware", "run", "--arm", "--silence", "2000000", "--out", str(tmp_path / "run")], capsys)
    assert "--silence is 2e+06; expected at most 5000 periods" in stderr


@pytest.mark.parametrize("late", ["-1", "0", "nan", "inf", "1e6"])
def test_meaningless_lateness_limit_is_refused_by_name(tmp_path: Path, capsys, late) -> None:
    assert "--late is " in refused(["hardware", "run", "--arm", "--late", late, "--out", str(tmp_path / "run")], capsys)


def test_simulated_hand_and_figure_of_a_file_are_named_as_ignored() -> None:
    assert ignored_options(run_config(wave=0.02)) == []
    assert ignored_options(run_config(mode="lead")) == []
    simulated = run_config(user="push", person="median", figure="kinematic", stature=1.6)
    assert ignored_options(simulated) == ["--user", "--person", "--figure"]
    assert ignored_options(run_config(residual_force=0.4)) == ["--residual-force"]
    assert ignored_options(run_config(mass=60.0)) == ["--mass"]


def test_folder_with_a_run_is_kept_without_overwrite(tmp_path: Path, capsys) -> None:
    (tmp_path / "run.h5").write_bytes(b"")
    assert "--overwrite" in refused(["hardware", "run", "--arm", "--out", str(tmp_path)], capsys)


def test_certificate_of_other_inputs_does_not_arm(tmp_path: Path) -> None:
    with pytest.raises(CertificateError, match="expected a certificate"):
        verified(tmp_path / "certificate.json", RunConfig(), 0.0)
    (tmp_path / "certificate.json").write_text(json.dumps({"inputs": "0" * 16, "parts": {}}))
    with pytest.raises(CertificateError, match="certify again"):
        verified(tmp_path, RunConfig(), 0.0)


def test_unknown_or_smaller_delay_certificate_does_not_arm(tmp_path: Path, monkeypatch) -> None:
    for outcome, message in (("unknown", "stability is unknown"), ("certified", "")):
        certificate = Certificate({"stability": Verdict(outcome, "because")}, "0" * 16)
        monkeypatch.setattr(
            "experiments.hardware.arming_checks.verify_certificate", lambda file, inputs, c=certificate: c
        )
        if message:
            with pytest.raises(SimError, match=message):
                verified(tmp_path, RunConfig(), 0.0)
        else:
            assert verified(tmp_path, RunConfig(), 0.0) is certificate
    save_device(identified_json(found(delay=8e-4), [], {}), tmp_path / "device.json")
    config = RunConfig(device=Phantom(device_file=str(tmp_path / "device.json")))
    with pytest.raises(SimError, match=r"a delay of 0\.0008 s"):
        verified(tmp_path, config, 0.0)
    assert verified(tmp_path, config, 1e-3)


def test_device_without_motors_or_calibration_is_refused() -> None:
    assert check_device(KNOWN, None) == []
    assert "no watchdog" in check_device(KNOWN._replace(watchdog=False), None)[0]
    assert "is not a Phantom" in check_device(KNOWN._replace(own_weight=True), None)[0]
    assert check_device(KNOWN._replace(own_weight=True), None, identified=True) == []
    with pytest.raises(SimError, match="not calibrated"):
        check_device(KNOWN._replace(calibrated=False), None)
    with pytest.raises(SimError, match="no motors"):
        check_device(KNOWN._replace(forces=False), None)


def test_calibration_is_valid_for_one_device_and_one_power_up() -> None:
    forgets = KNOWN._replace(calibrated=False, serial="7", power_up=3)
    assert check_device(forgets, Calibration("arm", "7", 3)) == []
    assert check_device(forgets._replace(calibrated=True, power_up=4), Calibration("arm", "7", 3)) == []
    with pytest.raises(SimError, match="calibrated before the device was switched off"):
        check_device(forgets._replace(power_up=4), Calibration("arm", "7", 3))
    with pytest.raises(SimError, match="is calibrated for arm 8, this is arm 7"):
        check_device(forgets, Calibration("arm", "8", 3))


def test_device_file_round_trips_and_changes_linkage_and_certificate(tmp_path: Path) -> None:
    file = tmp_path / "device.json"
    save_device(identified_json(found(coulomb2=0.02, offset3=-0.01, viscous1=-1e-6), ["a"], {}), file)
    linkage = linkage_from(read_device_file(file))
    assert (linkage.coulomb[1], linkage.offset, linkage.viscous[0]) == (0.02, (0.0, 1e-3, -0.01), 0.0)
    config = RunConfig(device=Phantom(device_file=str(file)))
    assert linkage_of(config.device) == linkage
    plain = certificate_inputs(RunConfig(), 0.0, HandRange(), 1.0)
    assert certificate_inputs(config, 0.0, HandRange(), 1.0)["device"] != plain["device"]


def test_identify_and_calibrate_keep_each_others_results(tmp_path: Path) -> None:
    calibrated = calibrated_json([0.01, -0.02, 0.03], [1e-4] * 3, KNOWN, {})
    identified = identified_json(found(coulomb1=0.02, offset2=0.001, offset3=-0.002), ["a"], calibrated)
    assert linkage_from(identified).offset == pytest.approx((0.01, -0.019, 0.028))
    assert identified["calibration"] == {"name": "arm", "serial": "", "power_up": 0}
    again = calibrated_json([0.0, 0.0, 0.5], [1e-4] * 3, KNOWN, identified)
    assert linkage_from(again).offset == (0.0, 0.0, 0.5)
    assert linkage_from(again).coulomb == linkage_from(identified).coulomb
    save_device(again, tmp_path / "device.json")
    assert read_device_file(tmp_path / "device.json") == again
    config = RunConfig(device=Phantom(device_file=str(tmp_path / "device.json")))
    save_device(identified, tmp_path / "other.json")
    other = RunConfig(device=Phantom(device_file=str(tmp_path / "other.json")))
    of, of_other = (certificate_inputs(c, 0.0, HandRange(), 1.0)["device"] for c in (config, other))
    assert of == of_other  # the encoder offset changes no verdict


@pytest.mark.parametrize(
    ("changed", "message"),
    [({"mode": Follow(stiffness=400.0)}, r"certifies another field or device: stiffness 300.0 \(here 400.0\)"),
     ({"clock": Clock(servo_period=0.002)}, r"servo_period 0.001 \(here 0.002\)"),
     ({"device": Phantom(cutoff=90.0)}, r"cutoff 150.0 \(here 90.0\)")],
)  # fmt: skip
def test_certificate_of_another_field_names_the_differing_option(tmp_path: Path, changed, message) -> None:
    config = resolved(RunConfig())
    inputs = certificate_inputs(config, 0.0, HandRange(), DEFAULT_HAND_PUSH)
    certificate = Certificate({"stability": Verdict("certified", "it is")}, hash_of(inputs), hashes_of(inputs))
    (tmp_path / "certificate.json").write_text(json.dumps(certificate.to_json()))
    (tmp_path / OPTIONS).write_text(json_text(certified_options(config, 0.0, HandRange(), DEFAULT_HAND_PUSH)))
    assert verified(tmp_path, config, 0.0).inputs == certificate.inputs
    with pytest.raises(ChangedInputs, match=message) as refused:
        verified(tmp_path, resolved(replace(RunConfig(), **changed)), 0.0)
    assert "\n" not in str(refused.value)


def test_calibration_finds_hidden_offset_and_keeps_file_content(tmp_path: Path, capsys) -> None:
    hidden = {"format": "hvf-device-1", "offset": {"value": [0.02, -0.03, 0.015]}}
    file, other = tmp_path / "device.json", tmp_path / "hidden.json"
    save_device(hidden, other)
    save_device({"format": "hvf-device-1", "delay": {"value": [1e-4], "margin": [1e-5]}}, file)
    arguments = ["calibrate", "--emulate", str(other), "--out", str(file), "--seconds", "0.2"]
    assert main(["hardware", *arguments, "--pose", "0.1", "-0.2", "0.3"]) == 0
    content = read_device_file(file)
    margin = np.array(content["offset"]["margin"])
    assert np.all(np.abs(np.array(content["offset"]["value"]) - [0.02, -0.03, 0.015]) <= margin)
    assert margin.max() < 5e-4
    assert content["delay"]["value"] == [1e-4]
    assert content["calibration"]["name"] == "emulated Phantom"
    assert "--overwrite" in refused(["hardware", *arguments], capsys)
    capsys.readouterr()
    assert main(["hardware", *arguments, "--overwrite", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == read_device_file(file)


def test_fixture_holds_the_stylus_without_sagging() -> None:
    device = Fixture((0.5, 0.9, 0.2), Linkage())
    for _ in range(200):
        device.write(np.zeros(3), False)
    np.testing.assert_allclose(device.port.qpos[list(device.port.arm_q)], [0.5, 0.9, 0.2], atol=1e-8)


def test_moving_stylus_is_refused_for_calibration() -> None:
    device = EmulatedPhantom(SceneConfig(), np.zeros(3), holds=0.0)
    for _ in range(50):  # it falls
        device.write(np.zeros(3), False)
    with pytest.raises(SimError, match="hold the stylus still"):
        still_readings(device, 0.3)


@pytest.mark.parametrize(
    "text",
    ["", "[]", "{}", '{"format": "other"}', '{"format": "hvf-device-1", "coulomb": 3}',
     '{"format": "hvf-device-1", "offset": {"value": [NaN, 0, 0]}}',
     '{"format": "hvf-device-1", "offset": {"value": [1e300, 0, 0]}}',
     '{"format": "hvf-device-1", "viscous": {"value": [Infinity, 0, 0]}}',
     '{"format": "hvf-device-1", "delay": {"value": [NaN]}}'],
)  # fmt: skip
def test_invalid_device_file_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "device.json").write_text(text)
    with pytest.raises(SimError, match="expected what hvf hardware identify or calibrate writes"):
        read_device_file(tmp_path / "device.json")


@pytest.mark.parametrize(
    ("content", "message"),
    [('{"format": "hvf-device-1", "delay": {"value": [0.5]}}', "a delay of 0.5 s; expected at most"),
     ('{"format": "hvf-device-1", "offset": {"value": [0.1, 0, 0]}}', "is not calibrated"),
     ("{}", "expected what hvf hardware identify or calibrate writes"), (None, "cannot be read")],
)  # fmt: skip
def test_invalid_emulated_device_is_refused_and_the_folder_unchanged(tmp_path: Path, capsys, content, message) -> None:
    file, old_file = tmp_path / "device.json", tmp_path / "run" / "kept"
    old_file.parent.mkdir()
    old_file.write_text("")
    if content is not None:
        file.write_text(content)
    assert message in refused(
        ["hardware", "run", "--arm", "--emulate", str(file), "--out", str(old_file.parent), "--overwrite"], capsys
    )
    assert list(old_file.parent.iterdir()) == [old_file]


def test_device_recording_is_certified_but_not_reproduced_or_drawn(tmp_path: Path, capsys) -> None:
    config = run_config(figure="none", seconds=1.0)
    static = {"curve": [[0.0, 0.0, 0.0]], "clip_names": "", "clip_fps": np.zeros(0)}
    channels = {"ticks": Group(1e3, {"t": (), "clock": ()})}
    with Recorder(tmp_path / "run.h5", to_dict(config), 1, channels, static) as recorder:
        recorder.append("ticks", {"t": np.zeros(5), "clock": np.zeros(5)})
    assert run_and_clips(tmp_path, config) == (config, ())
    for arguments in (["reproduce"], ["picture", str(tmp_path / "a.png")], ["render"]):
        assert main([arguments[0], str(tmp_path), *arguments[1:]]) == 2
        assert "is of a device" in capsys.readouterr().err


def test_identify_refuses_folders_without_a_hardware_run(tmp_path: Path, capsys) -> None:
    assert "expected folders" in refused(["hardware", "identify", "--out", str(tmp_path / "device.json")], capsys)
    (tmp_path / "device.json").write_text("{}")
    assert "--overwrite" in refused(
        ["hardware", "identify", str(tmp_path), "--out", str(tmp_path / "device.json")], capsys
    )


def test_state_diagram_in_docs_matches_transition_table() -> None:
    picture = (Path(__file__).parents[3] / "docs" / "pictures" / "gate-states.svg").read_text(encoding="utf-8")
    shown = {edge.replace("&gt;", ">") for edge in re.findall(r'data-edge="([^"]*)"', picture)}
    edges = {f"{a.name} --> {b.name}: {event.name}".lower() for (a, event), b in TRANSITIONS.items()}
    assert shown == {"[*] --> disarmed", *edges}


@pytest.mark.processes
def test_run_on_emulated_device_is_recorded_and_summarised(tmp_path: Path, capsys) -> None:
    out, clip = tmp_path / "run", tmp_path / "leap.bvh"
    write_bvh(embedded("jump"), clip)
    arguments = ["hardware", "run", "--arm", "--seconds", "4", "--late", "1", "--servo-period", "0.004",
                 "--physics-step", "0.00025", "--clips", str(clip), "--out", str(out)]  # fmt: skip
    for _ in range(3):  # retried, for a busy machine misses deadlines
        code = main([*arguments, "--overwrite"])
        stdout = capsys.readouterr().out
        if "no new reading" not in stdout:
            break
    assert code == 0, stdout
    assert "mm RMS from the curve" in stdout
    summary = json.loads((out / "summary.json").read_text())
    assert summary["ticks"] > 500
    assert summary["active"] > 1.0
    assert summary["recorded"] == summary["ticks"]
    assert any(remark.startswith("a lap takes 4.8 s") for remark in summary["remarks"])
    with Recording(out / "run.h5") as recording:
        assert recording.summary is not None
        assert recording.channel("ticks", "distance")[-100:].max() < 5e-3


@pytest.mark.processes
def test_hidden_device_parameters_are_identified_from_the_command_line(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    hidden = {
        "coulomb": [0.012, 0.009, 0.011], "viscous": [0.001, 0.0012, 0.0009], "inertia": [3e-4, 1e-4, 8e-5],
        "delay": [5e-4], "offset": [0.02, -0.015, 0.01],
    }  # fmt: skip
    content = {"format": "hvf-device-1"} | {name: {"value": value} for name, value in hidden.items()}
    save_device(content, Path("hidden.json"))
    run = ("run", "--emulate", "hidden.json", "--arm", "--no-dead-man", "--wave", "0.02", "--small", "2", "--late", "9",
           "--seconds", "14", "--overwrite")  # fmt: skip
    assert main(["hardware", *run, "--out", "runs/4"]) == 2  # not calibrated
    assert main(["hardware", "calibrate", "--emulate", "hidden.json", "--out", "device.json"]) == 0
    for lap in ("4", "2.5"):
        assert main(["hardware", *run, "--device-file", "device.json", "--lap", lap, "--out", f"runs/{lap}"]) in (0, 1)
    assert main(["hardware", "identify", "runs/4", "runs/2.5", "--out", "found.json"]) == 0
    found = read_device_file(Path("found.json"))
    for name, value in hidden.items():
        assert np.all(np.abs(np.array(found[name]["value"]) - value) <= np.array(found[name]["margin"])), name
    linkage = linkage_from(found)
    assert linkage_of(Phantom(device_file="found.json")) == linkage
    assert main(["run", "--figure", "none", "--seconds", "1", "--device-file", "found.json", "--out", "runs/sim"]) == 0
