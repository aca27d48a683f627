"""A run whose force shakes says so; tremor, pushes and noise are no oscillation."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from experiments.cli import main
from experiments.results.oscillation import oscillation_summary


def recording(force, away=None, period=1e-3):
    n = len(force)
    ticks = {
        "t": period * np.arange(n), "force": force, "p": np.zeros((n, 3)) if away is None else away,
        "nearest": np.zeros((n, 3)),
    }  # fmt: skip
    return SimpleNamespace(groups={"ticks": ticks}, rates={"ticks": 1.0 / period})


T = np.arange(0.0, 6.0, 1e-3)
AXIS = np.array([0.6, 0.0, 0.8])


def test_a_loop_that_shakes_says_so_with_its_frequency_and_growth():
    grows = np.minimum(2.0, 1e-3 * np.exp(8.0 * T)) * np.sin(2.0 * np.pi * 120.0 * T)
    found = oscillation_summary(recording(np.outer(grows, AXIS), np.outer(1e-3 * grows, AXIS)))
    assert 0.6 < found.since < 1.2
    assert found.share > 0.8
    assert found.frequency == pytest.approx(120.0, rel=0.05)
    assert found.growth == pytest.approx(8.0, rel=0.3)
    assert "It oscillates" in found.lines()[0]


@pytest.mark.parametrize(
    "force",
    [
        np.outer(2.0 * np.sin(2.0 * np.pi * 10.0 * T), AXIS),  # tremor
        np.outer(np.where(T % 1.0 < 0.5, 3.0, 0.0), AXIS),  # pushes that come and go at once
        np.random.default_rng(1).normal(scale=0.05, size=(len(T), 3)),  # rounded encoders
        np.outer(4.0 * np.sin(2.0 * np.pi * 2.0 * T), AXIS),  # work
    ],
)
def test_tremor_pushes_and_noise_are_no_oscillation(force):
    found = oscillation_summary(recording(force))
    assert found.since is None
    assert found.lines() == []


@pytest.mark.slow
def test_a_run_beyond_its_critical_gain_says_that_it_oscillates(tmp_path):
    told = []
    for k in ("12000", "300"):
        run = ["run", "--stiffness", k, "--figure", "none", "--seconds", "2", "--out", str(tmp_path / k)]
        assert main(run) == 0
        told.append(json.loads((tmp_path / k / "summary.json").read_text()))
    assert "It oscillates" in told[0]["lines"][0]
    assert told[1]["oscillation"]["since"] is None
