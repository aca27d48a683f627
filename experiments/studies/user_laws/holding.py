"""Holding still: tremor, and the response of the arm to a push of the device."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.signal import welch

from experiments.studies.user_laws.bare_device import PERIOD, trial
from experiments.studies.user_laws.law import Law, Study
from geometry.arrays import Array
from sim.users.person.person import Person
from sim.users.person.wishes import Wishes, following

PUSH_FORCE, PUSH_PERIOD, N_PUSHES, RESPONSE_TIME = 1.0, 1.6, 10, 0.5  # [N], [s], number, [s]
GRIP_FORCES = (1.0, 2.0, 4.0, 8.0)  # [N]
HELD_SECONDS = 20.0  # [s] for which the hand holds still
_HOLD_STILL = Wishes(following(np.zeros((2, 3))), 0.02)


def tremor(people: Sequence[Person], seed: int) -> Study:
    """Power spectrum of the acceleration of a hand that holds the stylus still."""
    spectra, peaks, sizes = list[Array](), list[float](), list[float]()
    f = np.zeros(0)
    for i, person in enumerate(people):
        trace = trial(person, _HOLD_STILL, HELD_SECONDS, seed + i, np.zeros(3))
        acceleration = np.gradient(trace.v[2000:], PERIOD, axis=0)
        f, power = welch(acceleration, 1.0 / PERIOD, nperseg=4096, axis=0)
        power = power.sum(axis=1)
        band = (f > 4.0) & (f < 20.0)
        peak = float(f[band][np.argmax(power[band])])
        near = np.abs(f - peak) < 1.0
        peaks.append(peak)
        sizes.append(float(np.sqrt(2.0 * power[near].sum() * (f[1] - f[0]))))
        spectra.append(power)
    shown = (f > 0.5) & (f < 30.0)
    return Study(
        "tremor", "Tremor: acceleration of a hand that holds still",
        (
            Law("Tremor: frequency of the peak", float(np.median(peaks)), 6.0, 12.0, "Hz", "Lakie et al. 2015 (a)"),
            Law("Tremor: amplitude at the peak", float(np.median(sizes)), 0.015, 0.34, "m/s²",
                "Wade, Gresty & Findley 1982: 97 people, 0.0015 to 0.035 g (a)"),
        ),
        f[shown], np.mean(spectra, axis=0)[shown], ("frequency [Hz]", "power of the acceleration [m²/s⁴/Hz]"),
        log=True, joined=True,
    )  # fmt: skip


def impedance(person: Person, seed: int) -> tuple[Array, Array, tuple[float, float, float]]:
    """Mean response [m] to a push along x, its times [s], and the fitted mass [kg], damping [N s/m], stiffness [N/m].

    As in such studies, the person is told not to intervene: she does not correct the response voluntarily.
    """
    person = replace(person, correction=0.0)
    n, period = round(N_PUSHES * PUSH_PERIOD / PERIOD), round(PUSH_PERIOD / PERIOD)
    window = round(RESPONSE_TIME / PERIOD)
    pushes = np.zeros((n, 3))
    for k in range(1, N_PUSHES):
        pushes[k * period : k * period + window, 0] = PUSH_FORCE * (1.0 if k % 2 else -1.0)
    trace = trial(person, _HOLD_STILL, N_PUSHES * PUSH_PERIOD, seed, np.zeros(3), pushes)
    answers = [
        (1.0 if k % 2 else -1.0) * (trace.p[k * period : k * period + window, 0] - trace.p[k * period - 1, 0])
        for k in range(1, N_PUSHES)
    ]
    answer, t = np.mean(answers, axis=0), PERIOD * np.arange(1, window + 1, dtype=np.float64)
    # F = m a + b v + k x is integrated twice, so that no derivative of the measurement is needed.
    once, twice = np.cumsum(answer) * PERIOD, np.cumsum(np.cumsum(answer)) * PERIOD**2
    columns = np.stack([answer, once, twice], axis=1)
    m, b, k = np.linalg.lstsq(columns, 0.5 * PUSH_FORCE * t**2, rcond=None)[0]
    return answer, t, (float(m), float(b), float(k))


def step_response(people: Sequence[Person], seed: int) -> Study:
    """Step response of a hand that holds still when the device pushes it: mass, damping and stiffness."""
    found = [impedance(person, seed + i) for i, person in enumerate(people)]
    m, b, k = np.median([values for _, _, values in found], axis=0)
    answers, t = np.mean([answer for answer, _, _ in found], axis=0), found[0][1]
    return Study(
        "step-response", f"Response of the arm to a push of {PUSH_FORCE:g} N",
        (
            Law("Step response: mass", float(m), 0.1, 2.5, "kg", "Speich et al. 2005: 1.46; a wrist some 0.1 (m)"),
            Law("Step response: stiffness", float(k), 50.0, 800.0, "N/m", "Mussa-Ivaldi 1985, Tsuji 1995 (m)"),
            Law("Step response: damping ratio", float(b / (2.0 * np.sqrt(max(m * k, 1e-12)))), 0.2, 1.0, "",
                "Perreault 2004: alike for all people (q), 0.3; fingertips up to 1 (m)"),
        ),
        t, answers, ("time [s]", "displacement [m]"), joined=True,
    )  # fmt: skip


def grip(people: Sequence[Person], seed: int) -> Study:
    """Stiffness at the stylus over the force of the grip."""
    stiffness = [
        float(np.median([impedance(replace(person, grip=force), seed + i)[2][2] for i, person in enumerate(people)]))
        for force in GRIP_FORCES
    ]
    x, y = np.array(GRIP_FORCES), np.array(stiffness)
    slope, intercept = np.polyfit(np.log(x), np.log(np.maximum(y, 1e-9)), 1)
    return Study(
        "grip", "Stiffness at the stylus over grip",
        (Law("Grip: exponent of stiffness", float(slope), 0.1, 1.0, "",
             "Hasser & Cutkosky 2002: rises with grip; Van Doren 1998: in proportion (a)", built_in=True),),
        x, y, ("grip [N]", "stiffness [N/m]"), (float(slope), float(intercept)), log=True,
    )  # fmt: skip
