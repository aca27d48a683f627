"""Certificates as JSON, and the hash of their inputs."""

import json
from dataclasses import dataclass, replace

import numpy as np
import pytest

from controllers.certificates.report import Certificate, CertificateError, Verdict, hash_of


@dataclass(frozen=True)
class Gains:
    k: float
    curve: np.ndarray


GAINS = Gains(300.0, np.linspace(0.0, 1.0, 7))
VERDICTS = {
    "stability": Verdict("certified", "the radius stays below 1", 0.03, ("no friction",), {}, {"radius": np.ones(3)}),
    "passivity": Verdict("unknown", "the damping is not known"),
    "ballistic": Verdict("refuted", "it falls too fast", -0.4, counterexample={"flight": 0, "g": np.float64(66.0)}),
}


def test_certificate_round_trips_through_json():
    text = json.dumps(Certificate(VERDICTS, hash_of(GAINS)).to_json(), allow_nan=False)
    again = Certificate.from_json(json.loads(text))
    again.check(GAINS)
    assert json.loads(text)["ballistic"]["verdict"] == "refuted"
    assert again.verdicts["stability"].margin == 0.03
    assert again.verdicts["stability"].assumptions == ("no friction",)
    assert again.verdicts["stability"].figures["radius"] == [1.0, 1.0, 1.0]
    assert again.verdicts["ballistic"].counterexample == {"flight": 0, "g": 66.0}
    assert json.dumps(again.to_json()) == text


def test_non_finite_figures_become_null_in_json():
    verdict = Verdict("certified", "no upper bound", figures={"bound": [1.0, np.inf]})
    assert Certificate({"a": verdict}, "0").to_json()["a"]["figures"] == {"bound": [1.0, None]}


@pytest.mark.parametrize(
    "changed",
    [
        replace(GAINS, k=np.nextafter(300.0, 301.0)),
        replace(GAINS, curve=np.nextafter(GAINS.curve, 2.0)),
        replace(GAINS, curve=GAINS.curve.reshape(1, 7)),
        {"k": 300.0, "curve": GAINS.curve},
    ],
)
def test_check_raises_for_any_changed_input(changed):
    with pytest.raises(CertificateError, match="certify again"):
        Certificate(VERDICTS, hash_of(GAINS)).check(changed)


@pytest.mark.parametrize(
    ("one", "other"),
    [(["ab", "c"], ["a", "bc"]), ([1], [1.0]), ([[1], [2]], [[1, 2]]), ({"a": 1, "b": 2}, {"a": 2, "b": 1}), (0, None)],
)
def test_different_inputs_have_different_hashes(one, other):
    assert hash_of(one) != hash_of(other)


def test_hash_ignores_mapping_order():
    assert hash_of({"a": 1, "b": 2}) == hash_of({"b": 2, "a": 1})


def test_hash_of_object_without_value_raises():
    with pytest.raises(CertificateError, match="cannot be hashed"):
        hash_of([object()])


@pytest.mark.parametrize("values", [None, [], {"stability": {}}, {"inputs": "0", "a": {"verdict": "maybe"}}, "text"])
def test_from_json_raises_for_malformed_certificates(values):
    with pytest.raises(CertificateError, match="not a certificate"):
        Certificate.from_json(values)


def test_counterexample_is_required_for_refuted_and_forbidden_otherwise():
    with pytest.raises(CertificateError, match="counterexample"):
        Verdict("refuted", "no reason given")
    with pytest.raises(CertificateError, match="counterexample"):
        Verdict("certified", "no reason given", counterexample={"p": [0.0]})
