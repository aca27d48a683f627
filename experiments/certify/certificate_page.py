"""Presentation of certificates: figures of stability boundary, region of attraction and flights, and the HTML page."""

from collections.abc import Mapping
from html import escape
from typing import Any, cast

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from controllers.certificates.loop.hand import HandImpedance
from controllers.certificates.loop.stability import CertifiedRiver, boundary
from controllers.certificates.report import Certificate, Verdict
from experiments.files.html_page import html_page
from experiments.flights.ballistics import ClipBallistics
from geometry.physics import GRAVITY

WORDS: dict[str, tuple[str, str]] = {
    # stability
    "radius": ("spectral radius of a period, no hand", ""),
    "radius_bound": ("spectral radius with its change to the next phase, worst hand", ""),
    "radius_cut": ("spectral radius where the limiter cuts the force, worst hand", ""),
    "critical_damping": ("critical damping b_d, no hand", "N s/m"),
    "delay_margin": ("delay margin, no hand", "s"),
    "multiplier": ("largest Floquet multiplier of a lap", ""),
    "walker_radius": ("spectral radius with the walker as state", ""),
    "governor_drag": ("drag of the governor", "N s/m"),
    "governor_certain": ("largest drag that the circle criterion allows", "N s/m"),
    "governor_radius": ("spectral radius while the governor acts, worst hand", ""),
    "executed_radius": ("largest spectral radius of the executed program at the sampled states", ""),
    "executed_force": ("largest force of the executed program there", "N"),
    # passivity
    "damping_needed": ("device damping required for passivity", "N s/m"),
    "damping_needed_unfiltered": ("the same without filter, KT/2 + B", "N s/m"),
    "frequency": ("its critical frequency", "rad/s"),
    # energy
    "lap_energy": ("energy given to a relaxed hand per lap", "J"),
    "lap_energy_bound": ("bound on the energy per lap, ideal law", "J"),
    "power_bound": ("bound on the power, ideal law", "W"),
    "passive_below": ("frequency below which a vibrating hand gains no more energy", "Hz"),
    "activity_30": ("power per squared speed of a hand that vibrates at up to 30 Hz", "N s/m"),
    "activity_100": ("the same up to 100 Hz", "N s/m"),
    "activity_300": ("the same up to 300 Hz", "N s/m"),
    "rounding_force": ("largest force from encoder rounding", "N"),
    "speed_bound": ("bound on the speed along the curve", "m/s"),
    "peak_gain": ("peak gain from a force to the distance", "m/N"),
    "force_gain": ("peak gain from a force to the river's", "N/N"),
    "own_force": ("force required by the lap itself", "N"),
    "push": ("push of the hand", "N"),
    "push_allowed": ("largest push with a bound", "N"),
    "distance_bound": ("bound on the distance from the curve", "m"),
    "force_bound": ("bound on the river's force", "N"),
    # region
    "distance": ("offset from which the hand returns", "m"),
    "speed": ("speed error from which it returns", "m/s"),
    "ball": ("distance within which it stays", "m"),
    "largest_distance": ("largest distance on the way", "m"),
    "largest_force": ("largest force on the way", "N"),
    "rate": ("decay rate of V", "1/s"),
    "remainder_rate": ("decay lost to neglected terms", "1/s"),
    "remainder_drift": ("neglected drift", "1/s"),
    "remainder_force": ("neglected force", "N"),
    "held_up": ("fraction of the edge where decay stops", ""),
    "level": ("level of V at the edge", ""),
    "ball_level": ("level of V of the ball", ""),
    "shift": ("shift of the level by the window", ""),
    "cells": ("cells that were checked", ""),
    "cell_slack": ("slack of a cell", ""),
    "cell_least": ("minimum of the matrix inequality", ""),
    "scale": ("scale of offset, speed and filtered speed", "m, m/s, m/s"),
    "masses": ("lightest and heaviest mass at the tip", "kg"),
    "alpha": ("α of V", ""),
    "beta": ("β of V", ""),
    # switching
    "score_bound": ("bound on a competing river's score", ""),
    "velocity_noise": ("velocity noise from the encoders", "m/s"),
    "hysteresis": ("hysteresis", "m/s"),
    "hysteresis_dwell": ("minimum dwell time by hysteresis", "s"),
    "least_mismatch": ("minimum velocity mismatch of a competing river", "m/s"),
    "rival_weight": ("largest weight of a competing river", ""),
    "common_rate": ("decay per period of the common Lyapunov function", ""),
    # counterexamples
    "phase": ("phase of the curve", "s"),
    "p": ("position of the stylus", "m"),
    "v": ("velocity of the stylus", "m/s"),
    "hand": ("hand on the stylus", ""),
    "state": ("state θ, θ̇, last θ, filtered θ̇", "rad, rad/s"),
    "growth_rate": ("growth of the mode", "1/s"),
    "time": ("time at which it happens", "s"),
    "simulated_time": ("the same in MuJoCo", "s"),
    "force": ("push of the hand", "N"),
    "push_start": ("start of the push", "s"),
    "push_duration": ("its duration", "s"),
    "kind": ("outcome", ""),
    "river": ("number of the river", ""),
    # clips
    "start": ("first frame", ""),
    "end": ("last frame", ""),
    "frame": ("critical frame", ""),
    "position": ("centre of mass at take-off", "m"),
    "velocity": ("its velocity", "m/s"),
    "momentum": ("angular momentum", "kg m²/s"),
    "com": ("centre of mass at the window's start", "m"),
    "acceleration": ("its mean acceleration", "m/s²"),
    "clips": ("clips", ""),
    "floor": ("median height of standing parts above the floor", "m"),
    "lowest": ("lowest point of the supported body, from there, 5 %", "m"),
    "highest": ("the same, 95 %", "m"),
    "skate": ("largest skate of a standing foot", "m"),
    "unheld": ("longest stretch without a foot at rest", "s"),
    "jump": ("largest acceleration of the centre of mass", "m/s²"),
}
"""Name and unit of each number, by its key."""


_COLOURS = {"certified": "#2e7d4f", "refuted": "#c2473b", "unknown": "#8a6d1f"}
_MAX_SHOWN_SIZE = 12  # largest array that the page shows
_RATE_RANGE = (0.25, 4.0)  # range of the figure of admissible rates


def stability_figure(river: CertifiedRiver, verdict: Verdict) -> Figure:
    """Stability boundary of the gains with the river's own gains, and the critical stiffness along the curve."""
    damping = np.geomspace(0.1 * max(river.b_d, 0.1), 100.0, 28)
    critical = boundary(river, damping)
    figure, (gains, along) = _two_panels()
    gains.fill_between(damping, 1.0, np.maximum(critical, 1.0), color="#dbe7f4", label="stable at every phase, no hand")
    gains.plot(damping, critical, color="#2f6db3")
    gains.plot(river.b_d, river.k_r, "o", color="#c2473b", label="this river")
    gains.set(xscale="log", yscale="log", xlabel="b_d [N s/m]", ylabel="k_r [N/m]", ylim=(10.0, None))
    _name(gains, "stability boundary", "lower center")
    phases = np.asarray(verdict.figures["phases"], dtype=np.float64)
    along.plot(phases, np.asarray(verdict.figures["critical_stiffness"], dtype=np.float64), color="#2f6db3")
    along.axhline(river.k_r, color="#c2473b", label="this river")
    along.set(yscale="log", xlabel="phase [s]", ylabel="critical k_r [N/m]")
    _name(along, "along the curve, worst hand")
    return figure


def region_figure(verdict: Verdict) -> Figure:
    """Region of attraction and the ball reached, over offset and speed error, for the lightest and heaviest hand."""
    figure, panels = _two_panels()
    edges = np.asarray(verdict.figures["ellipse"], dtype=np.float64)
    masses = np.asarray(verdict.figures["masses"], dtype=np.float64)
    for axes, (outer, inner), mass in zip(panels, edges, masses, strict=True):
        label = "region, firm hands" if "firm_hands" in verdict.figures else "region"
        axes.fill(1e3 * outer[:, 0], outer[:, 1], color="#dbe7f4", label=label)
        axes.plot(1e3 * outer[:, 0], outer[:, 1], color="#2f6db3")
        axes.fill(1e3 * inner[:, 0], inner[:, 1], color="#c2473b", alpha=0.5, label="ball reached")
        axes.set(xlabel="offset across the curve [mm]", ylabel="speed error [m/s]")
        _name(axes, f"{mass:.2f} kg at the tip", "upper right")
    return figure


def flights_figure(found: ClipBallistics) -> Figure:
    """Height of the centre of mass, with free fall between the ends of each flight, and admissible rates of a lap."""
    motion, lap = found.motion, len(found.bounds.low)
    figure, (height, rates) = _two_panels()
    times = np.arange(lap) / motion.fps
    height.plot(times, motion.com[:lap, 2], color="#566072", label="centre of mass")
    for number, flight in enumerate(found.flights):
        fit = flight.fit
        t = np.linspace(0.0, fit.duration, 50)
        height.axvspan(fit.time, fit.time + fit.duration, color=_COLOURS[flight.verdict], alpha=0.15, lw=0)
        fall = motion.com[fit.start, 2] + fit.take_off_speed * t - 0.5 * GRAVITY * t**2
        label = None if number else "free fall between its ends"
        height.plot(fit.time + t, fall, "--", color=_COLOURS[flight.verdict], label=label)
    height.set(xlabel="time [s]", ylabel="height [m]")
    _name(height, "flights")
    low, high = (np.clip(np.nan_to_num(rate, posinf=_RATE_RANGE[1]), *_RATE_RANGE) for rate in found.bounds[:2])
    rates.fill_between(
        times, low, np.maximum(low, high), color="#dbe7f4", label="in flight by gravity, else by friction", step="mid"
    )
    rates.axhline(1.0, color="#c2473b", label="as recorded")
    rates.set(yscale="log", xlabel="time [s]", ylabel="rate σ", ylim=_RATE_RANGE)
    rates.set_yticks([0.25, 0.5, 1.0, 2.0, 4.0], ["0.25", "0.5", "1", "2", "4"])
    rates.minorticks_off()
    _name(rates, "admissible rates")
    return figure


def _two_panels() -> tuple[Figure, Any]:
    figure = Figure(figsize=(8.0, 3.6), layout="constrained")
    return figure, figure.subplots(1, 2)


def _name(axes: Axes, title: str, legend: Any = "best") -> None:
    axes.set_title(title, loc="left")
    axes.legend(frameon=False, fontsize=8, loc=legend)


def certificate_page(certificate: Certificate, plots: Mapping[str, str]) -> str:
    """The HTML page of a certificate; `plots` maps picture files beside it to their captions."""
    parts = [f'<p class="note">inputs {escape(certificate.inputs)}</p>']
    for name, verdict in certificate.verdicts.items():
        margin = "" if verdict.margin is None else f" <small>margin {verdict.margin:.4g}</small>"
        parts.append(
            f"<h2>{escape(name)}: <span style='color:{_COLOURS[verdict.verdict]}'>{verdict.verdict}</span>{margin}</h2>"
            f"<p>{escape(verdict.reason)}</p><ul>{''.join(f'<li>{escape(a)}</li>' for a in verdict.assumptions)}</ul>"
            f"{_table(verdict.figures)}"
        )
        if verdict.counterexample:
            parts.append(f"<p>Counterexample:</p>{_table(verdict.counterexample)}")
    parts += [f"<img src='{escape(file)}' alt='{escape(shows)}'>" for file, shows in plots.items()]
    return html_page("Certificate", "\n".join(parts), "td { vertical-align: top; } small { color: #566072; }\n")


def _table(numbers: Mapping[str, object]) -> str:
    """HTML table of numbers with names and units; long arrays are left to certificate.json."""
    rows: list[str] = []
    for key, value in numbers.items():
        name, unit = WORDS.get(key, (key.replace("_", " "), ""))
        text = _value_text(value)
        if text:
            rows.append(f"<tr><td>{escape(name)}</td><td>{escape(text)} {escape(unit)}</td></tr>")
    return f"<table>{''.join(rows)}</table>" if rows else ""


def _value_text(value: object) -> str:
    """A number, a short array or a hand as text; empty for anything longer."""
    if isinstance(value, bool | str | int):
        return str(value)
    if isinstance(value, float | np.floating):
        return f"{float(value):.4g}" if np.isfinite(value) else "without bound"
    if isinstance(value, HandImpedance):
        return str(value)
    if isinstance(value, Mapping):
        entries = cast(Mapping[str, object], value)
        return ", ".join(f"{name}: {_value_text(item)}" for name, item in entries.items())
    if isinstance(value, np.ndarray | list | tuple):
        array = np.asarray(cast(npt.ArrayLike, value))
        if array.dtype.kind in "fiu" and 0 < array.size <= _MAX_SHOWN_SIZE:
            return ", ".join(f"{number:.4g}" for number in array.ravel().tolist())
    return ""
