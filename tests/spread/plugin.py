"""A pytest plugin that records every comparison of two numbers and may offset the starts and seeds of runs.

Loaded by `tests.spread` only. It writes one line of JSON per comparison that passed (test, assertion, number,
relation, bound) and one line per test (outcome).
"""

import json
import os
import re
import sys
import types
from pathlib import Path
from typing import Any

import numpy as np
import pytest

FOLDER, START_OFFSET, SEED_OFFSET = "HVF_SPREAD", "HVF_SPREAD_MOVED", "HVF_SPREAD_SEED"
"""Environment variables: output folder; offset of starts [m, rad]; offset of the seeds of runs and participants."""

_NUMBER = r"[-+]?(?:\d+\.?\d*(?:e[-+]?\d+)?|inf)"
_NUMPY_SCALAR = re.compile(r"np\.(?:float64|int64|float32)\(([^()]*)\)")
_COMPARISON = re.compile(rf"(?=(?<![\w.+-])({_NUMBER}) (<=|<|>=|>) ({_NUMBER})(?![\w.]))")
_APPROX = re.compile(rf"(?<![\w.+-])({_NUMBER}) == ({_NUMBER}) ± ({_NUMBER})")
_SEEDED_MODULES = (
    "experiments.setups.wiring",
    "experiments.studies.certified_trials",
    "experiments.studies.switching_trials",
    "experiments.studies.region_trials",
    "experiments.studies.stability_trials",
)


def comparisons(explanation: str) -> list[tuple[float, str, float]]:
    """Numbers, relations and bounds in the first line of an assertion's explanation.

    A value near another, ``a == b ± c``, is ``|a - b| <= c``.
    """
    line = _NUMPY_SCALAR.sub(r"\1", explanation.split("\n", 1)[0])
    approximate = [(abs(float(a) - float(b)), "<=", float(c)) for a, b, c in _APPROX.findall(line)]
    return approximate + [(float(a), relation, float(b)) for a, relation, b in _COMPARISON.findall(line)]


_current: dict[str, Any] = {"added to seeds": 0, "test": ""}


def pytest_sessionstart() -> None:
    """Record comparisons of arrays; offset starts and seeds where the environment asks for it."""
    _record_array_comparisons()
    if START_OFFSET in os.environ:
        _move_starts(float(os.environ[START_OFFSET]))
    if SEED_OFFSET in os.environ:
        _offset_seeds()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Remember the test, and offset no seed in golden tests, whose files are of one seed."""
    _current["test"] = item.nodeid
    _current["added to seeds"] = 0 if item.nodeid.startswith("tests/golden/") else int(os.environ.get(SEED_OFFSET, "0"))


def pytest_assertion_pass(item: pytest.Item, lineno: int, orig: str, expl: str) -> None:
    """Record the comparisons of an assertion that passed."""
    for number, (value, relation, bound) in enumerate(comparisons(expl)):
        _record(
            test=item.nodeid, line=lineno, assertion=orig, which=number, value=value, relation=relation, bound=bound
        )


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Record the outcome of a test once: in the controlling process, not in an xdist worker."""
    if "PYTEST_XDIST_WORKER" not in os.environ and (report.when == "call" or report.outcome != "passed"):
        _record(test=report.nodeid, outcome=report.outcome, seconds=report.duration)


def _record(**line: Any) -> None:
    path = Path(os.environ[FOLDER]) / f"{os.environ.get('PYTEST_XDIST_WORKER', 'main')}.jsonl"
    with path.open("a", encoding="utf-8") as lines:
        lines.write(json.dumps(line) + "\n")


def _replaced(module: Any, **members: Any) -> types.SimpleNamespace:
    """A namespace like a module, with some members replaced."""
    return types.SimpleNamespace(**{**vars(module), **members})


def _record_array_comparisons() -> None:
    """Record the largest difference of two arrays as a share of the tolerance of `assert_allclose`."""
    compare = np.testing.assert_allclose

    def compare_and_record(actual: Any, desired: Any, rtol: float = 1e-7, atol: float = 0.0, **options: Any) -> None:
        compare(actual, desired, rtol, atol, **options)
        line, expected = sys._getframe(1).f_lineno, np.asarray(desired, float)
        allowed = atol + rtol * np.abs(expected)
        difference = np.abs(np.asarray(actual, float) - expected)
        worst = float(np.nanmax(difference / np.where(allowed > 0.0, allowed, np.inf), initial=0.0))
        assertion = f"assert_allclose, rtol {rtol:g}, atol {atol:g}"
        _record(test=_current["test"], line=line, assertion=assertion, which=0, value=worst, relation="<=", bound=1.0)

    np.testing.assert_allclose = compare_and_record  # type: ignore[assignment]


def _move_starts(offset: float) -> None:
    """Offset the start of the hand in every run and the start of a tracked figure."""
    import mujoco

    from experiments.setups import wiring
    from sim.body import tracking

    beginning = wiring.beginning

    def moved_beginning(*arguments: Any) -> Any:
        start = beginning(*arguments)
        return start._replace(point=start.point + offset)

    def forward(model: Any, data: Any) -> None:
        data.qpos[0] += offset
        mujoco.mj_forward(model, data)

    wiring.beginning = moved_beginning  # type: ignore[attr-defined]
    tracking.mujoco = _replaced(mujoco, mj_forward=forward)  # type: ignore[attr-defined]


def _offset_seeds() -> None:
    import importlib

    from sim.users import participant

    default_rng = np.random.default_rng

    def offset_rng(seed: Any = None) -> np.random.Generator:
        return default_rng(seed + _current["added to seeds"] if isinstance(seed, int) else seed)

    for name in _SEEDED_MODULES:
        importlib.import_module(name).np = _replaced(np, random=_replaced(np.random, default_rng=offset_rng))  # type: ignore[attr-defined]
    initial_rng = participant.initial_rng
    participant.initial_rng = lambda seed: initial_rng(seed + _current["added to seeds"])  # type: ignore[attr-defined]
