"""Hands at crossings of two rivers, on the simulated Phantom: which stay, which change over, which are thrown out.

``python -m experiments.studies.crossings`` prints the table of `docs/validation/crossing-rivers.md`.
"""

from dataclasses import replace
from typing import Literal

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.fields.algebra.law import Program
from controllers.fields.bundle import RiverBundle
from controllers.fields.higher_order import HigherOrder
from controllers.fields.river import River
from experiments.config.maps import Circle, Cylindrical
from experiments.config.modes import Rivers
from experiments.config.options import run_config
from experiments.setups.modes.rivers import (
    ADMISSION,
    HYSTERESIS,
    SELECTION_TIME_CONSTANT,
    SIGMA,
    default_choice,
    law_of,
    river_time,
)
from experiments.setups.parts.defaults import river_gains
from experiments.setups.parts.lap import DEFAULT_LAP
from experiments.setups.wiring import wire
from experiments.studies.field_figures import SPEED, straight_river
from experiments.studies.released_hand import released
from geometry.arrays import Array
from sim.users.hand.actions import Push
from sim.users.hand.arm import Arm

Form = Literal["discrete", "smooth"]
Ticks = dict[str, Array]

ANGLES = (0, 10, 15, 20, 30, 45, 60, 90)  # between two rivers [degrees]
PUSHES = (0.0, 0.2, 0.5, 1.0, 2.0)  # [N]
PUSH_SECONDS = 0.2  # [s]
PASSAGE_SECONDS = 1.25  # [s] from 45 mm before the crossing to 45 mm behind it

GAINS = ((300.0, 8.0), (300.0, 16.0), (300.0, 24.0), (150.0, 16.0), (150.0, 20.0))  # k_r [N/m], b_d [N s/m]
RIVER_PUSHES = (0.5, 0.7, 0.9, 1.1, 1.3, 1.6, 2.0, 2.5)  # [N]
PUSH_LEADS = (-0.1, 0.0, 0.1)  # [s] by which a push begins before the crossing
PUSH_DURATIONS = (0.2, 0.4)  # [s] duration of a push


def passage(program: Program, start: Array, seconds: float, pushes: tuple[Push, ...]) -> Ticks:
    """Release a relaxed hand that pushes, in a field without a figure; see `released`."""
    return released(wire(run_config(figure="none")), program, start, Arm(pushes=pushes), seconds)


def crossing_field(second: River, form: Form, alone: bool) -> Program:
    """Field of the river along x and of a second one, or of the first alone, with the gains of the mode of rivers."""
    mode = Rivers()
    rivers = tuple(
        replace(river, epsilon=mode.river_tube, tau=river_time(mode), drag=river_gains(mode)[1])
        for river in (straight_river(0.0), second)
    )
    bundle = RiverBundle(rivers[:1] if alone else rivers, ("1",) if alone else ("1", "2"))
    return HigherOrder(
        bundle, ADMISSION * SPEED, SIGMA[form] * SPEED, HYSTERESIS * SPEED, form, SELECTION_TIME_CONSTANT
    ).program()


def pushed_passage(second: River, form: Form, newtons: float, alone: bool = False) -> Ticks:
    """Passage through the origin along x, with a push in the plane across the first river, towards the second."""
    pushes = (Push(0.0, PUSH_SECONDS, newtons, (0.0, 1.0, 0.0), (-0.0075, 0.0, 0.0), 0.004),) if newtons else ()
    start = np.array([-0.045, 0.0, 0.0])
    return passage(crossing_field(second, form, alone), start, PASSAGE_SECONDS, pushes)


def outcome(river: Array) -> str:
    """Which river had the hand at the end, and for how long none had it, if that was 20 ms or more."""
    lost = float(np.sum(river < 0.0)) * 1e-3
    end = "out" if river[-1] < 0.0 else f"{int(river[-1]) + 1}"
    return end if lost < 0.02 else f"{end} ({lost:.2f} s)"


def crossing_passages() -> str:
    """The table as Markdown: by angle and push, the river that has the hand in the end."""
    lines = ["| angle | form | deviation unpushed [mm] | " + " | ".join(f"{f:g} N" for f in PUSHES) + " |"]
    lines.append("|--:|---|--:|" + "--:|" * len(PUSHES))
    for degrees in ANGLES:
        for form in ("discrete", "smooth"):
            passages = [pushed_passage(straight_river(degrees), form, force) for force in PUSHES]
            alone = pushed_passage(straight_river(degrees), form, 0.0, alone=True)
            away = 1e3 * float(np.max(np.abs(passages[0]["p"] - alone["p"])))
            cells = " | ".join(outcome(one["river"]) for one in passages)
            lines.append(f"| {degrees}° | {form} | {away:.3f} | {cells} |")
    return "\n".join(lines)


def changed_over(mode: Rivers, newtons: float) -> tuple[int, int, int]:
    """Numbers of hands on the level river that change to another one, that are thrown out, and of all hands.

    They are pushed up where the wave rises through the level river, or down where it falls.
    """
    curve = Trajectory.circle(Circle().radius, DEFAULT_LAP)
    program, changed, out = law_of(mode, default_choice(mode, curve, Cylindrical().reach)).program(), 0, 0
    pushes = [(up, lead, lasts) for up in (1.0, -1.0) for lead in PUSH_LEADS for lasts in PUSH_DURATIONS]
    for up, lead, lasts in pushes:
        at = curve.start + (0.5 if up > 0.0 else 0.75) * curve.duration - lead
        x, y, z = (float(value) for value in curve.point(at))
        push = Push(0.2, lasts, newtons, (0.0, 0.0, up), (x, y, z), 0.003)
        river = passage(program, curve.point(at - 0.5), 1.6, (push,))["river"]
        lost = bool(river[-1] < 0.0 or np.sum(river < 0.0) > 100)
        changed, out = changed + int(not lost and bool(river[-1] > 0.0)), out + int(lost)
    return changed, out, len(pushes)


def pushed_rivers() -> str:
    """The table as Markdown: by gains and push, how many hands change over, and how many are thrown out."""
    lines = ["| k_r, b_d | " + " | ".join(f"{force:g} N" for force in RIVER_PUSHES) + " |"]
    lines.append("|---|" + "--:|" * len(RIVER_PUSHES))
    for stiffness, damping in GAINS:
        mode = Rivers(stiffness=stiffness, damping=damping)
        cells = [changed_over(mode, f) for f in RIVER_PUSHES]
        row = " | ".join(f"{changed}, {out}" for changed, out, _ in cells)
        lines.append(f"| {stiffness:g}, {damping:g} | {row} |")
    return "\n".join(lines)


if __name__ == "__main__":
    print(crossing_passages(), pushed_rivers(), sep="\n\n")
