"""Tracing a drawn path: the steering law, and the two-thirds power law."""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import isotonic_regression, minimize
from scipy.signal import butter, sosfiltfilt
from scipy.stats import norm

from experiments.studies.user_laws.bare_device import PERIOD, Trace, trial
from experiments.studies.user_laws.law import Law, Study
from geometry.arrays import Array
from sim.users.person.person import Person
from sim.users.person.wishes import Wishes, following

N_LAPS = 7  # laps of an ellipse, of which the first is practice
RADIUS = 0.04  # of the circular tunnel [m]
DIFFICULTIES = (10.0, 15.0, 20.0, 30.0, 40.0)  # length over width; 10.7 to 42.7 in Yamanaka et al. 2017
PACES = (0.6, 1.0, 1.7, 2.8, 4.5)  # durations of a practised lap [s]
ERROR_RATE = 0.064  # share of passages that touch a wall (Accot & Zhai 1997)
N_PRACTICE_LAPS, N_TUNNEL_LAPS = 9, 9  # per pace in practice, and per tunnel; the first and the last are not evaluated
MIN_LAPS = 5  # fewest of these that go all the way round, at a pace that the person can hold
ELLIPSES = ((0.04, 0.024), (0.04, 0.016), (0.03, 0.01))  # half axes [m]
ELLIPSE_TIMES = (1.5, 2.5)  # durations of a lap [s]
_SAMPLE_TIME, _CUTOFF = 0.01, 6.0  # [s] between wishes; [Hz] of the filter before curvature, below the tremor
_N_HARMONICS = 6  # Fourier terms of the logarithm of the speed along a lap


def steering(people: Sequence[Person], seed: int) -> Study:
    """Steering law: time to pass a circular tunnel over its length by its width (protocol of Accot & Zhai 1997).

    A tunnel of a given width is passed as fast as possible without touching its walls. From practice the person knows
    the deviation of her laps at each pace, and takes the fastest pace at which no more than `ERROR_RATE` of them touch.
    New laps at that pace are evaluated; those that touch are errors and left out.
    """
    widths = 2.0 * np.pi * RADIUS / np.array(DIFFICULTIES)
    times, touched = np.full((len(people), len(widths)), np.nan), list[Array]()
    for i, person in enumerate(people):
        paces = _chosen_paces(person, widths, seed + i)
        for k, (pace, width) in enumerate(zip(paces, widths, strict=True)):
            farthest, lasted = _traced_laps(person, pace, N_TUNNEL_LAPS, seed + 1000 * (k + 1) + i)
            touches = farthest > 0.5 * width
            touched.append(touches)
            if not np.all(touches):
                times[i, k] = float(np.mean(lasted[~touches]))
    x, y = np.array(DIFFICULTIES), np.nanmean(times, axis=0)
    slope, intercept = np.polyfit(x, y, 1)
    return Study(
        "steering", "Steering law: time of a lap over length by width",
        (
            Law("Steering: slope", 1e3 * slope, 47.7, 200.0, "ms",
                "straight: Yamanaka et al. 2017, 47.7 (q), Accot & Zhai 1997, 78 (q); circular: some 150 (m)"),
            Law("Steering: R²", float(np.corrcoef(x, y)[0, 1] ** 2), 0.9, 1.0, "",
                "Accot & Zhai 1999: r above 0.98 with five devices (a)"),
            Law("Steering: laps that touch", 100.0 * float(np.mean(np.concatenate(touched))), 0.0, 23.0, "%",
                "Accot & Zhai 1997: 6.4 (q)", built_in=True),
        ),
        x, y, ("length / width", "time of a lap [s]"), (float(slope), float(intercept)),
    )  # fmt: skip


def _chosen_paces(person: Person, widths: Array, seed: int) -> Array:
    """Duration of a lap [s] at which a share `ERROR_RATE` of the laps touches the walls, for each width [m].

    At each practised pace, the needed width follows from a normal distribution of the laps' deviations; it decreases
    with the duration (isotonic regression), with linear interpolation. Paces that the person cannot hold are left out.
    """
    held, needed = list[float](), list[float]()
    for pace in PACES:
        farthest, _ = _traced_laps(person, pace, N_PRACTICE_LAPS, seed)
        if len(farthest) >= MIN_LAPS:
            held.append(pace)
            needed.append(float(2.0 * (np.mean(farthest) + norm.isf(ERROR_RATE) * np.std(farthest, ddof=1))))
    falling = isotonic_regression(needed, increasing=False).x
    return np.interp(widths, falling[::-1], held[::-1])


def _traced_laps(person: Person, pace: float, laps: int, seed: int) -> tuple[Array, Array]:
    """Largest deviation of each lap from the middle [m], and its duration [s], without the first lap."""
    angle = 2.0 * np.pi * np.arange(0.0, (laps + 1) * pace, _SAMPLE_TIME) / pace
    points = RADIUS * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    trace = trial(person, _wishes(points, pace), laps * pace, seed, points[0])
    gone = np.unwrap(np.arctan2(trace.p[:, 1], trace.p[:, 0])) / (2.0 * np.pi)
    beside = np.abs(np.hypot(*trace.p[:, :2].T) - RADIUS)
    lap = np.floor(gone).astype(int)
    whole = range(1, int(lap.max()))
    return (
        np.array([beside[lap == k].max() for k in whole]),
        np.array([PERIOD * np.count_nonzero(lap == k) for k in whole]),
    )


def power_law(people: Sequence[Person], seed: int) -> Study:
    """Speed over curvature of ellipses drawn at a natural pace: v = γ κ^(−β), β = 1/3 (Lacquaniti et al. 1983)."""
    exponents, curvatures, speeds = list[float](), list[Array](), list[Array]()
    for i, person in enumerate(people):
        long, short = ELLIPSES[i % len(ELLIPSES)]
        lap = ELLIPSE_TIMES[i % len(ELLIPSE_TIMES)]
        angle = np.linspace(0.0, 2.0 * np.pi, 257)
        drawn = np.stack([long * np.cos(angle), short * np.sin(angle), np.zeros_like(angle)], axis=1)
        times = natural_times(drawn, lap)
        t = np.arange(0.0, (N_LAPS + 1) * lap, _SAMPLE_TIME)
        points = np.stack([np.interp(t % lap, times, drawn[:, k]) for k in range(3)], axis=1)
        trace = trial(person, _wishes(points, lap), N_LAPS * lap, seed + i, points[0])
        kappa, speed = _curvature(trace, lap)
        exponents.append(-float(np.polyfit(np.log(kappa), np.log(speed), 1)[0]))
        curvatures.append(kappa[::40])
        speeds.append(speed[::40])
    x, y = np.concatenate(curvatures), np.concatenate(speeds)
    line = np.polyfit(np.log(x), np.log(y), 1)
    source = "Viviani & Flash 1995: 1/3; measured 0.28 to 0.35 (q)"
    return Study(
        "power-law", "Two-thirds power law: speed over curvature",
        (Law("Power law: exponent β", float(np.mean(exponents)), 0.28, 0.35, "", source),),
        x, y, ("curvature [1/m]", "speed [m/s]"), (float(line[0]), float(line[1])), log=True,
    )  # fmt: skip


def _wishes(points: Array, lap: float) -> Wishes:
    return Wishes(following(points), _SAMPLE_TIME, lap)


def _curvature(trace: Trace, lap: float) -> tuple[Array, Array]:
    """Curvature [1/m] and speed [m/s] of the filtered movement, without the first lap and the ends."""
    sections = butter(2, 2.0 * PERIOD * _CUTOFF, output="sos")
    p = np.asarray(sosfiltfilt(sections, trace.p[:, :2], axis=0))
    v = np.gradient(p, PERIOD, axis=0)
    acceleration = np.gradient(v, PERIOD, axis=0)
    speed = np.linalg.norm(v, axis=1)
    kappa = np.abs(v[:, 0] * acceleration[:, 1] - v[:, 1] * acceleration[:, 0]) / np.maximum(speed, 1e-6) ** 3
    kept = slice(round(lap / PERIOD), -200)
    well = (kappa[kept] > 1.0) & (speed[kept] > 0.005)
    return kappa[kept][well], speed[kept][well]


def natural_times(points: Array, seconds: float) -> Array:
    r"""Times [s], shape (n,), at which a closed path of a given duration passes its points (n, 3) with minimum jerk.

    .. math:: \min_{s(t)} \int_0^T \left|\frac{d^3}{dt^3} x(s(t))\right|^2 dt

    The last point must equal the first. The speed along the path is exp of a Fourier series in arc length. Smoothness
    along a predefined path predicts the speed profiles of people (Todorov & Jordan 1998).
    """
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    length = np.concatenate(([0.0], np.cumsum(steps)))
    angle = 2.0 * np.pi * length / length[-1]
    waves = np.concatenate([[np.cos(k * angle), np.sin(k * angle)] for k in range(1, _N_HARMONICS + 1)])
    n = len(points) - 1
    even = np.arange(n) / n

    def times(coefficients: Array) -> Array:
        slowness = np.exp(-coefficients @ waves)
        cumulative_time = np.concatenate(([0.0], np.cumsum(0.5 * (slowness[1:] + slowness[:-1]) * steps)))
        return cumulative_time / cumulative_time[-1]

    frequencies = np.fft.fftfreq(n, 1.0 / n)[:, None]

    def jerk(coefficients: Array) -> float:
        at = times(coefficients)
        x = np.stack([np.interp(even, at, points[:, k]) for k in range(points.shape[1])], axis=1)
        # Low frequencies only, since the path between its points is not known.
        spectrum = np.where(np.abs(frequencies) <= 4 * _N_HARMONICS, np.fft.fft(x, axis=0), 0.0)
        return float(np.sum(np.abs(frequencies**3 * spectrum) ** 2))

    initial_jerk = jerk(np.zeros(2 * _N_HARMONICS))

    def relative_jerk(c: Array) -> float:
        return jerk(c) / initial_jerk

    solution = minimize(relative_jerk, np.zeros(2 * _N_HARMONICS), method="L-BFGS-B")
    return seconds * times(solution.x)
