"""Detection of oscillating forces; tremor, pushes and noise do not count."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from experiments.cli import main
from experiments.results.measures.oscillation import oscillation_summary


def recording(force, away=None, period=1e-3):
    n = len(force)
    ticks = {
        "t": period * np.arange(n), "force": force, "p": np.zeros((n, 3)) if away is None else away,
        "nearest": np.zeros((n, 3)),
    }  # fmt: skip
    return SimpleNamespace(groups={"ticks": ticks}, rates={"ticks": 1.0 / period})


T = np.arange(0.0, 6.0, 1e-3)
AXIS = np.array([0.6, 0.0, 0.8])


def test_oscillating_loop_is_reported_with_frequency_and_growth():
    grows = np.minimum(2.0, 1e-3 * np.exp(8.0 * T)) * np.sin(2.0 * np.pi * 120.0 * T)
    found = oscillation_summary(recording(np.outer(grows, AXIS), np.outer(1e-3 * grows, AXIS)))
    assert 0.6 < found.since < 1.2
    assert found.share > 0.8
    assert found.frequency == pytest.approx(120.0, rel=0.05)
    assert found.growth == pytest.approx(8.0, rel=0.3)
    assert "It oscillates" in found.lines()[0]
    assert f"the force by up to {found.force_max:.1f} N, the stylus by {found.motion_rms_mm:.2f} mm" in found.lines()[0]


@pytest.mark.parametrize(
    "force",
    [
        np.outer(2.0 * np.sin(2.0 * np.pi * 10.0 * T), AXIS),  # tremor
        np.outer(np.where(T % 1.0 < 0.5, 3.0, 0.0), AXIS),  # pushes that come and go at once
        np.random.default_rng(1).normal(scale=0.05, size=(len(T), 3)),  # rounded encoders
        np.outer(4.0 * np.sin(2.0 * np.pi * 2.0 * T), AXIS),  # slow motion of the hand
    ],
)
def test_tremor_pushes_and_noise_are_not_oscillation(force):
    found = oscillation_summary(recording(force))
    assert found.since is None
    assert found.lines() == []


def test_force_from_encoder_rounding_is_not_oscillation():
    """A stylus at rest whose encoder flickers by one count: the damper turns it into force, nothing moves."""
    step = 1.2e-4 * 0.2  # [m] of an encoder's count at the tip
    reading = step * (np.random.default_rng(5).uniform(size=(len(T), 3)) - 0.5)
    force = 0.6 * np.random.default_rng(6).choice([-1.0, 1.0], size=len(T))
    summaries = {}
    for name, amplitude in (("rounded", 0.0), ("moving", 2.0 * step)):
        moved = amplitude * np.outer(np.sin(2.0 * np.pi * 120.0 * T), AXIS)
        summaries[name] = oscillation_summary(recording(np.outer(force, AXIS), reading + moved))
    assert summaries["rounded"].since == summaries["moving"].since < 0.2
    assert [summaries[name].oscillates for name in summaries] == [False, True]
    assert summaries["rounded"].motion_over_rounding == pytest.approx(1.0, abs=0.15)
    assert "Rounded encoders are felt" in summaries["rounded"].lines()[0]
    assert "oscillates" not in summaries["rounded"].lines()[0]


@pytest.mark.slow
@pytest.mark.usefixtures("without_page")
@pytest.mark.parametrize(
    ("gains", "expected"),  # 8217 N/m and 61 N s/m are critical
    [
        (("--stiffness", "12000"), "It oscillates"),
        (("--stiffness", "12000", "--user", "push"), "It oscillates"),
        (("--stiffness", "6000", "--user", "push"), None),
        (("--damping", "120"), "It oscillates"),
        (("--damping", "30", "--user", "push"), "Rounded encoders are felt"),
        (("--mode", "rivers", "--map", "rivers", "--user", "push"), None),
    ],
)
def test_run_beyond_critical_gain_is_reported_to_oscillate(gains, expected, tmp_path):
    assert main(["run", *gains, "--figure", "none", "--seconds", "6", "--out", str(tmp_path / "run")]) == 0
    lines = " ".join(json.loads((tmp_path / "run" / "summary.json").read_text())["lines"])
    reported = [words for words in ("It oscillates", "Rounded encoders are felt") if words in lines]
    assert reported == ([] if expected is None else [expected])
