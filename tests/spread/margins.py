"""How far numbers stay from the bounds that tests set them, over several runs of the tests."""

import json
from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

_STILL = 1e-12  # of the larger side: what differs by less has been rounded, no more


class Margin(NamedTuple):
    """One comparison over several runs of the tests.

    Attributes
    ----------
    test, assertion : str
        Where it stands.
    least, most : float
        Of what is compared: the side that moves.
    relation, bound : str, float
        What it was compared with, in the run where it came nearest.
    slack : float
        How far from failing it stayed in the worst of the runs.
    spread : float
        How far its slack moved from run to run.
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
        """Slack in the worst run, in spreads."""
        return self.slack / self.spread


class _Compared(NamedTuple):
    slack: float
    value: float
    relation: str
    bound: float


_MIRRORED = {"<": ">", "<=": ">=", ">": "<", ">=": "<="}


def margins(runs: Iterable[Path]) -> list[Margin]:
    """Comparisons whose numbers moved between runs of the tests, the nearest to their bounds first.

    Parameters
    ----------
    runs : iterable of Path
        Folders with the lines that `tests.spread.plugin` wrote.
    """
    by_run = [_nearest(_lines(folder)) for folder in runs]
    found = []
    for key in sorted(set.intersection(*(set(run) for run in by_run))):
        seen = [run[key] for run in by_run]
        slacks = [one.slack for one in seen]
        spread = max(slacks) - min(slacks)
        if spread <= _STILL * max(abs(seen[0].value), abs(seen[0].bound)):
            continue
        nearest = min(seen)
        if _range([one.value for one in seen]) < _range(
            [one.bound for one in seen]
        ):  # a bound on the left, as in 0 < x
            seen = [_Compared(one.slack, one.bound, _MIRRORED[one.relation], one.value) for one in seen]
            nearest = min(seen)
        values = [one.value for one in seen]
        test, assertion, _, _ = key
        found.append(
            Margin(test, assertion, min(values), max(values), nearest.relation, nearest.bound, min(slacks), spread)
        )
    return sorted(found, key=lambda margin: margin.spreads)


def failures(runs: Mapping[str, Path]) -> dict[str, set[str]]:
    """Tests that failed, and in which runs."""
    found: dict[str, set[str]] = defaultdict(set)
    for name, folder in runs.items():
        for line in _lines(folder):
            if line.get("outcome") == "failed":
                found[str(line["test"])].add(name)
    return dict(found)


def _lines(folder: Path) -> list[dict[str, object]]:
    return [json.loads(line) for path in sorted(folder.glob("*.jsonl")) for line in path.read_text().splitlines()]


def _nearest(lines: list[dict[str, object]]) -> dict[tuple[str, str, int, int], _Compared]:
    """Of each comparison of a run that was made more than once, as in a loop, the one that was nearest to failing."""
    found: dict[tuple[str, str, int, int], _Compared] = {}
    for line in lines:
        if "assertion" not in line:
            continue
        value, bound, relation = float(str(line["value"])), float(str(line["bound"])), str(line["relation"])
        key = (str(line["test"]), str(line["assertion"]), int(str(line["line"])), int(str(line["which"])))
        # Also of one that is part of a larger expression, and may be false: how near it was to being otherwise.
        compared = _Compared(abs(bound - value), value, relation, bound)
        found[key] = min(found.get(key, compared), compared)
    return found


def _range(values: list[float]) -> float:
    return max(values) - min(values)
