r"""Fit of one flight of a motion to free fall: its apparent gravity, and its distance from a real free fall.

Without contact, the centre of mass c of any body follows a parabola and its angular momentum L is constant:

.. math:: c(t) = p_0 + v_0 t - \tfrac12 g t^2 e_z, \qquad L(t) = L_0 .

Played at the rate σ, all accelerations are multiplied by σ², so a flight recorded under gravity ĝ falls with σ² ĝ.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from geometry.arrays import Array, Mask
from geometry.physics import GRAVITY
from geometry.spans import spans

COM_NOISE = 3e-3  # [m] accuracy of the centre of mass of a captured body
MIN_FLIGHT_FRAMES = 5  # frames of a flight: two more than a parabola has coefficients
MIN_FLIGHT_DURATION = 0.08  # [s] a shorter gap in support occurs when a foot rolls over


@dataclass(frozen=True)
class FlightFit:
    """A flight, from the last supported frame before it to the first one after it, and its least-squares parabola.

    Attributes
    ----------
    start, end : int
        First and last frame; both have contact, unless the clip begins or ends in the air.
    time, duration : float
        Begin and duration [s].
    gravity, uncertainty : float
        ĝ of the least-squares parabola, and half the width of its 95 % interval [m/s²].
    misfit : float
        RMS distance of the centre of mass from that parabola [m].
    rise : float
        Height of the apex over the take-off [m].
    take_off : array, shape (3,)
        Velocity of the parabola at the start [m/s].
    clearance : float
        Greatest height of the lowest point of the body over the floor [m].
    momentum : array, shape (3,)
        Mean angular momentum about the centre of mass [kg m²/s].
    drift, yaw : float
        Largest deviation of the body's orientation from that under constant angular momentum, in total and about the
        vertical [rad].
    """

    start: int
    end: int
    time: float
    duration: float
    gravity: float
    uncertainty: float
    misfit: float
    rise: float
    take_off: Array
    clearance: float
    momentum: Array
    drift: float
    yaw: float

    @property
    def likely_gravity(self) -> float:
        """Gravity in the 95 % interval that is nearest to the true one [m/s²]."""
        low, high = self.gravity - self.uncertainty, self.gravity + self.uncertainty
        return float(min(max(GRAVITY, low), high))

    @property
    def natural_rate(self) -> float:
        """σ at which the recorded flight would fall with g: √(g / ĝ); infinite where it does not fall."""
        return float(np.sqrt(GRAVITY / self.gravity)) if self.gravity > 0.0 else np.inf

    @property
    def take_off_speed(self) -> float:
        """Take-off speed that the recorded rise needs under true gravity: √(2 g h) [m/s]."""
        return float(np.sqrt(2.0 * GRAVITY * self.rise))


def find_flights(supported: Mask, fps: float) -> list[tuple[int, int]]:
    """First and last frame of every flight: the supported frames around an interval without support.

    Parameters
    ----------
    supported : array of bool, shape (n,)
        Whether anything bears load in a frame.
    fps : float
        Frames per second [1/s].
    """
    flights = [(max(a - 1, 0), min(b, len(supported) - 1)) for a, b in spans(~supported)]
    return [(a, b) for a, b in flights if b - a + 1 >= MIN_FLIGHT_FRAMES and (b - a) / fps >= MIN_FLIGHT_DURATION]


def fit_flight(
    span: tuple[int, int], fps: float, com: Array, angular: Array, inertia: Array, clearance: Array
) -> FlightFit:
    """Fit free fall to a flight, with gravity as an unknown.

    Parameters
    ----------
    span : (int, int)
        First and last frame.
    fps : float
        Frames per second [1/s].
    com, angular : array, shape (n, 3)
        Centre of mass [m] and angular momentum about it [kg m²/s] of all frames of the clip.
    inertia : array, shape (n, 3, 3)
        Inertia tensor about the centre of mass [kg m²].
    clearance : array, shape (n,)
        Height of the lowest point of the body [m].
    """
    a, b = span
    t = np.arange(b - a + 1) / fps
    middle = t - t[-1] / 2.0
    c = com[a : b + 1]
    horizontal = np.polynomial.polynomial.polyfit(middle, c[:, :2], 1)
    height = np.polynomial.polynomial.polyfit(middle, c[:, 2], 2)
    residual = c - np.column_stack(
        [horizontal[0] + np.outer(middle, horizontal[1]), np.vander(middle, 3, True) @ height]
    )
    spread = max(float(np.sqrt(np.sum(residual[:, 2] ** 2) / (len(t) - 3))), COM_NOISE)
    covariance = np.linalg.inv(np.vander(middle, 3).T @ np.vander(middle, 3))
    uncertainty = 2.0 * spread * np.sqrt(covariance[0, 0]) * float(stdtrit(len(t) - 3, 0.975))
    air = slice(a + 1, b)
    mean = angular[air].mean(axis=0)
    excess = np.linalg.solve(inertia[air], (angular[air] - mean)[:, :, None])[:, :, 0]
    deviation = np.cumsum(excess, axis=0) / fps
    deviation -= deviation.mean(axis=0)
    return FlightFit(
        start=a, end=b, time=a / fps, duration=float(t[-1]), gravity=float(-2.0 * height[2]),
        uncertainty=float(uncertainty), misfit=float(np.sqrt(np.mean(np.sum(residual**2, axis=1)))),
        rise=float(max(c[:, 2].max() - c[0, 2], 0.0)),
        take_off=np.array([*horizontal[1], height[1] + 2.0 * height[2] * middle[0]]),
        clearance=float(clearance[a : b + 1].max()), momentum=mean,
        drift=float(np.linalg.norm(deviation, axis=1).max()), yaw=float(np.abs(deviation[:, 2]).max()),
    )  # fmt: skip


def fit_free_fall(com: Array, fps: float, rate: float) -> tuple[float, Array]:
    """The free fall nearest to a flight played at a rate.

    Minimises the greatest distance over initial position and velocity by Lawson's iteration: least squares, reweighted
    by the remaining distances.

    Parameters
    ----------
    com : array, shape (n, 3)
        Centre of mass during the flight [m].
    fps : float
        Frames per second as recorded [1/s].
    rate : float
        σ.

    Returns
    -------
    distance : float
        The greatest distance [m].
    state : array, shape (2, 3)
        Position [m] and velocity [m/s] of the fall at the first frame.
    """
    t = np.arange(len(com)) / (fps * rate)
    wanted = com + np.outer(0.5 * GRAVITY * t**2, (0.0, 0.0, 1.0))
    basis = np.column_stack([np.ones_like(t), t])
    weights = np.full(len(t), 1.0 / len(t))
    greatest, best = np.inf, np.zeros((2, 3))
    for _ in range(40):
        normal = basis.T @ (weights[:, None] * basis)
        state = np.asarray(np.linalg.solve(normal, basis.T @ (weights[:, None] * wanted)), dtype=np.float64)
        residual = np.linalg.norm(wanted - basis @ state, axis=1)
        if residual.max() < greatest:
            greatest, best = float(residual.max()), state
        if greatest < 1e-9:
            break
        weights = weights * residual + 1e-12
        weights /= weights.sum()
    return greatest, best


def reachable_rates(com: Array, fps: float, tolerance: float) -> tuple[float, float] | None:
    """Interval of rates σ at which some free fall stays within a distance of the flight, or None.

    The smallest distance is convex in 1/σ², since distances are jointly convex in the fall's parameters and 1/σ². So
    its minimum is found by ternary search, and the two crossings of the tolerance by bisection.

    Parameters
    ----------
    com, fps
        As in `fit_free_fall`.
    tolerance : float
        Largest distance [m].

    Returns
    -------
    (float, float) or None
        Smallest and largest rate; the largest is infinite for a flight that is straight within the tolerance.
    """

    def fall_distance(inverse: float) -> float:
        return fit_free_fall(com, fps, 1.0 / np.sqrt(max(inverse, 1e-9)))[0]

    duration = (len(com) - 1) / fps
    low, high = 0.0, 16.0 * (np.ptp(com[:, 2]) + tolerance) / (GRAVITY * duration**2) + 1.0
    top = high
    for _ in range(20):
        first, second = low + (high - low) / 3.0, high - (high - low) / 3.0
        if fall_distance(first) < fall_distance(second):
            high = second
        else:
            low = first
    bottom = (low + high) / 2.0
    if fall_distance(bottom) > tolerance:
        return None

    def crossing(inside: float, outside: float) -> float:
        for _ in range(20):
            middle = (inside + outside) / 2.0
            inside, outside = (middle, outside) if fall_distance(middle) <= tolerance else (inside, middle)
        return inside

    slowest = crossing(bottom, 2.0 * top)
    fastest = 0.0 if fall_distance(0.0) <= tolerance else crossing(bottom, 0.0)
    return float(1.0 / np.sqrt(slowest)), float(1.0 / np.sqrt(fastest)) if fastest > 0.0 else np.inf
