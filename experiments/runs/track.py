"""Tracking of clips by the physical figure alone: tracking errors, and the residual wrench that it takes."""

import time

from rich.console import Console

from experiments.console.compiling import compiler
from experiments.setups.parts.clips import load_clips
from models.mocap.library import embedded_names
from sim.body.figure_state import FigureGains
from sim.body.tracking import TrackingConfig, TrackingReport, track


def track_clips(
    names: tuple[str, ...], seconds: float, raw: bool, bounds: tuple[float, float]
) -> dict[str, TrackingReport]:
    """Track clips, and report on each by name.

    Parameters
    ----------
    names : tuple of str
        Embedded clips or files; all embedded clips if there is none.
    seconds : float
        Simulated time for each [s].
    raw : bool
        Take motion files as captured, not prepared.
    bounds : (float, float)
        Bounds of the residual's force and moment (see `sim.body.figure_state.FigureGains`).

    Raises
    ------
    ModelError, SimError
        If a clip cannot be read or the time is not positive.
    """
    console = Console(stderr=True)
    names = names or embedded_names()
    clips, remarks = load_clips(names, raw)
    for remark in remarks:
        console.print(remark, highlight=False)

    config = TrackingConfig(gains=FigureGains(force_bound=bounds[0], moment_bound=bounds[1]))
    reports: dict[str, TrackingReport] = {}
    began = time.perf_counter()
    for k, (name, clip) in enumerate(zip(names, clips, strict=True)):
        reports[name] = track(clip, seconds, config, compiler(console))
        rest = (len(names) - k - 1) * (time.perf_counter() - began) / (k + 1)
        if rest > 0.0:
            console.print(f"{k + 1} of {len(names)} clips tracked, about {rest:.0f} s left", highlight=False)
    return reports
