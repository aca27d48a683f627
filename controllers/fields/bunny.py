"""The bunny: a moving attractor on the curve, felt only in its neighbourhood (Donald & Henle 2000, section 7.3)."""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numba import njit

from controllers.checks import check_field_types, checked
from controllers.curves.closest_point import closest_phase
from controllers.curves.trajectory import START, Trajectory, curve_point, curve_velocity, wrap_phase
from controllers.fields.algebra.instructions import write_trace
from controllers.fields.algebra.law import Law, Program
from controllers.fields.follow import follow_force
from controllers.state import HAND_POSITION, HAND_TIME, HAND_VELOCITY, MAX_TIME_STEP
from geometry.arrays import Array


@njit
def gaussian(square: float, inverse_square: float) -> float:
    """G_δ = exp(−|p − φ|²/2δ²), 1 on the bunny, from the squared distance and 1/δ²."""
    return np.exp(-0.5 * square * inverse_square)


@njit
def _squared_distance(params: Array, curve: int, phase: float, p: Array) -> float:
    x, y, z = curve_point(params, curve, phase)
    return (x - p[0]) ** 2 + (y - p[1]) ** 2 + (z - p[2]) ** 2


_NEAREST_PHASE, _BUNNY_PHASE, _LAST_TIME, _MEMORY_SIZE = range(4)  # t*, t_b, time of the last tick [s]


class BunnyGains(NamedTuple):
    """Parameters of `bunny_wrench`: k_r [N/m], b_d [N s/m], 1/δ² [1/m²], flags for attraction "along", pace "wait"."""

    k_r: float
    b_d: float
    inverse_square: float
    along: float
    waits: float


@njit
def bunny_wrench(params: Array, at: int, curve: int, memory: Array, slot: int, hand: Array, wrench: Array) -> None:
    """Kernel of `Bunny`: parameters `BunnyGains`, memory see `_NEAREST_PHASE`."""
    p, v = hand[HAND_POSITION : HAND_POSITION + 3], hand[HAND_VELOCITY : HAND_VELOCITY + 3]
    gains = BunnyGains(params[at], params[at + 1], params[at + 2], params[at + 3], params[at + 4])
    time = hand[HAND_TIME]
    phase, distance = closest_phase(params, curve, p[0], p[1], p[2], memory[slot + _NEAREST_PHASE])
    memory[slot + _NEAREST_PHASE] = phase
    if gains.waits == 0.0:
        bunny = params[curve + START] + time
    elif np.isnan(memory[slot + _BUNNY_PHASE]):
        bunny = phase
    else:
        pace = gaussian(_squared_distance(params, curve, memory[slot + _BUNNY_PHASE], p), gains.inverse_square)
        bunny = memory[slot + _BUNNY_PHASE] + pace * min(max(time - memory[slot + _LAST_TIME], 0.0), MAX_TIME_STEP)
    bunny = wrap_phase(params, curve, bunny)
    memory[slot + _BUNNY_PHASE], memory[slot + _LAST_TIME] = bunny, time
    pull = gaussian(_squared_distance(params, curve, bunny, p), gains.inverse_square)
    target = phase if gains.along > 0.0 else bunny
    p_curve, v_curve = curve_point(params, curve, target), curve_velocity(params, curve, target)
    for i in range(3):
        wrench[i] = pull * follow_force(p[i], v[i], p_curve[i], v_curve[i], gains.k_r, gains.b_d)
        wrench[i + 3] = 0.0
    write_trace(params, curve, memory, phase, distance, bunny)


class WeightedGains(NamedTuple):
    """Weighted form of a bunny: k_r [N/m], b_d [N s/m], δ [m]."""

    k_r: float
    b_d: float
    delta: float


def felt_bunny(k_r: float, b_d: float, delta: float, attraction: str) -> WeightedGains:
    """Gains of the weighted form that is executed: those given, or for "convolution" its closed form."""
    if attraction != "convolution":
        return WeightedGains(k_r, b_d, delta)
    return WeightedGains(k_r * 2.0**-2.5, b_d * 2.0**-1.5, delta * 2.0**0.5)


@dataclass(frozen=True, eq=False)
class Bunny(Law):
    r"""Attractor φ(t_b) that moves along the curve at its own pace and pulls a nearby hand.

    .. math:: L = G_\delta(p - \varphi(t_b))\,\bigl(k_r\,(\varphi(s) - p) + b_d\,(\dot\varphi(s) - \dot p)\bigr)

    with G_δ(x) = exp(−|x|²/2δ²). The paper writes L = F ∗ G_δ(φ(t)); we read this as the field F weighted by the
    Gaussian about the bunny. "convolution" is the form "point", felt within δ, convolved with the normalised Gaussian:

    .. math:: L = \int G_\delta(q - \varphi)\,\bigl(k_r (\varphi - q) + b_d (\dot\varphi - \dot p)\bigr)\,
              \frac{G_\delta(p - q)}{(2\pi\delta^2)^{3/2}}\,d^3q
              = G_{\sqrt2\delta}(p - \varphi)\,\Bigl(\tfrac{k_r}{2^{5/2}} (\varphi - p)
              + \tfrac{b_d}{2^{3/2}} (\dot\varphi - \dot p)\Bigr)

    so it is the weighted form with other gains (`felt`); the spring alone, unweighted, is its own convolution. As
    δ → ∞ the form "along" tends to the static field of `Follow` with ε = ∞, the form "point" to a spring and damper to
    the moving point.

    Parameters
    ----------
    curve : Trajectory
        φ, in the hand frame H.
    k_r : float
        Stiffness [N/m].
    b_d : float
        Damping [N s/m].
    delta : float
        δ, standard deviation of the Gaussian about the bunny [m]; may be infinite.
    attraction : {"point", "along", "convolution"}
        "point": to the bunny itself (s = t_b); "along": FOLLOW's force towards the nearest point of the curve and along
        it (s = t*); "convolution": to the bunny, convolved with the Gaussian.
    pace : {"clock", "wait"}
        "clock": t_b is the hand's time. "wait": t_b starts at the phase nearest to the hand and advances at the rate
        G_δ, so the bunny waits for a hand that is held back.

    Raises
    ------
    ParameterError
        If a gain is negative or not finite, δ below 1e-4 m, or a form or pace is unknown.
    """

    curve: Trajectory
    k_r: float
    b_d: float
    delta: float
    attraction: Literal["point", "along", "convolution"] = "point"
    pace: Literal["clock", "wait"] = "wait"

    def __post_init__(self) -> None:
        check_field_types(self)
        checked("k_r", self.k_r, "N/m")
        checked("b_d", self.b_d, "N s/m")
        checked("delta", self.delta, "m", least=1e-4, infinite=True)

    @property
    def felt(self) -> WeightedGains:
        """Gains of the weighted form that is executed."""
        return felt_bunny(self.k_r, self.b_d, self.delta, self.attraction)

    def _compose(self) -> Program:
        along, waits, felt = float(self.attraction == "along"), float(self.pace == "wait"), self.felt
        gains = BunnyGains(felt.k_r, felt.b_d, felt.delta**-2, along, waits)
        return Program.of(self, bunny_wrench, gains, [np.nan] * _MEMORY_SIZE, self.curve)
