"""Practice and fatigue: learning of a force that recurs in every lap, and endurance against a constant force."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import curve_fit

from experiments.studies.user_laws.bare_device import PERIOD, End, trial
from experiments.studies.user_laws.law import Law, Study
from geometry.arrays import Array
from sim.users.person.person import Person
from sim.users.person.wishes import Wishes, following

N_LAPS, LAP_DURATION, RADIUS = 24, 2.0, 0.04  # laps of tracing; their duration [s] and radius [m]
PUSH_FORCE = 1.5  # [N] recurring in every lap
LEARNING_RATE = 0.15  # share of an error that people who learn correct per repetition
LOADS = (0.25, 0.4, 0.6, 0.8)  # shares of the person's strength; published models cover 10 to 90 %
FATIGUE, STRENGTH = 0.6, 6.0  # rate for the grip [1/min]; strength that the device can load [N]
LOADING_TIME = 2.0  # [s] in which the person takes up the load
SLIP_DISTANCE = 0.02  # [m] displacement from which a hand counts as no longer holding
_SAMPLE_TIME = 0.01  # [s] between wishes


def practice(people: Sequence[Person], seed: int) -> Study:
    """Error of a lap over repetitions, while the device pushes in the same way in every lap.

    Individual practice curves are exponential, e = a + b exp(-c n), rather than a power of n (Heathcote, Brown &
    Mewhort 2000: 475 people, in all data sets that are not averaged).
    """
    t = np.arange(0.0, (N_LAPS + 1) * LAP_DURATION, _SAMPLE_TIME)
    angle, n = 2.0 * np.pi * t / LAP_DURATION, round(N_LAPS * LAP_DURATION / PERIOD)
    points = RADIUS * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    phase = 2.0 * np.pi * PERIOD * np.arange(n) / LAP_DURATION
    pushes = np.stack([np.cos(2.0 * phase), np.sin(2.0 * phase), 0.0 * phase], axis=1, dtype=np.float64)
    pushes *= PUSH_FORCE
    wanted = RADIUS * np.stack([np.cos(phase), np.sin(phase), 0.0 * phase], axis=1)
    curves = list[Array]()
    for i, person in enumerate(people):
        learner = replace(person, learning=LEARNING_RATE, entrainment=0.0)
        wishes = Wishes(following(points), _SAMPLE_TIME, LAP_DURATION)
        trace = trial(learner, wishes, N_LAPS * LAP_DURATION, seed + i, points[0], pushes)
        off = np.linalg.norm(trace.p - wanted, axis=1).reshape(N_LAPS, -1)
        curves.append(np.sqrt(np.mean(off**2, axis=1))[1:])
    number = np.arange(1.0, N_LAPS)
    fits = [(_fit_law(number, curve, _exponential_law), _fit_law(number, curve, _power_law)) for curve in curves]
    rate = float(np.median([one[0][2] for one, _ in fits]))
    worse = float(np.median([other[1] / one[1] for one, other in fits]))
    return Study(
        "practice", "Practice: error of a lap while the device pushes the same way in every lap",
        (
            Law("Practice: share learned a repetition", rate, 0.05, 0.4, "",
                "Smith et al. 2006: 0.21 + 0.02 a trial (q)", built_in=True),
            Law("Practice: misfit of a power law over that of an exponential", worse, 1.0, 100.0, "",
                "Heathcote et al. 2000: individual curves are exponential"),
        ),
        number, np.mean(curves, axis=0), ("repetition", "RMS error [m]"), joined=True,
    )  # fmt: skip


def endurance(people: Sequence[Person], seed: int) -> Study:
    """Endurance time of a hand against a force of the device, over that force as a share of its strength.

    Measured with one person: strength and fatigue are fixed, and other differences between people matter little. She
    trembles as she does, since a hand that is quite still for half a second looks like frozen encoders to the device,
    which then lets go of her.
    """
    times, person = list[float](), people[0]
    weak = replace(person, strength=STRENGTH, fatigue=FATIGUE)
    for load in LOADS:
        seconds = 1.3 * 60.0 / FATIGUE * (1.0 - load) / load
        pushes = np.zeros((round(seconds / PERIOD), 3))
        pushes[:, 0] = load * STRENGTH * np.minimum(1.0, PERIOD * np.arange(len(pushes)))
        end = End(slip=SLIP_DISTANCE, slips_from=LOADING_TIME)
        trace = trial(weak, Wishes(following(np.zeros((2, 3)))), seconds, seed, np.zeros(3), pushes, end)
        times.append(float(trace.t[-1]) if len(trace.t) < len(pushes) else np.nan)
    x, y = np.array(LOADS), np.array(times)
    slope, intercept = np.polyfit(np.log(x), np.log(y), 1)
    half = float(np.exp(intercept + slope * np.log(0.5)))
    return Study(
        "endurance", "Endurance: time that a force is held, over its share of the strength",
        (
            Law("Endurance: time at half the strength", half, 53.0, 145.0, "s",
                "Frey Law & Avin 2010, Table 2: b₀ f^b₁, shoulder to ankle, grip 102 (q)", True),
            Law("Endurance: exponent", -float(slope), 1.61, 2.27, "",
                "Frey Law & Avin 2010, Table 2: grip to trunk (q)", True),
        ),
        x, y, ("force over strength", "time [s]"), (float(slope), float(intercept)), log=True,
    )  # fmt: skip


def _exponential_law(n: Array, a: float, b: float, c: float) -> Array:
    return a + b * np.exp(-c * n)


def _power_law(n: Array, a: float, b: float, c: float) -> Array:
    return a + b * n**-c


def _fit_law(n: Array, errors: Array, law: Callable[..., Array]) -> tuple[Array, float]:
    """Fitted parameters of a law of practice, and the residual sum of squares."""
    start = (float(errors[-1]), float(errors[0] - errors[-1]), 0.3)
    found = np.asarray(curve_fit(law, n, errors, start, bounds=((0.0, 0.0, 0.0), (1.0, 1.0, 5.0)))[0], dtype=np.float64)
    return found, float(np.sum((errors - law(n, *found)) ** 2))
