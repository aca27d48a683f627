"""The physical figure on its own, following clips: how well, and with how much help."""

import time
from dataclasses import asdict

from rich.console import Console

from experiments.compiling import compile_once
from experiments.files.json_text import json_text
from experiments.setups.clips import load_clips
from models.mocap.library import embedded_names
from sim.body.figure_state import FigureGains
from sim.body.tracking import TrackingConfig, TrackingReport, track
from sim.compilation.units import Unit


def track_clips(names: tuple[str, ...], seconds: float, as_json: bool, bounds: tuple[float, float]) -> None:
    """Track clips and print a report of each.

    Parameters
    ----------
    names : tuple of str
        Embedded clips or files; all embedded clips if there is none.
    seconds : float
        Simulated time for each [s].
    as_json : bool
        Print one JSON object, clip by clip, instead of a line each.
    bounds : (float, float)
        Of the residual's force and moment (see `sim.body.figure_state.FigureGains`).

    Raises
    ------
    ModelError, SimError
        If a clip cannot be read or the time is not positive.
    """
    console = Console(stderr=True)
    names = names or embedded_names()
    clips, remarks = load_clips(names)
    for remark in remarks:
        console.print(remark, highlight=False)

    def ready(units: tuple[Unit, ...]) -> None:
        compile_once(console, units)

    config = TrackingConfig(gains=FigureGains(force_bound=bounds[0], moment_bound=bounds[1]))
    reports: dict[str, TrackingReport] = {}
    began = time.perf_counter()
    for k, (name, clip) in enumerate(zip(names, clips, strict=True)):
        reports[name] = track(clip, seconds, config, ready)
        rest = (len(names) - k - 1) * (time.perf_counter() - began) / (k + 1)
        if rest > 0.0:
            console.print(f"{k + 1} of {len(names)} clips tracked, about {rest:.0f} s left", highlight=False)
    if as_json:
        print(json_text({name: asdict(report) for name, report in reports.items()}))
        return
    for name, report in reports.items():
        print(f"{name}: {report}")
