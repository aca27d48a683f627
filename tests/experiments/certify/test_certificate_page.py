"""The page of a certificate: words and units."""

import pytest

from controllers.certificates.loop.hand import NO_HANDS
from experiments.certify.certificate_page import certificate_page
from experiments.certify.certify import certify_into
from experiments.config.options import run_config


@pytest.mark.slow
def test_page_has_words_and_units_and_no_arrays(tmp_path):
    certificate = certify_into(run_config(), tmp_path, hands=NO_HANDS)
    page = (tmp_path / "certificate.html").read_text()
    assert "array(" not in page
    assert "critical damping b_d, no hand</td><td>" in page
    assert "N s/m" in page
    assert "HandImpedance(" not in certificate_page(certificate, {}).split("Counterexample")[1]
