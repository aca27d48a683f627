"""`certify` writes what it finds, finds it again by its hash, and notices every change."""

import json
import time
from dataclasses import replace

import pytest

from controllers.certificates.report import Certificate, CertificateError
from controllers.certificates.stability import HandRange
from controllers.errors import ParameterError
from experiments.certify import (
    CERTIFICATE,
    PAGE,
    PLOT,
    certificate_inputs,
    certified_river,
    certify_into,
    read_certificate,
)
from experiments.config import RunConfig

HANDS = HandRange((0.1, 0.1), (2.0, 2.0), (0.0, 0.0))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("certificate")
    certify_into(RunConfig(), out, hands=HANDS)
    return out


def test_the_demos_river_is_certified_and_told(folder):
    held = json.loads((folder / CERTIFICATE).read_text())
    assert held["stability"]["verdict"] == "certified"
    assert held["energy"]["verdict"] == "certified"
    assert held["passivity"]["verdict"] == "refuted"
    page = (folder / PAGE).read_text()
    assert "stability: " in page
    assert "<script" not in page
    assert (folder / PLOT).read_bytes().startswith(b"\x89PNG")


def test_a_certificate_of_the_same_inputs_is_not_made_again(folder):
    before, begin = (folder / CERTIFICATE).stat().st_mtime_ns, time.perf_counter()
    again = certify_into(RunConfig(seconds=3.0, seed=9), folder, hands=HANDS)
    assert time.perf_counter() - begin < 1.0
    assert (folder / CERTIFICATE).stat().st_mtime_ns == before
    assert again.verdicts["stability"].verdict == "certified"


@pytest.mark.parametrize(
    "change",
    [{"stiffness": 301.0}, {"damping": 4.1}, {"radius": 0.048}, {"lap": 4.1}, {"cutoff": 149.0}, {"tube": 0.2}],
)
def test_a_certificate_is_of_one_river_only(folder, change):
    certificate = Certificate.from_json(json.loads((folder / CERTIFICATE).read_text()))
    certificate.check(certificate_inputs(certified_river(RunConfig()), HANDS, 1.0))
    with pytest.raises(CertificateError, match="certify again"):
        certificate.check(certificate_inputs(certified_river(replace(RunConfig(), **change)), HANDS, 1.0))
    with pytest.raises(CertificateError, match="certify again"):
        certificate.check(certificate_inputs(certified_river(RunConfig(), delay=1e-4), HANDS, 1.0))
    with pytest.raises(CertificateError, match="certify again"):
        certificate.check(certificate_inputs(certified_river(RunConfig()), HandRange(), 1.0))


def test_the_bunny_is_certified_and_what_is_not_known_is_said():
    point = certified_river(RunConfig(mode="bunny"))
    along = certified_river(RunConfig(mode="bunny", bunny_attraction="along"))
    assert (point.law.slides, along.law.slides) == (False, True)
    with pytest.raises(ParameterError, match="'rivers'"):
        certified_river(RunConfig(mode="rivers"))


@pytest.mark.parametrize("text", ['{"inputs": "0"}', "[1, 2", "\x00", "[" * 100_000])
def test_what_is_no_certificate_is_refused(tmp_path, text):
    (tmp_path / CERTIFICATE).write_text(text)
    if text.startswith("{"):
        assert read_certificate(tmp_path / CERTIFICATE).verdicts == {}
    else:
        with pytest.raises(CertificateError, match=CERTIFICATE):
            read_certificate(tmp_path / CERTIFICATE)


def test_a_held_file_that_is_no_certificate_is_replaced(folder, tmp_path):
    (tmp_path / CERTIFICATE).write_text("not json")
    (tmp_path / PAGE).write_text("")
    assert certify_into(RunConfig(), tmp_path, hands=HANDS).verdicts["stability"].verdict == "certified"
