"""`hvf certify`: files written, reuse of a certificate with equal inputs, and `--verify` for every changed input."""

import json
import subprocess
import sys
import time
from dataclasses import replace

import pytest

from controllers.certificates.flight.tolerance import DEFAULT_CRITERIA
from controllers.certificates.loop.hand import HandRange
from controllers.certificates.report import CertificateError
from experiments.certify import certified_field
from experiments.certify.certificate_page import certificate_page
from experiments.certify.certified_field import certificate_inputs
from experiments.certify.certify import (
    CERTIFICATE,
    FLIGHTS_PLOT,
    PAGE,
    PLOT,
    REGION_PLOT,
    certified_rivers,
    certify_clip_into,
    certify_into,
)
from experiments.cli import main
from experiments.config.options import run_config
from experiments.files import certificate_files
from experiments.files.certificate_files import OPTIONS, read_certificate, verify_certificate
from experiments.setups.certified_law import uncertified_parts
from experiments.setups.wiring import wire
from models.mocap.library import embedded
from tests.models.mocap.retargeting.rigs import Rig, write_rig

HANDS = HandRange((0.1, 0.1), (2.0, 2.0), (0.0, 0.0))


def test_parallel_flow_is_certified_with_the_compensation_of_the_run():
    config = run_config(flow="parallel", figure="none", lap=12.0)
    (law,) = wire(config).parts.program.laws
    assert 0.1 < law.compensation < 0.5
    assert certified_rivers(config)[""].law.parallel == law.parallel_share == 1.0 - law.compensation


@pytest.fixture(scope="module")
def folder_and_certificate(tmp_path_factory):
    """Of the demo's river, written over files that are no certificate."""
    out = tmp_path_factory.mktemp("certificate")
    (out / CERTIFICATE).write_text("not json")
    (out / PAGE).write_text("")
    return out, certify_into(run_config(), out, hands=HANDS)


@pytest.fixture(scope="module")
def folder(folder_and_certificate):
    return folder_and_certificate[0]


@pytest.mark.slow
def test_demo_river_is_certified_and_reported_in_place_of_an_invalid_certificate(folder):
    certificate = json.loads((folder / CERTIFICATE).read_text())
    assert certificate["stability"]["verdict"] == "certified"
    assert certificate["energy"]["verdict"] == "certified"
    assert certificate["passivity"]["verdict"] == "refuted"
    page = (folder / PAGE).read_text()
    assert "stability: " in page
    assert "<script" not in page
    assert (folder / PLOT).read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_page_has_words_and_units_and_no_arrays(folder_and_certificate):
    folder, certificate = folder_and_certificate
    page = (folder / PAGE).read_text()
    assert "array(" not in page
    assert "critical damping b_d, no hand</td><td>" in page
    assert "N s/m" in page
    assert "HandImpedance(" not in certificate_page(certificate, {}).split("Counterexample")[1]


@pytest.mark.slow
def test_certificate_with_same_inputs_is_reused(folder):
    before, begin = (folder / CERTIFICATE).stat().st_mtime_ns, time.perf_counter()
    again = certify_into(run_config(seconds=3.0, seed=9), folder, hands=HANDS)
    assert time.perf_counter() - begin < 1.0
    assert (folder / CERTIFICATE).stat().st_mtime_ns == before
    assert again.verdicts["stability"].verdict == "certified"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "changed_part"),
    [
        ({"stiffness": 301.0}, "gains"),
        ({"damping": 4.1}, "gains"),
        ({"tube": 0.2}, "gains"),
        ({"mode": "bunny"}, "gains"),
        ({"radius": 0.048}, "curve"),
        ({"lap": 4.1}, "curve"),
        ({"servo_period": 5e-4}, "period"),
        ({"cutoff": 149.0}, "filter"),
    ],
)
def test_changed_field_parameter_invalidates_certificate(folder, change, changed_part):
    file = folder / CERTIFICATE
    verify_certificate(file, certificate_inputs(run_config(), 0.0, HANDS, 1.0))
    with pytest.raises(CertificateError, match=f"changed: {changed_part}; certify again"):
        verify_certificate(file, certificate_inputs(run_config(**change), 0.0, HANDS, 1.0))


@pytest.mark.slow
def test_changed_delay_hand_or_push_invalidates_certificate(folder):
    file = folder / CERTIFICATE
    with pytest.raises(CertificateError, match="changed: delay;"):
        verify_certificate(file, certificate_inputs(run_config(), 1e-4, HANDS, 1.0))
    with pytest.raises(CertificateError, match="changed: hand, push;"):
        verify_certificate(file, certificate_inputs(run_config(), 0.0, HandRange(), 2.0))


@pytest.mark.slow
def test_changed_device_or_code_invalidates_certificate(folder, monkeypatch):
    file = folder / CERTIFICATE
    heavier = replace(certified_field.PREMIUM_1_5, m_a=0.021)
    with monkeypatch.context() as patch:
        patch.setattr(certified_field, "PREMIUM_1_5", heavier)
        with pytest.raises(CertificateError, match="changed: device;"):
            verify_certificate(file, certificate_inputs(run_config(), 0.0, HANDS, 1.0))
    monkeypatch.setattr(certificate_files, "sources_hash", lambda module: "0")
    with pytest.raises(CertificateError, match="changed: code;"):
        verify_certificate(file, certificate_inputs(run_config(), 0.0, HANDS, 1.0))


@pytest.mark.slow
def test_verify_needs_no_casadi_or_splines_and_names_changes(folder, capsys):
    file = str(folder / CERTIFICATE)
    hands = ["--hand.mass", "0.1", "0.1", "--hand.damping", "2", "2", "--hand.stiffness", "0", "0"]
    assert main(["certify", "--verify", file, *hands]) == 0
    assert "stability: certified" in capsys.readouterr().out
    assert main(["certify", "--verify", file, *hands, "--stiffness", "299", "--delay", "0.001"]) == 1
    assert "changed: gains, delay; certify again" in capsys.readouterr().err
    assert main(["certify", "--verify", file, "--no-hand"]) == 1
    assert "changed: hand;" in capsys.readouterr().err
    code = f"import sys; from experiments.cli import main; main(['certify', '--verify', {file!r}]); "
    code += "assert not {'casadi', 'scipy.interpolate'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)


def test_invalid_hand_intervals_are_refused_in_one_line(tmp_path, capsys):
    out = str(tmp_path / "none")
    assert main(["certify", "--out", out, "--hand.mass", "0.2", "0.1"]) == 2
    assert "mass of hands lies between 0.2 and 0.1" in capsys.readouterr().err
    assert main(["certify", "--out", out, "--hand.damping", "-1", "1"]) == 2
    assert "at least 0" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            "runs/demo --stiffness 500",
            "--stiffness has no meaning with a run, whose field is as recorded in runs/demo; ",
        ),
        ("runs/demo --config my.json", "--config has no meaning with a run, whose field is as recorded in runs/demo; "),
        ("runs/demo --clip walk", "runs/demo has no meaning with --clip walk; certify one, then the other"),
        ("--clip walk --map m.npz", "--map has no meaning with --clip walk; it belongs to a field"),
        ("--clip walk --mode lead", "--mode has no meaning with --clip walk; it belongs to a field"),
        ("--clip walk --no-hand", "--no-hand has no meaning with --clip walk; it belongs to a field"),
        ("--clip walk --hand.mass 0 1", "--hand.mass has no meaning with --clip walk; it belongs to a field"),
        ("--clip walk --delay 0.001", "--delay has no meaning with --clip walk; it belongs to a field"),
        ("--no-hand --hand.mass 0 1", "--hand.mass has no meaning with --no-hand; it belongs to a hand on the stylus"),
        ("--stiffness 500 --friction 0.5", "--friction has no meaning with a field alone; it belongs to clips"),
        ("--tolerance.yaw 1", "--tolerance.yaw has no meaning with a field alone; it belongs to clips"),
    ],
)
def test_options_irrelevant_to_the_certificate_are_refused_by_name(arguments, message, tmp_path, capsys):
    assert main(["certify", *arguments.split(), "--out", str(tmp_path / "out")]) == 2
    assert f"hvf: {message}" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_certified_laws_of_bunny_and_tubes_and_uncovered_gates():
    point = certified_rivers(run_config(mode="bunny"))[""]
    along = certified_rivers(run_config(mode="bunny", bunny_attraction="along"))[""]
    assert (point.law.slides, along.law.slides) == (False, True)
    tubes = certified_rivers(run_config(mode="stretch-then-follow", seek=140.0, rubber=160.0))
    assert [(name, river.k_r, river.law.slides) for name, river in tubes.items()] == [
        ("", 140.0, True), ("_held", 160.0, False), ("_then", 300.0, True),
    ]  # fmt: skip
    assert certified_rivers(run_config(mode="rivers"))[""].width == run_config(mode="rivers").mode.river_tube
    assert uncertified_parts(run_config(mode="rivers", governor=True)) == ("the gates of the rivers (--governor)",)


@pytest.mark.parametrize("text", ['{"inputs": "0"}', "[1, 2", "\x00", "[" * 100_000])
def test_invalid_certificate_files_are_refused(tmp_path, text):
    (tmp_path / CERTIFICATE).write_text(text)
    if text.startswith("{"):
        assert read_certificate(tmp_path / CERTIFICATE).verdicts == {}
    else:
        with pytest.raises(CertificateError, match=CERTIFICATE):
            read_certificate(tmp_path / CERTIFICATE)


@pytest.mark.slow
def test_clip_certificate_is_reused_and_verified_against_clip_and_tolerances(tmp_path, capsys):
    out = tmp_path / "jump"
    clip = ["certify", "--clip", "jump", "--out", str(out)]
    assert main(clip) == 0
    assert "ballistic: certified" in capsys.readouterr().out
    assert (out / FLIGHTS_PLOT).read_bytes().startswith(b"\x89PNG")
    assert f"src='{FLIGHTS_PLOT}'" in (out / PAGE).read_text()
    written = (out / CERTIFICATE).stat().st_mtime_ns
    assert main(clip) == 0
    assert (out / CERTIFICATE).stat().st_mtime_ns == written
    verify = ["certify", "--verify", str(out / CERTIFICATE), "--clip"]
    assert main([*verify, "jump"]) == 0
    assert main([*verify, "jump", "--friction", "0.5"]) == 1
    assert "changed: judging;" in capsys.readouterr().err
    assert main([*verify, "walk"]) == 1
    assert "changed: clip;" in capsys.readouterr().err
    other = [*clip, "--tolerance.gravity", "9.0", "9.81001"]
    assert main(other) == 2
    message = f"hvf: {out}: holds a certificate of something else; choose another --out, or --overwrite it\n"
    assert capsys.readouterr().err == message
    assert (out / CERTIFICATE).stat().st_mtime_ns == written
    assert main([*other, "--overwrite"]) == 0
    assert (out / CERTIFICATE).stat().st_mtime_ns != written
    assert main([*verify, "jump"]) == 1
    assert "changed: judging;" in capsys.readouterr().err
    assert main(["certify", "--verify", str(tmp_path / "none.json")]) == 2
    assert "expected a certificate.json" in capsys.readouterr().err


def test_clip_certificate_is_verified_with_its_stored_options(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["certify", "--clip", "walk", "--friction", "0.5", "--out", "here"]) == 0
    assert main(["certify", "--verify", "here/certificate.json"]) == 0
    assert "valid, nothing that it covers has changed" in capsys.readouterr().out
    assert main(["certify", "--clip", "walk", "--verify", "here/certificate.json"]) == 1
    assert "changed: judging" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.usefixtures("without_region")
def test_field_certificate_is_verified_with_its_stored_gains(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["certify", "--stiffness", "500", "--no-hand", "--out", "field"]) == 0
    assert main(["certify", "--verify", "field/certificate.json"]) == 0
    assert main(["certify", "--stiffness", "400", "--no-hand", "--verify", "field/certificate.json"]) == 1
    assert "changed: gains" in capsys.readouterr().err


@pytest.mark.parametrize("rig", [Rig(), Rig(leading=1), Rig(without=("head", "neck"), leading=1)])
def test_capture_certificate_lists_scaling_and_dropped_first_frame(rig, tmp_path):
    write_rig(rig, embedded("walk"), tmp_path / "walker.bvh")
    certificate = certify_clip_into(str(tmp_path / "walker.bvh"), tmp_path / "out", DEFAULT_CRITERIA)
    assumed = certificate.verdicts["ballistic"].assumptions
    (scaled,) = (
        line for line in assumed if line.startswith("lengths, and gravity with them, are scaled to the figure:")
    )
    assert "one unit becomes" in scaled
    cut = "walker.bvh: left out: the first frame, a pose that is not part of the motion"
    assert (cut in assumed) == (rig.leading == 1)


def test_plots_and_options_of_a_replaced_certificate_are_removed(tmp_path):
    for name in (CERTIFICATE, PAGE, PLOT, REGION_PLOT, OPTIONS, "mine.png"):
        (tmp_path / name).write_text("{}")
    certify_clip_into("walk", tmp_path, DEFAULT_CRITERIA)
    assert {path.name for path in tmp_path.iterdir()} == {CERTIFICATE, PAGE, FLIGHTS_PLOT, "mine.png"}
