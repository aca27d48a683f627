"""Trials of flights: the physical figure performs the longest flight of clips at many playback rates.

``python -m experiments.certify.ballistic_figures docs/pictures CAPTURES`` flies the embedded jump and backflip
and two captured jumps, draws the picture of the docs and prints its table.
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from controllers.certificates.flight.ballistic import FlightJudgement
from controllers.certificates.flight.flight_fit import fit_free_fall
from experiments.files.figure_files import save_figure
from experiments.flights.ballistics import ClipBallistics, FlightTrial, clip_ballistics, fly
from models.mocap.library import embedded, load_clip

_RATE_COUNT = 13  # number of rates flown by the physical figure


class FlownClip(NamedTuple):
    """A clip, and the trials of its longest flight, flown by the physical figure at many rates."""

    name: str
    ballistics: ClipBallistics
    flight: FlightJudgement
    trials: list[FlightTrial]


def flown(name: str, ballistics: ClipBallistics) -> FlownClip:
    """Fly the longest flight of a clip at rates inside and outside the interval at which it is feasible."""
    flight = max(ballistics.flights, key=lambda flight: flight.fit.duration)
    low, high = flight.done or flight.seen
    rates = np.geomspace(0.8 * low, 1.25 * min(high, 2.0), _RATE_COUNT)
    return FlownClip(name, ballistics, flight, [fly(ballistics.clip, flight.fit, float(rate)) for rate in rates])


def rates_table(cases: Sequence[FlownClip]) -> str:
    """Measured and predicted distance of the centres of mass by clip and rate σ, as a Markdown table."""
    lines = ["| clip | σ | can be done | distance [cm] | predicted [cm] |", "|---|---|---|---|---|"]
    for case in cases:
        low, high = case.flight.done or (np.inf, 0.0)
        for trial in case.trials:
            feasible = "yes" if low <= trial.rate <= high else "no"
            row = f"{trial.rate:.2f} | {feasible} | {100 * trial.distance:.1f} | {100 * trial.predicted:.1f}"
            lines.append(f"| {case.name} | {row} |")
    return "\n".join(lines)


def rates_figure(cases: Sequence[FlownClip]) -> Figure:
    """Distance of the physical figure from the longest flight of each clip, over the playback rate."""
    drawing = Figure(figsize=(3.6 * len(cases), 3.2), layout="constrained")
    for ax, case in zip(drawing.subplots(1, len(cases), squeeze=False)[0], cases, strict=True):
        _draw_rates(ax, *case)
    return drawing


def _draw_rates(
    ax: Axes, name: str, ballistics: ClipBallistics, flight: FlightJudgement, trials: list[FlightTrial]
) -> None:
    low, high = flight.done or flight.seen
    rates = [trial.rate for trial in trials]
    com = ballistics.motion.com[flight.fit.start : flight.fit.end + 1]
    fine_rates = np.geomspace(rates[0], rates[-1], 100)
    predicted = [100 * fit_free_fall(com, ballistics.motion.fps, float(rate))[0] for rate in fine_rates]
    ax.plot(fine_rates, predicted, color="#2f6db3", lw=1.2, label="certificate")
    ax.plot(rates, [100 * trial.distance for trial in trials], "o", ms=4, color="#c2473b", label="physical figure")
    ax.axhline(5.0, color="#566072", lw=0.8, ls="--")
    if flight.done is not None:
        ax.axvspan(low, min(high, 2.0), color="#dbe7f4", lw=0, label="can be done")
    ax.axvspan(*flight.seen, color="#e4f1e6", lw=0, label="seen as natural")
    ax.set(title=name, xlabel="rate σ", xlim=(rates[0], rates[-1]))
    ax.set_ylabel("distance of centres of mass [cm]")
    ax.set_ylim(bottom=0)
    ax.legend(frameon=False, fontsize=7)


def main(folder: Path, mocap: Path) -> None:
    """Draw the figure of the docs into a folder, and print its table; `mocap` is the folder of captures."""
    clips = {
        "jump (embedded)": embedded("jump"),
        "backflip (embedded)": embedded("backflip"),
        **{f"CMU {name}": load_clip(mocap / "cmu_amc" / f"{name}.amc") for name in ("02_04", "16_09")},
    }
    cases = [flown(name, clip_ballistics(clip)) for name, clip in clips.items()]
    save_figure(rates_figure(cases), folder / "ballistics.png", dpi=110)
    print(rates_table(cases))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
