"""`hvf certify`: certificates on disk are neither replaced unasked nor verified for other inputs."""

from pathlib import Path

import pytest

from experiments.cli import main
from tests.experiments.refused_command import refused


def test_certificate_of_other_inputs_is_replaced_only_with_overwrite(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["certify", "--clip", "walk", "--out", "here"]) == 0
    before = Path("here/certificate.json").read_bytes()
    stderr = refused(["certify", "--clip", "walk", "--friction", "0.5", "--out", "here"], capsys)
    assert stderr == "hvf: here: holds a certificate of something else; choose another --out, or --overwrite it\n"
    assert Path("here/certificate.json").read_bytes() == before
    assert main(["certify", "--clip", "walk", "--friction", "0.5", "--out", "here", "--overwrite"]) == 0
    assert Path("here/certificate.json").read_bytes() != before


def test_clip_certificate_is_verified_with_its_stored_options(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["certify", "--clip", "walk", "--friction", "0.5", "--out", "here"]) == 0
    assert main(["certify", "--verify", "here/certificate.json"]) == 0
    assert "valid, nothing that it covers has changed" in capsys.readouterr().out
    assert main(["certify", "--clip", "walk", "--verify", "here/certificate.json"]) == 1
    assert "changed: judging" in capsys.readouterr().err


@pytest.mark.slow
def test_field_certificate_is_verified_with_its_stored_gains(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["certify", "--stiffness", "500", "--no-hand", "--out", "field"]) == 0
    assert main(["certify", "--verify", "field/certificate.json"]) == 0
    assert main(["certify", "--stiffness", "400", "--no-hand", "--verify", "field/certificate.json"]) == 1
    assert "changed: gains" in capsys.readouterr().err
