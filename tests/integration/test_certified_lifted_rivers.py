"""`hvf certify --map FILE.npz --mode rivers`: a verdict on every river of a lifted map, and on their switching."""

import json

import pytest

from experiments.certify.certify import CERTIFICATE
from experiments.cli import main


@pytest.mark.slow
def test_rivers_of_lifted_map_are_certified_with_their_switching(tmp_path, capsys):
    assert main(["lift", "walk", "run", "--out", str(tmp_path / "map.npz")]) == 0
    flags = ["--map", str(tmp_path / "map.npz"), "--mode", "rivers", "--no-hand", "--out", str(tmp_path)]
    assert main(["certify", *flags]) == 0
    certificate = json.loads((tmp_path / CERTIFICATE).read_text())
    assert certificate["stability"]["verdict"] == certificate["stability_run"]["verdict"] == "certified"
    assert {"energy", "region", "switching", "ballistic", "turns"} < set(certificate)
    switching = certificate["switching"]
    assert switching["verdict"] in ("certified", "refuted", "unknown")
    # The counterexample is a hand that the river loses after the start.
    assert (switching["verdict"] == "refuted") == bool(switching["counterexample"])
    assert switching["counterexample"].get("time", 1.0) > 0.0
    capsys.readouterr()
    assert main(["certify", "--verify", str(tmp_path / CERTIFICATE), *flags[:-2]]) == 0
