"""Margins between compared numbers and their bounds over several runs of the tests."""

import json
from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

_ROUNDING = 1e-12  # share of the larger side: smaller differences are rounding


class Margin(NamedTuple):
    """One comparison over several runs of the tests.

    Attributes
    ----------
    test, assertion : str
        The test and the source of the assertion.
    least, most : float
        Smallest and largest value of the side that varies.
    relation, bound : str, float
        Relation and bound in the run with the smallest slack.
    slack : float
        Distance from failure in the worst run.
    spread : float
        Range of the slack over the runs.
    """

    test: str
    assertion: str
    least: float
    most: float
    relation: str
    bound: float
    slack: float
    spread: float

    @property
    def spreads(self) -> float:
        """Slack in the worst run in units of the spread."""
        return self.slack / self.spread


class _Comparison(NamedTuple):
    slack: float
    value: float
    relation: str
    bound: float


_MIRRORED = {"<": ">", "<=": ">=", ">": "<", ">=": "<="}


def margins(runs: Iterable[Path]) -> list[Margin]:
    """Comparisons whose numbers varied between runs of the tests, those with the smallest margin first.

    Parameters
    ----------
    runs : iterable of Path
        Folders with the JSON lines that `tests.spread.plugin` wrote.
    """
    by_run = [_nearest(_lines(folder)) for folder in runs]
    result = []
    for key in sorted(set.intersection(*(set(run) for run in by_run))):
        group = [run[key] for run in by_run]
        slacks = [comparison.slack for comparison in group]
        spread = max(slacks) - min(slacks)
        if spread <= _ROUNDING * max(abs(group[0].value), abs(group[0].bound)):
            continue
        nearest = min(group)
        if _range([comparison.value for comparison in group]) < _range(
            [comparison.bound for comparison in group]
        ):  # a bound on the left, as in 0 < x
            group = [
                _Comparison(comparison.slack, comparison.bound, _MIRRORED[comparison.relation], comparison.value)
                for comparison in group
            ]
            nearest = min(group)
        values = [comparison.value for comparison in group]
        test, assertion, _, _ = key
        result.append(
            Margin(test, assertion, min(values), max(values), nearest.relation, nearest.bound, min(slacks), spread)
        )
    return sorted(result, key=lambda margin: margin.spreads)


def failures(runs: Mapping[str, Path]) -> dict[str, set[str]]:
    """Tests that failed, each with the names of the runs in which it failed."""
    result: dict[str, set[str]] = defaultdict(set)
    for name, folder in runs.items():
        for line in _lines(folder):
            if line.get("outcome") == "failed":
                result[str(line["test"])].add(name)
    return dict(result)


def _lines(folder: Path) -> list[dict[str, object]]:
    return [json.loads(line) for path in sorted(folder.glob("*.jsonl")) for line in path.read_text().splitlines()]


def _nearest(lines: list[dict[str, object]]) -> dict[tuple[str, str, int, int], _Comparison]:
    """The evaluation with the smallest slack of each comparison of a run, which a loop may evaluate many times."""
    result: dict[tuple[str, str, int, int], _Comparison] = {}
    for line in lines:
        if "assertion" not in line:
            continue
        value, bound, relation = float(str(line["value"])), float(str(line["bound"])), str(line["relation"])
        key = (str(line["test"]), str(line["assertion"]), int(str(line["line"])), int(str(line["which"])))
        # A comparison within a larger expression may be false: its slack is the distance from changing its value.
        comparison = _Comparison(abs(bound - value), value, relation, bound)
        result[key] = min(result.get(key, comparison), comparison)
    return result


def _range(values: list[float]) -> float:
    return max(values) - min(values)
