"""Parsing of assertion explanations, and margins of compared numbers in units of their spread."""

import json
from pathlib import Path

import pytest

from tests.spread.margins import failures, margins
from tests.spread.plugin import comparisons


@pytest.mark.parametrize(
    ("explanation", "expected"),
    [
        ("0.25 < 0.4\n + where 0.25 = median([0.2, 0.25])", [(0.25, "<", 0.4)]),
        ("np.float64(7.5e-05) <= 0.01", [(7.5e-05, "<=", 0.01)]),
        ("-3 < np.float64(-2.5) < 1e+3", [(-3.0, "<", -2.5), (-2.5, "<", 1000.0)]),
        ("1.25 == 1.0 ± 0.5", [(0.25, "<=", 0.5)]),
        ("(0.06 <= 0.05) == (False in [True])", [(0.06, "<=", 0.05)]),
        ("all(<generator object at 0x7f3>)", []),
    ],
)
def test_comparisons_are_parsed_from_assertion_explanations(
    explanation: str, expected: list[tuple[float, str, float]]
) -> None:
    assert comparisons(explanation) == expected


def _line(test: str, value: float, relation: str, bound: float) -> dict[str, object]:
    compared = {"value": value, "relation": relation, "bound": bound}
    return {"test": f"t.py::{test}", "line": 1, "assertion": "…", "which": 0, **compared}


def test_margin_is_worst_slack_over_spread_and_constant_comparisons_are_omitted(tmp_path: Path) -> None:
    comparisons_of_run = {"a": [(0.1, "<", 0.4), (0.2, "<", 0.4)], "b": [(0.3, "<", 0.4), (0.1, "<", 0.4)]}
    for run, pairs in comparisons_of_run.items():
        lines = [_line("looped", *pair) for pair in pairs]
        lines += [_line("still", 3.0, ">", 1.0), _line("left", 0.0, "<", pairs[0][0])]
        (tmp_path / run).mkdir()
        (tmp_path / run / "gw0.jsonl").write_text("\n".join(map(json.dumps, lines)))
    looped, bound_left = margins([tmp_path / "a", tmp_path / "b"])
    if looped.test != "t.py::looped":
        looped, bound_left = bound_left, looped
    assert (looped.least, looped.most, looped.relation, looped.bound) == (0.2, 0.3, "<", 0.4)
    assert looped.slack == pytest.approx(0.1)
    assert looped.spreads == pytest.approx(1.0)
    assert (bound_left.least, bound_left.most, bound_left.relation, bound_left.bound) == (0.1, 0.3, ">", 0.0)
    assert bound_left.spreads == pytest.approx(0.5)


def test_failures_list_the_runs_in_which_a_test_failed(tmp_path: Path) -> None:
    for run in ("a", "b"):
        (tmp_path / run).mkdir()
        outcomes = [{"test": "t.py::one", "outcome": "failed"}, {"test": "t.py::two", "outcome": "passed"}]
        (tmp_path / run / "main.jsonl").write_text("\n".join(map(json.dumps, outcomes)))
    assert failures({"a": tmp_path / "a", "b": tmp_path / "b"}) == {"t.py::one": {"a", "b"}}
