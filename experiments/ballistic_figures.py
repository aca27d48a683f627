"""Drawings of flights: a clip against free fall, and what the physical figure makes of it at many rates."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from controllers.certificates.ballistic import FlightJudgement
from controllers.certificates.flight_fit import GRAVITY, best_fall
from experiments.ballistics import ClipBallistics, fly

_COLORS = {"certified": "#2a7f4f", "refuted": "#c2473b", "unknown": "#b98a1d"}
_RATES = 13  # flown by the physical figure


def flights_figure(ballistics: ClipBallistics) -> Figure:
    """Height of the centre of mass with the nearest free fall of each flight, and every frame's admissible rates."""
    motion = ballistics.motion
    times = np.arange(len(ballistics.bounds.low)) / motion.fps
    drawing = Figure(figsize=(7.2, 4.8), layout="constrained")
    height, rate = drawing.subplots(2, 1, sharex=True)
    height.plot(times, motion.com[: len(times), 2], color="#566072", label="centre of mass")
    for flight in ballistics.flights:
        a, b = flight.fit.start, flight.fit.end
        _, (p, v) = best_fall(motion.com[a : b + 1], motion.fps, 1.0)
        t = np.linspace(0.0, flight.fit.duration, 40)
        color = _COLORS[flight.verdict]
        height.axvspan(a / motion.fps, b / motion.fps, color=color, alpha=0.15, lw=0)
        height.plot(a / motion.fps + t, p[2] + v[2] * t - GRAVITY / 2 * t**2, color=color, ls="--", label="free fall")
    height.set(ylabel="height [m]", title="flights: green certified, red refuted, yellow unknown")
    height.legend(*_once(height), frameon=False, fontsize=8)
    rate.fill_between(
        times, ballistics.bounds.low, np.minimum(ballistics.bounds.high, 3.0), color="#dbe7f4", step="mid"
    )
    rate.axhline(1.0, color="#566072", lw=0.8)
    rate.set(ylabel="admissible rate σ", xlabel="time [s]", ylim=(0.0, 3.0), xlim=(times[0], times[-1]))
    return drawing


def rates_figure(cases: Sequence[tuple[str, ClipBallistics]]) -> Figure:
    """How far the physical figure strays from the longest flight of each clip, over the rate at which it is played."""
    drawing = Figure(figsize=(3.6 * len(cases), 3.2), layout="constrained")
    for ax, (name, ballistics) in zip(drawing.subplots(1, len(cases), squeeze=False)[0], cases, strict=True):
        _draw_rates(ax, name, ballistics, max(ballistics.flights, key=lambda flight: flight.fit.duration))
    return drawing


def _draw_rates(ax: Axes, name: str, ballistics: ClipBallistics, flight: FlightJudgement) -> None:
    low, high = flight.done or flight.seen
    high = min(high, 2.0)
    rates = np.geomspace(0.8 * low, 1.25 * high, _RATES)
    trials = [fly(ballistics.clip, flight.fit, float(rate)) for rate in rates]
    com = ballistics.motion.com[flight.fit.start : flight.fit.end + 1]
    many = np.geomspace(rates[0], rates[-1], 100)
    predicted = [100 * best_fall(com, ballistics.motion.fps, float(rate))[0] for rate in many]
    ax.plot(many, predicted, color="#2f6db3", lw=1.2, label="certificate")
    ax.plot(rates, [100 * trial.distance for trial in trials], "o", ms=4, color="#c2473b", label="physical figure")
    ax.axhline(5.0, color="#566072", lw=0.8, ls="--")
    if flight.done is not None:
        ax.axvspan(low, high, color="#dbe7f4", lw=0, label="can be done")
    ax.axvspan(*flight.seen, color="#e4f1e6", lw=0, label="seen as natural")
    ax.set(title=name, xlabel="rate σ", xlim=(rates[0], rates[-1]))
    ax.set_ylabel("distance of centres of mass [cm]")
    ax.set_ylim(bottom=0)
    ax.legend(frameon=False, fontsize=7)


def _once(ax: Axes) -> tuple[list[object], list[str]]:
    handles, labels = ax.get_legend_handles_labels()
    named = dict(zip(labels, handles, strict=True))
    return list(named.values()), list(named)
