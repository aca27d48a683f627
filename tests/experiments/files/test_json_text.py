"""What is printed for other programs is JSON, whatever was measured."""

import json

import numpy as np
import pytest

from experiments.cli import main
from experiments.files.json_text import json_text


def strictly(text: str) -> object:
    """The value, by a reader that takes nothing that JSON has not."""

    def refuse(constant: str) -> None:
        raise ValueError(constant)

    return json.loads(text, parse_constant=refuse)


def test_a_number_that_is_not_finite_is_null_wherever_it_is() -> None:
    value = {"a": np.inf, "b": [1.5, (float("nan"), "Infinity")], "c": {"d": np.float64(-np.inf), "e": 2, "f": None}}
    assert strictly(json_text(value)) == {
        "a": None,
        "b": [1.5, [None, "Infinity"]],
        "c": {"d": None, "e": 2, "f": None},
    }


@pytest.mark.slow
def test_the_report_of_a_map_is_json_also_where_it_is_singular(tmp_path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["lift", "walk", "--out", str(tmp_path / "map.npz"), "--json"]) == 0
    report = strictly(capsys.readouterr().out)
    assert isinstance(report, dict)
    assert report["quality"]["conditioning"][1] is None
