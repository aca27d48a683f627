"""Gate and governor on the simulated Phantom, drawn by ``python -m experiments.studies.rate_trials docs/pictures``.

A hand is led through the flight of the backflip at one speed after another, by an arm's impedance along the curve.
"""

import sys
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from controllers.fields.algebra.law import Program
from controllers.fields.bundle import RiverBundle
from controllers.fields.governor import Governor, governor_force
from controllers.fields.higher_order import HigherOrder
from controllers.fields.river import River
from experiments.config.options import run_config
from experiments.files.figure_files import save_figure
from experiments.results.pages.figures import STYLE
from experiments.setups.modes.rivers import GATE_ADMISSION, HYSTERESIS, SIGMA
from experiments.setups.parts.governor import speeds_along
from experiments.setups.parts.part_types import ClipMapParts
from experiments.setups.session import Session
from experiments.setups.wiring import wire
from experiments.studies.released_hand import released
from geometry.arrays import Array
from geometry.easing import smooth_step
from sim.users.hand.arm import Arm
from sim.viewer.palette import CURVE, FIELD, USER
from sim.viewer.palette import TUBE as TUBE_COLOUR

DRAG, TUBE = 8.0, 0.015  # drag of governor and river [N s/m], radius of the tube [m]
SPEEDS = np.arange(0.02, 0.19, 0.015)  # at which hands are led [m/s]
HALF_LENGTH = 0.03  # [m] length of a straight path before and behind its point of contact: within tube and flight
STEP = 0.005  # [s] between the points of a path
APPROACH_TIME, SLOWING_FRACTION = 0.4, 0.6  # [s] before the flight; share of the flight in which a hand slows down


class Passage(NamedTuple):
    """Passage of a hand that is led along the curve.

    Attributes
    ----------
    t, phase, distance, speed : Array
        Time [s], phase [s], distance from the curve [m] and speed along it [m/s], shape (n,).
    along : Array
        Force of the field along the curve [N], shape (n,).
    river : Array
        Number of the river that has the hand, −1 for none, shape (n,).
    """

    t: Array
    phase: Array
    distance: Array
    speed: Array
    along: Array
    river: Array


class LedBackflip:
    """The backflip on a circle of the hand: its curve, its admissible speeds, and a hand that is led along it.

    Attributes
    ----------
    curve : Trajectory
        The map's curve φ, without compensation of the Phantom's friction.
    speeds : Array
        Least and greatest speed [m/s] at equal steps of the phase, shape (m, 2).
    flight : tuple of two floats
        Phases between which the least speed is above zero [s].
    """

    def __init__(self) -> None:
        self._config = run_config(clips=("backflip",), figure="none", lap=2.7, tube=TUBE)
        session = self._session()
        self.curve = session.parts.maps.curve
        maps = session.parts.maps
        assert isinstance(maps, ClipMapParts)
        self.speeds = speeds_along(maps, self.curve)
        phases = np.linspace(self.curve.start, self.curve.end, len(self.speeds))
        flying = phases[self.speeds[:, 0] > 0.0]
        self.flight = (float(flying[0]), float(flying[-1]))

    def _session(self) -> Session:
        return wire(self._config)

    def governor(self) -> Program:
        """The governor alone."""
        return Governor(self.curve, self.speeds, DRAG, TUBE).program()

    def gate(self) -> Program:
        """The backflip's river, which takes a hand at the admissible speeds of its flight."""
        pace = self.curve.length / self.curve.duration
        bundle = RiverBundle((River(self.curve, TUBE, speeds=self.speeds),), ("backflip",))
        scale = (GATE_ADMISSION * pace, SIGMA["discrete"] * pace, HYSTERESIS * pace)
        return HigherOrder(bundle, *scale, "discrete").program()

    def straight_path(self, speed: float) -> Array:
        """A straight path at a speed [m/s] that touches the curve in mid-flight, shape (n, 3) [m], `STEP` apart."""
        middle = 0.5 * sum(self.flight)
        there, along = self.curve.point(middle), self.curve.velocity(middle)
        steps = np.arange(-HALF_LENGTH, HALF_LENGTH, speed * STEP)
        return there + np.outer(steps, along / np.linalg.norm(along))

    def slowing_path(self, speed: float) -> Array:
        """A path along the curve at its own pace that slows down to a speed [m/s] in mid-flight, shape (n, 3) [m]."""
        first, last = self.flight
        pace = self.curve.length / self.curve.duration
        phase, phases = first - APPROACH_TIME, [first - APPROACH_TIME]
        while phase < last:
            slow = float(smooth_step((phase - first) / (last - first) / SLOWING_FRACTION))
            phase += STEP * (1.0 + slow * (speed / pace - 1.0))
            phases.append(phase)
        return self.curve.point(np.array(phases))

    def passage(self, program: Program, path: Array) -> Passage:
        """Lead a hand along a path, in steps of `STEP`, in a field."""
        arm = Arm(400.0, 10.0, path, STEP)
        ticks = released(self._session(), program, path[0], arm, STEP * (len(path) - 1))
        along = self.curve.velocity(ticks["phase"])
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        speed, force = (np.sum(ticks[name] * along, axis=1) for name in ("v", "force"))
        return Passage(ticks["t"], ticks["phase"], ticks["distance"], speed, force, ticks["river"])

    def force_at(self, speed: float) -> tuple[float, float]:
        """Speed [m/s] of a hand where it touches the curve in mid-flight, and the governor's force on it there [N]."""
        passage = self.passage(self.governor(), self.straight_path(speed))
        near = passage.distance < 1e-3
        return float(passage.speed[near].mean()), float(passage.along[near].mean())

    def taken_at(self, speed: float) -> tuple[float, float]:
        """Mean speed [m/s] of a hand in the tube of the backflip's river, and the share of time it is taken."""
        passage = self.passage(self.gate(), self.straight_path(speed))
        inside = passage.distance < 0.9 * TUBE
        return float(passage.speed[inside].mean()), float(np.mean(passage.river[inside] == 0.0))


def draw(trial: LedBackflip) -> Figure:
    """Force and gate over the speed in mid-flight, and the force on a hand that slows down there."""
    figure = Figure(figsize=(9.6, 3.0), layout="constrained")
    force_ax, gate_ax, slow_ax = figure.subplots(1, 3)
    middle = len(trial.speeds) * 0.5 * sum(trial.flight) / trial.curve.duration
    least, greatest = trial.speeds[int(middle)]
    forces = np.array([trial.force_at(speed) for speed in SPEEDS])
    law = np.linspace(0.0, 0.2, 201)
    force_ax.plot(1e3 * law, [governor_force(s, least, greatest, DRAG) for s in law], color=TUBE_COLOUR, label="law")
    force_ax.plot(1e3 * forces[:, 0], forces[:, 1], "o", ms=4, color=FIELD, label="on the Phantom")
    force_ax.set(ylabel="governor's force along the curve [N]")
    force_ax.legend()
    taken = np.array([trial.taken_at(speed) for speed in SPEEDS])
    gate_ax.plot(1e3 * taken[:, 0], 100 * taken[:, 1], "o", ms=4, color=FIELD)
    gate_ax.set(ylabel="taken by the river [% of time in tube]")
    for ax in (force_ax, gate_ax):
        ax.axvspan(1e3 * least, 1e3 * greatest, color="#e4f1e6", lw=0)
        ax.set(xlabel="speed in mid-flight [mm/s]")
    passage = trial.passage(trial.governor(), trial.slowing_path(0.05))
    slow_ax.plot(passage.t, 1e3 * passage.speed, color=USER, label="speed [mm/s]")
    shares = np.linspace(trial.curve.start, trial.curve.end, len(trial.speeds))
    slowest = np.interp(passage.phase, shares, trial.speeds[:, 0])
    slow_ax.plot(passage.t, 1e3 * slowest, color=CURVE, label="least speed [mm/s]")
    slow_ax.plot(passage.t, 100 * passage.along, color=FIELD, label="force [0.01 N]")
    slow_ax.set(xlabel="time [s]", title="a hand that slows down in flight", ylim=(-10.0, 205.0))
    slow_ax.legend(loc="upper right")
    return figure


def main(folder: Path) -> None:
    """Draw the picture of the docs into a folder."""
    with mpl.rc_context(STYLE):
        save_figure(draw(LedBackflip()), folder / "governor.png", dpi=130)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
