"""Aiming from one target to the next: Fitts' law, and the scatter of a first submovement."""

import itertools
from collections.abc import Sequence

import numpy as np

from experiments.studies.user_laws.bare_device import SETTLING_TIME, End, Trace, trial
from experiments.studies.user_laws.law import Law, Study
from geometry.arrays import Array
from sim.users.person.person import Person
from sim.users.person.wishes import targets

AMPLITUDES, WIDTHS = (0.02, 0.04, 0.08), (0.005, 0.01, 0.02)  # [m]
MOVEMENT_TIMES = (0.2, 0.3, 0.4)  # [s] imposed movement times, too short for visual feedback on the end
N_MOVEMENTS = 10  # movements from side to side; the first two are practice
_N_PRACTICE = 2
_TRIAL_DURATION = 20.0  # [s] in which also the slowest people complete all movements


def fitts(people: Sequence[Person], seed: int) -> Study:
    """Fitts' law: time from click to click over the index of difficulty log₂(A/W + 1) (MacKenzie 1992)."""
    difficulty, times = list[float](), list[float]()
    for amplitude, width in ((a, w) for a in AMPLITUDES for w in WIDTHS if a >= 2.0 * w):
        found = np.concatenate([
            np.diff(_tap(person, amplitude, width, seed + i).clicks)[_N_PRACTICE:] for i, person in enumerate(people)
        ])  # fmt: skip
        difficulty.append(np.log2(amplitude / width + 1.0))
        times.append(float(np.mean(found)) if len(found) else np.nan)
    x, y = np.array(difficulty), np.array(times)
    slope, intercept = np.polyfit(x, y, 1)
    source = "Fitts 1954, by this index: 112 (q); MacKenzie & Buxton 1994: 167 to 225 (q)"
    return Study(
        "fitts", "Fitts' law: movement time over index of difficulty",
        (
            Law("Fitts: slope", 1e3 * slope, 100.0, 230.0, "ms/bit", source),
            Law("Fitts: intercept", 1e3 * intercept, -200.0, 400.0, "ms",
                "Fitts 1954: 28; MacKenzie & Buxton 1994: 200 to 240 (q)"),
            Law("Fitts: R²", float(np.corrcoef(x, y)[0, 1] ** 2), 0.9, 1.0, "", "Fitts 1954: 0.987 (q)"),
        ),
        x, y, ("log₂(A/W + 1) [bit]", "time from click to click [s]"), (float(slope), float(intercept)),
    )  # fmt: skip


def scatter(people: Sequence[Person], seed: int) -> Study:
    """Scatter of the end of a first submovement along its direction, over A/T, with the time T imposed (time-matched).

    As in Schmidt et al. 1979, distance and time are given, and the width of the target follows: it is as wide as the
    person can hit in one submovement of that time. The first submovement ends where its speed along its direction first
    falls to zero (Meyer et al. 1988).
    """
    speeds, spreads = list[float](), list[float]()
    for amplitude, seconds in itertools.product(AMPLITUDES, MOVEMENT_TIMES):
        spread = list[float]()
        for i, person in enumerate(people):
            width = 2.0 * amplitude * person.caution * person.motor_noise / seconds
            spread.append(float(np.var(_first_ends(_tap(person, amplitude, width, seed + i)), ddof=1)))
        speeds.append(amplitude / seconds)
        spreads.append(float(np.sqrt(np.mean(spread))))
    x, y = np.array(speeds), np.array(spreads)
    slope, intercept = np.polyfit(x, y, 1)
    source = "Schmidt et al. 1979, Wright & Meyer 1983: some 4 to 12 ms (m)"
    return Study(
        "scatter", "Scatter of a submovement over its mean speed",
        (
            Law("Speed–accuracy: slope of σ over A/T", 1e3 * slope, 3.0, 12.0, "ms", source, built_in=True),
            Law("Speed–accuracy: R²", float(np.corrcoef(x, y)[0, 1] ** 2), 0.8, 1.0, "",
                "Meyer et al. 1988: linear (a); r above 0.9 (m)", built_in=True),
        ),
        x, y, ("A/T [m/s]", "standard deviation of the end [m]"), (float(slope), float(intercept)),
    )  # fmt: skip


def _first_ends(trace: Trace) -> Array:
    """End of the first submovement of each movement, as the signed distance from its start along its direction [m]."""
    ends = list[float]()
    for k, (start, end) in enumerate(itertools.pairwise(trace.clicks)):
        if k < _N_PRACTICE:
            continue
        sign = 1.0 if k % 2 == 0 else -1.0
        move = (trace.t >= start) & (trace.t < end + SETTLING_TIME)
        position, speed = sign * trace.p[move, 1], sign * trace.v[move, 1]
        fastest = int(np.argmax(speed))
        stopped = np.flatnonzero(speed[fastest:] <= 0.0)
        if len(stopped):
            ends.append(float(position[fastest + stopped[0]]))
    return np.array(ends)


def _tap(person: Person, amplitude: float, width: float, seed: int) -> Trace:
    points = np.zeros((N_MOVEMENTS + 1, 3))
    points[:, 1] = 0.5 * amplitude * np.where(np.arange(N_MOVEMENTS + 1) % 2 == 0, -1.0, 1.0)
    trace = trial(person, targets(points, width), _TRIAL_DURATION, seed, points[0], end=End(clicks=N_MOVEMENTS + 1))
    return trace._replace(clicks=trace.clicks[: N_MOVEMENTS + 1])
