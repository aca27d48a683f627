"""The measure of the stylus' path."""

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from experiments.results.measures.run_measures import PathMeasure

Numbers = npt.NDArray[Any]


class PathRecording:
    """The arrays of a recording that `PathMeasure` reads."""

    def __init__(self, clip_seconds: float):
        self.arrays = {"curve_span": np.array([0.0, 4.0]), "curve_closed": 0.0, "clip_seconds": clip_seconds}
        self.texts: dict[str, str] = {}
        self.rates = {"ticks": 1000.0}


def ticks_on_curve(t: Numbers, phase: Numbers, p: Numbers) -> dict[str, Any]:
    """Ticks of a hand on its curve that nobody pushes, in a run without rivers."""
    return {
        "t": t, "phase": phase, "p": p, "nearest": p, "distance": 0.0 * t, "user": 0.0 * p, "river": -np.ones(len(t)),
    }  # fmt: skip


@pytest.mark.parametrize("block", [100, 5000])
def test_stylus_at_end_of_open_curve_is_reported_as_stopped(block: int) -> None:
    t = np.arange(5000) * 1e-3
    phase = np.minimum(2.0 * t, 4.0)  # twice its own pace, and at its end at 2 s
    jitter = 2e-4 * np.sin(300.0 * t)
    p = np.stack([0.01 * phase + jitter, 0.0 * t, 0.0 * t], axis=1)
    rows = ticks_on_curve(t, phase, p)
    measure = PathMeasure(PathRecording(4.0))  # pyright: ignore[reportArgumentType]
    for first in range(0, len(t), block):
        measure.add({name: values[first : first + block] for name, values in rows.items()})
    path = measure.summary()
    assert path.stopped_at == pytest.approx(1.95, abs=0.1)
    assert path.pace == pytest.approx(2.0, rel=0.05)
    assert "stood still from" in (path.line(True) or "")
    assert "played at 2.0" in (path.line(True) or "")
    assert "played at" not in (path.line(False) or "")
    several = PathRecording(4.0)
    several.arrays["clip_laps"] = np.array([4.0, 2.0, 6.0])
    measure = PathMeasure(several)  # pyright: ignore[reportArgumentType]
    measure.add(rows)
    assert measure.summary().pace == path.pace
    assert "The clips were played at 1.0" in (measure.summary().line(True) or "")
    assert " to 3.0" in (measure.summary().line(True) or "")
    going = PathMeasure(PathRecording(np.nan))  # pyright: ignore[reportArgumentType]
    going.add({name: values[:1900] for name, values in rows.items()})
    assert going.summary().line(True) is None


@pytest.mark.parametrize(("share", "said"), [(0.1, False), (0.4, True)])
@pytest.mark.parametrize("block", [77, 5000])
def test_uneven_pace_of_the_hand_is_said(share: float, said: bool, block: int) -> None:
    t = np.arange(9000) * 1e-3
    phase = t + share / (2.0 * np.pi) * np.sin(2.0 * np.pi * t)  # a pace of 1 + share cos 2πt
    p = np.stack([0.01 * phase, 0.0 * t, 0.0 * t], axis=1)
    rows = ticks_on_curve(t, phase, p)
    measure = PathMeasure(PathRecording(4.0))  # pyright: ignore[reportArgumentType]
    for first in range(0, len(t), block):
        measure.add({name: values[first : first + block] for name, values in rows.items()})
    path = measure.summary()
    assert path.pace_spread == pytest.approx((1.0 - share, 1.0 + share), abs=0.05)
    assert ("the hand was below" in (path.line(True) or "")) == said
