"""Tracing a drawn path: the steering law, and the two-thirds power law."""

from collections.abc import Sequence

import numpy as np
from scipy.signal import butter, sosfiltfilt

from controllers.state import Array
from experiments.studies.user_laws.bare_device import PERIOD, Trace, trial
from experiments.studies.user_laws.law import Law, Study
from sim.users.pace import natural_times
from sim.users.person import Person
from sim.users.wishes import Wishes, following

LAPS = 7  # of an ellipse, of which the first is practice
STEERED, AT_LEAST = 9.0, 8  # [s] at each pace, and laps, of which the first is practice
RADIUS = 0.04  # of the circular tunnel [m]
LAP_TIMES = (1.0, 1.4, 2.0, 2.8, 4.0)  # [s]
ELLIPSES = ((0.04, 0.024), (0.04, 0.016), (0.03, 0.01))  # half axes [m]
ELLIPSE_TIMES = (1.5, 2.5)  # of a lap [s]
_PASSING = 1.645  # standard deviations above the mean that 95 % of a normal distribution lie below
_SAMPLING, _CUTOFF = 0.01, 6.0  # [s] between wishes; [Hz] of the filter before curvature, below the tremor


def steering(people: Sequence[Person], seed: int) -> Study:
    """Time of a lap over the length of a circular tunnel by its width (Accot & Zhai 1997).

    The published slopes are of tunnels that are passed without a touch (Kulikov, MacKenzie & Stuerzlinger 2005 say so).
    Here the pace is given, and the tunnel is as wide as 95 % of her laps need: twice the mean of the farthest that each
    lap goes from the middle, and 1.645 standard deviations of that within people.
    """
    difficulty = list[float]()
    for lap in LAP_TIMES:
        laps = max(AT_LEAST, round(STEERED / lap))
        angle = 2.0 * np.pi * np.arange(0.0, (laps + 1) * lap, _SAMPLING) / lap
        points = RADIUS * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
        farthest = list[Array]()
        for i, person in enumerate(people):
            trace = trial(person, _wishes(points, lap), laps * lap, seed + i, points[0])
            beside = np.abs(np.hypot(*trace.p[round(lap / PERIOD) :, :2].T) - RADIUS)
            farthest.append(beside.reshape(laps - 1, -1).max(axis=1))
        spread = np.sqrt(np.mean(np.var(farthest, axis=1, ddof=1)))
        difficulty.append(2.0 * np.pi * RADIUS / float(2.0 * (np.mean(farthest) + _PASSING * spread)))
    x, y = np.array(difficulty), np.array(LAP_TIMES)
    slope, intercept = np.polyfit(x, y, 1)
    return Study(
        "steering", "Steering law: time of a lap over length by width",
        (
            Law("Steering: slope", 1e3 * slope, 50.0, 200.0, "ms",
                "Accot & Zhai 1997: 78 straight, some 150 circular (m)"),
            Law("Steering: R²", float(np.corrcoef(x, y)[0, 1] ** 2), 0.9, 1.0, "",
                "Accot & Zhai 1999: r above 0.98 with five devices"),
        ),
        x, y, ("length / width", "time of a lap [s]"), (float(slope), float(intercept)),
    )  # fmt: skip


def power_law(people: Sequence[Person], seed: int) -> Study:
    """Speed over curvature of ellipses drawn at a natural pace: v = γ κ^(−β), β = 1/3 (Lacquaniti et al. 1983)."""
    exponents, curvatures, speeds = list[float](), list[Array](), list[Array]()
    for i, person in enumerate(people):
        long, short = ELLIPSES[i % len(ELLIPSES)]
        lap = ELLIPSE_TIMES[i % len(ELLIPSE_TIMES)]
        angle = np.linspace(0.0, 2.0 * np.pi, 257)
        drawn = np.stack([long * np.cos(angle), short * np.sin(angle), np.zeros_like(angle)], axis=1)
        times = natural_times(drawn, lap)
        t = np.arange(0.0, (LAPS + 1) * lap, _SAMPLING)
        points = np.stack([np.interp(t % lap, times, drawn[:, k]) for k in range(3)], axis=1)
        trace = trial(person, _wishes(points, lap), LAPS * lap, seed + i, points[0])
        kappa, speed = _curvature(trace, lap)
        exponents.append(-float(np.polyfit(np.log(kappa), np.log(speed), 1)[0]))
        curvatures.append(kappa[::40])
        speeds.append(speed[::40])
    x, y = np.concatenate(curvatures), np.concatenate(speeds)
    line = np.polyfit(np.log(x), np.log(y), 1)
    source = "Lacquaniti et al. 1983: 1/3; adults' ellipses 0.28 to 0.38 (m)"
    return Study(
        "power-law", "Two-thirds power law: speed over curvature",
        (Law("Power law: exponent β", float(np.mean(exponents)), 0.28, 0.38, "", source),),
        x, y, ("curvature [1/m]", "speed [m/s]"), (float(line[0]), float(line[1])), log=True,
    )  # fmt: skip


def _wishes(points: Array, lap: float) -> Wishes:
    return Wishes(following(points), _SAMPLING, lap)


def _curvature(trace: Trace, lap: float) -> tuple[Array, Array]:
    """Curvature [1/m] and speed [m/s] without the first lap and the ends, of the filtered drawing."""
    sections = butter(2, 2.0 * PERIOD * _CUTOFF, output="sos")
    p = np.asarray(sosfiltfilt(sections, trace.p[:, :2], axis=0))
    v = np.gradient(p, PERIOD, axis=0)
    acceleration = np.gradient(v, PERIOD, axis=0)
    speed = np.linalg.norm(v, axis=1)
    kappa = np.abs(v[:, 0] * acceleration[:, 1] - v[:, 1] * acceleration[:, 0]) / np.maximum(speed, 1e-6) ** 3
    kept = slice(round(lap / PERIOD), -200)
    well = (kappa[kept] > 1.0) & (speed[kept] > 0.005)
    return kappa[kept][well], speed[kept][well]
