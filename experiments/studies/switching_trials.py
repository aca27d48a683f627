"""Hands in crossing rivers on the MuJoCo Phantom, with any state and any push, compared with the certificates.

``python -m experiments.studies.switching_trials 40`` draws rivers and compares what is certified with what happens;
``python -m experiments.studies.switching_trials docs/pictures`` draws the picture of the docs.
"""

import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from controllers.certificates.loop.sampling import Sampling
from controllers.certificates.switching.switching import HandRetention, SelectionRule
from controllers.certificates.switching.switching_search import Push, failure
from controllers.fields.bundle import RiverBundle
from controllers.fields.higher_order import HigherOrder
from experiments.certify.certified_device import phantom_device
from experiments.certify.certified_rivers import certified_bundle, simulated_course
from experiments.files.figure_files import save_figure
from experiments.results.pages.figures import STYLE
from experiments.setups.modes.rivers import ADMISSION, SIGMA
from experiments.studies.field_figures import SPEED, straight_river
from geometry.arrays import Array

PUSHES = tuple(0.125 * 2.0 ** (0.5 * k) for k in range(11))  # [N] pushes that are tried on every crossing, up to 4 N
# [N] coordinates in the picture of crossings that are not certified, and of hands that are never lost
UNCERTIFIED_FORCE, NEVER_LOST_FORCE = 0.025, 5.7


def straight_pair(degrees: float, form: str, hysteresis: float, drag: float = 4.0) -> HigherOrder:
    """Two straight rivers that cross at the origin of H; h, r as shares of their speed, σ that of the discrete mode."""
    rivers = tuple(replace(straight_river(angle), drag=drag) for angle in (0.0, degrees))
    scale = (ADMISSION * SPEED, SIGMA["discrete"] * SPEED, hysteresis * SPEED)
    return HigherOrder(RiverBundle(rivers, ("1", "2")), *scale, form)  # pyright: ignore[reportArgumentType]


class Crossing(NamedTuple):
    """Two random straight rivers, and a push in a random direction.

    Attributes
    ----------
    field : HigherOrder
        The rivers.
    sampling : Sampling
        The clock.
    degrees : float
        Angle between them.
    allowed : float
        Certified force [N]; negative if there is none.
    direction : Array, shape (3,)
        Direction of the push.
    start, duration : float
        Start and duration of the push [s].
    """

    field: HigherOrder
    sampling: Sampling
    degrees: float
    allowed: float
    direction: Array
    start: float
    duration: float

    def kept(self, force: float) -> bool:
        """Whether, in MuJoCo, the first river keeps a hand that is pushed with a force [N]."""
        curve = self.field.bundle.rivers[0].curve
        x, y, z = (force * self.direction).tolist()
        push = Push((x, y, z), self.start, self.duration)
        course = simulated_course(self.field, self.sampling, curve.point(0.2), curve.velocity(0.2), 1.2, push)
        return failure(course.river[1:], self.sampling.period, 0, False) is None


def draw_crossing(rng: np.random.Generator) -> Crossing:
    """Random angle, gains, hysteresis, clock and push."""
    degrees = float(rng.uniform(5.0, 90.0))
    field = straight_pair(degrees, "discrete", float(rng.uniform(0.0, 3.0)), float(rng.uniform(4.0, 20.0)))
    sampling = Sampling(float(rng.choice([5e-4, 1e-3])), 0.0, float(rng.uniform(25.0, 100.0)))
    first, second = certified_bundle(field.bundle, phantom_device(), sampling)
    sharing = SelectionRule(field.admission, field.sigma, field.hysteresis, field.form, field.look)
    allowed = HandRetention(first, (second,), sharing).allowed(2.0)
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    return Crossing(
        field, sampling, degrees, allowed, direction, float(rng.uniform(0.2, 0.6)), float(rng.uniform(0.05, 0.4))
    )


def trial(rng: np.random.Generator) -> tuple[bool, bool]:
    """Random rivers with the certified push, else 1 N; returns whether it is certified, and the hand is kept."""
    crossing = draw_crossing(rng)
    certified = crossing.allowed > 0.0
    return certified, crossing.kept(crossing.allowed if certified else 1.0)


def trials(number: int, seed: int = 1) -> Counter[tuple[bool, bool]]:
    """Counts of the outcomes (certified, kept) of `number` trials."""
    rng = np.random.default_rng(seed)
    return Counter(trial(rng) for _ in range(number))


def outcomes_figure(number: int) -> Figure:
    """Certified force against the least of `PUSHES` that loses the hand in MuJoCo, for random crossings."""
    rng = np.random.default_rng(1)
    crossings = [draw_crossing(rng) for _ in range(number)]
    lost = [next((force for force in PUSHES if not crossing.kept(force)), NEVER_LOST_FORCE) for crossing in crossings]
    x = [crossing.allowed if crossing.allowed > 0.0 else UNCERTIFIED_FORCE for crossing in crossings]
    figure = Figure(figsize=(5.6, 4.4), layout="constrained")
    ax = figure.subplots()
    ends = np.array([UNCERTIFIED_FORCE, NEVER_LOST_FORCE])
    ax.fill_between(ends, [PUSHES[0] / 2.0] * 2, ends, color="#fbe9e7", lw=0, label="would refute the certificate")
    degrees = [crossing.degrees for crossing in crossings]
    dots = ax.scatter(x, lost, c=degrees, cmap="viridis", s=28, vmin=0.0, vmax=90.0)
    ax.set(xscale="log", yscale="log")
    ax.set(xlim=(UNCERTIFIED_FORCE / 1.3, NEVER_LOST_FORCE * 1.2), ylim=(PUSHES[0] / 1.5, NEVER_LOST_FORCE * 1.2))
    ax.set_xticks([UNCERTIFIED_FORCE, 0.1, 0.3, 1.0, 3.0], ["none", "0.1", "0.3", "1", "3"])
    ax.set_yticks([*PUSHES[::2], NEVER_LOST_FORCE], [*(f"{force:.2g}" for force in PUSHES[::2]), "kept"])
    ax.minorticks_off()
    ax.set(xlabel="force that is certified [N]", ylabel="least force that loses the hand in MuJoCo [N]")
    ax.legend(loc="lower right", fontsize=8)
    figure.colorbar(dots, label="angle of the crossing [degrees]")
    return figure


def main(arguments: list[str]) -> None:
    """Count the outcomes of a given number of trials, or draw them into a given folder."""
    if not arguments[0].isdecimal():
        with mpl.rc_context(STYLE):
            save_figure(outcomes_figure(40), Path(arguments[0]) / "switching-trials.png", dpi=130)
        return
    for (certified, kept), times in sorted(trials(int(arguments[0])).items()):
        print(f"certified {certified}, kept {kept}: {times}")


if __name__ == "__main__":
    main(sys.argv[1:])
