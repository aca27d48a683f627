"""A pytest plugin that writes down what every comparison of two numbers had, and may begin runs a little elsewhere.

Loaded by `tests.spread` only. A line of JSON a comparison that passed: test, assertion, the number, the relation, its
bound; a line a test: what became of it.
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

FOLDER, MOVED, SEED = "HVF_SPREAD", "HVF_SPREAD_MOVED", "HVF_SPREAD_SEED"
"""Environment: where lines go; by how much [m, rad] starts are moved; what is added to the seeds of runs and people."""

_NUMBER = r"[-+]?(?:\d+\.?\d*(?:e[-+]?\d+)?|inf)"
_WORN = re.compile(r"np\.(?:float64|int64|float32)\(([^()]*)\)")
_COMPARED = re.compile(rf"(?=(?<![\w.+-])({_NUMBER}) (<=|<|>=|>) ({_NUMBER})(?![\w.]))")
_NEAR = re.compile(rf"(?<![\w.+-])({_NUMBER}) == ({_NUMBER}) ± ({_NUMBER})")
_DRAWN = (
    "experiments.setups.wiring",
    "experiments.studies.certified_trials",
    "experiments.studies.switching_trials",
    "experiments.studies.region_trials",
    "experiments.studies.stability_trials",
)


def comparisons(explained: str) -> list[tuple[float, str, float]]:
    """Numbers, relations and bounds in the first line of an assertion's explanation.

    A value near another, ``a == b ± c``, is ``|a - b| <= c``.
    """
    line = _WORN.sub(r"\1", explained.split("\n", 1)[0])
    near = [(abs(float(a) - float(b)), "<=", float(c)) for a, b, c in _NEAR.findall(line)]
    return near + [(float(a), relation, float(b)) for a, relation, b in _COMPARED.findall(line)]


_now: dict[str, Any] = {"added to seeds": 0, "test": ""}


def pytest_sessionstart() -> None:
    """Move starts, add to seeds, look at arrays that are compared."""
    _look_at_arrays()
    if MOVED in os.environ:
        _move(float(os.environ[MOVED]))
    if SEED in os.environ:
        _reseed()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """What is golden is of one seed."""
    _now["test"] = item.nodeid
    _now["added to seeds"] = 0 if item.nodeid.startswith("tests/golden/") else int(os.environ.get(SEED, "0"))


def pytest_assertion_pass(item: pytest.Item, lineno: int, orig: str, expl: str) -> None:
    """Write down what was compared."""
    for number, (value, relation, bound) in enumerate(comparisons(expl)):
        _write(test=item.nodeid, line=lineno, assertion=orig, which=number, value=value, relation=relation, bound=bound)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Write down what became of a test, once: not in the process that ran it for another."""
    if "PYTEST_XDIST_WORKER" not in os.environ and (report.when == "call" or report.outcome != "passed"):
        _write(test=report.nodeid, outcome=report.outcome, seconds=report.duration)


def _write(**line: Any) -> None:
    path = Path(os.environ[FOLDER]) / f"{os.environ.get('PYTEST_XDIST_WORKER', 'main')}.jsonl"
    with path.open("a", encoding="utf-8") as lines:
        lines.write(json.dumps(line) + "\n")


def _seen_as(module: Any, **instead: Any) -> types.SimpleNamespace:
    """A module with some of its members replaced, for who looks them up by the module's name."""
    return types.SimpleNamespace(**{**vars(module), **instead})


def _look_at_arrays() -> None:
    """Write down the worst difference of two arrays as a share of what `assert_allclose` lets them differ by."""
    compare = np.testing.assert_allclose

    def looked_at(actual: Any, desired: Any, rtol: float = 1e-7, atol: float = 0.0, **options: Any) -> None:
        compare(actual, desired, rtol, atol, **options)
        line, wanted = sys._getframe(1).f_lineno, np.asarray(desired, float)
        allowed = atol + rtol * np.abs(wanted)
        apart = np.abs(np.asarray(actual, float) - wanted)
        worst = float(np.nanmax(apart / np.where(allowed > 0.0, allowed, np.inf), initial=0.0))
        assertion = f"assert_allclose, rtol {rtol:g}, atol {atol:g}"
        _write(test=_now["test"], line=line, assertion=assertion, which=0, value=worst, relation="<=", bound=1.0)

    np.testing.assert_allclose = looked_at  # type: ignore[assignment]


def _move(by: float) -> None:
    """The hand of every run begins elsewhere, and so does a tracked figure."""
    import mujoco

    from experiments.setups import wiring
    from sim.body import tracking

    beginning = wiring.beginning

    def elsewhere(*arguments: Any) -> Any:
        begin = beginning(*arguments)
        return begin._replace(point=begin.point + by)

    def forward(model: Any, data: Any) -> None:
        data.qpos[0] += by
        mujoco.mj_forward(model, data)

    wiring.beginning = elsewhere  # type: ignore[attr-defined]
    tracking.mujoco = _seen_as(mujoco, mj_forward=forward)  # type: ignore[attr-defined]


def _reseed() -> None:
    import importlib

    from sim.users import participant

    drawn = np.random.default_rng

    def other(seed: Any = None) -> np.random.Generator:
        return drawn(seed + _now["added to seeds"] if isinstance(seed, int) else seed)

    for name in _DRAWN:
        importlib.import_module(name).np = _seen_as(np, random=_seen_as(np.random, default_rng=other))  # type: ignore[attr-defined]
    fresh = participant.fresh_chance
    participant.fresh_chance = lambda seed: fresh(seed + _now["added to seeds"])  # type: ignore[attr-defined]
