"""FOLLOW: a spring to the curve plus a damper to its tangent velocity (Donald & Henle 2000, section 4)."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from controllers.checks import check_field_types, checked
from controllers.curves.closest_point import closest_phase
from controllers.curves.trajectory import Trajectory, curve_acceleration, curve_point, curve_velocity
from controllers.errors import ParameterError
from controllers.fields.algebra.instructions import write_trace
from controllers.fields.algebra.law import Law, Program
from controllers.fields.algebra.weights import window
from controllers.state import HAND_POSITION, HAND_VELOCITY
from geometry.arrays import Array


@njit
def follow_force(p: float, v: float, p_curve: float, v_curve: float, k_r: float, b_d: float) -> float:
    """F = k_r (φ − p) + b_d (φ̇ − v), one component of each in H, or whole vectors."""
    return k_r * (p_curve - p) + b_d * (v_curve - v)


PACE_RANGE = (0.5, 1.5)
"""Smallest and largest γ of a parallel flow, reached half a radius of curvature off the curve; bounds its power."""


@njit
def parallel_pace(
    p: Array,
    p_curve: tuple[float, float, float],
    v_curve: tuple[float, float, float],
    a_curve: tuple[float, float, float],
) -> float:
    """γ = 1 − (p − φ)·φ̈/|φ̇|²: speed, relative to the curve's, of a point off it that keeps abreast of the curve."""
    bend = (p[0] - p_curve[0]) * a_curve[0] + (p[1] - p_curve[1]) * a_curve[1] + (p[2] - p_curve[2]) * a_curve[2]
    return 1.0 - bend / (v_curve[0] ** 2 + v_curve[1] ** 2 + v_curve[2] ** 2)


class FollowGains(NamedTuple):
    """Parameters of `follow_wrench`: k_r [N/m], b_d [N s/m], 1/ε² [1/m²], and ρ of a parallel flow, else 0."""

    k_r: float
    b_d: float
    inverse_square: float
    parallel: float


@njit
def follow_gains(params: Array, at: int) -> FollowGains:
    """Gains stored at ``params[at:]``."""
    return FollowGains(params[at], params[at + 1], params[at + 2], params[at + 3])


@njit
def follow_at(
    gains: FollowGains, params: Array, curve: int, guess: float, p: Array, v: Array, wrench: Array
) -> tuple[float, float]:
    """Write the wrench at position p [m] and velocity v [m/s]; returns t* [s] and the distance [m]."""
    phase, distance = closest_phase(params, curve, p[0], p[1], p[2], guess)
    p_curve, v_curve = curve_point(params, curve, phase), curve_velocity(params, curve, phase)
    w, pace = window(distance * distance * gains.inverse_square), 1.0
    if gains.parallel != 0.0 and v_curve != (0.0, 0.0, 0.0):
        pace = parallel_pace(p, p_curve, v_curve, curve_acceleration(params, curve, phase))
        pace = min(max(1.0 + gains.parallel * (pace - 1.0), PACE_RANGE[0]), PACE_RANGE[1])
    for i in range(3):
        wrench[i] = w * follow_force(p[i], v[i], p_curve[i], pace * v_curve[i], gains.k_r, gains.b_d)
        wrench[i + 3] = 0.0
    return phase, distance


@njit
def follow_wrench(params: Array, at: int, curve: int, memory: Array, slot: int, hand: Array, wrench: Array) -> None:
    """Kernel of `Follow`: parameters `FollowGains`, memory [t*]."""
    p, v = hand[HAND_POSITION : HAND_POSITION + 3], hand[HAND_VELOCITY : HAND_VELOCITY + 3]
    phase, distance = follow_at(follow_gains(params, at), params, curve, memory[slot], p, v, wrench)
    memory[slot] = phase
    write_trace(params, curve, memory, phase, distance, phase)


@dataclass(frozen=True, eq=False)
class Follow(Law):
    r"""River force: carries a free stylus along the curve, and yields to the hand.

    .. math:: F = w(d/\varepsilon)\,\bigl(k_r\,(\varphi(t^*) - p) + b_d\,(\gamma\dot\varphi(t^*) - \dot p)\bigr)

    t* is the phase of the curve's point nearest to the hand, d its distance, w the C² `window`. F is continuous in
    p wherever the nearest point is unique: within `Trajectory.reach` of the curve, and farther out off the medial
    axis. Where two points are equally near, the one found first is kept; beyond ε there is no force. Past an end of an
    open curve t* stays at that end.

    γ is 1, as in the paper. A hand that is pushed to the outside of a bend then takes longer for the same angle: its
    t* advances at :math:`\dot t^* = \dot p\cdot\dot\varphi\,/\,(|\dot\varphi|^2 - (p - \varphi)\cdot\ddot\varphi)`. A
    *parallel* flow has γ = 1 − ρ (p − φ)·φ̈/|φ̇|², with ρ = 1 the speed along the parallel curve through p (1 − κe in
    path following: Samson 1995), with which t* advances at rate 1 on either side; γ is clamped between 0.5 and 1.5.
    Where φ is timed faster than the hand shall go, to compensate for friction, 1 − ρ is that part of its speed:
    friction does not grow with the radius.

    Parameters
    ----------
    curve : Trajectory
        φ, in the hand frame H.
    k_r : float
        Radial stiffness [N/m].
    b_d : float
        Tangential damping [N s/m].
    epsilon : float
        ε, radius of the tube [m], may be infinite. The default is about the radius of the workspace: the field reaches
        everywhere and is hardly weakened near the curve (2 % at 2 cm).
    parallel : bool
        Whether the flow is parallel, so that a hand that is pushed off the curve keeps its pace.
    compensation : float
        1 − ρ: share of the curve's speed that compensates for friction, from 0 to below 1; for a parallel flow only.

    Raises
    ------
    ParameterError
        If a gain is negative or not finite, ε below 1e-4 m, or the compensation out of its interval.
    """

    curve: Trajectory
    k_r: float
    b_d: float
    epsilon: float = 0.25
    parallel: bool = False
    compensation: float = 0.0

    def __post_init__(self) -> None:
        check_field_types(self)
        checked("k_r", self.k_r, "N/m")
        checked("b_d", self.b_d, "N s/m")
        checked("epsilon", self.epsilon, "m", least=1e-4, infinite=True)
        if checked("compensation", self.compensation, "") >= 1.0:
            raise ParameterError(f"compensation must be below 1, got {self.compensation:g}")

    def _compose(self) -> Program:
        return Program.of(self, follow_wrench, self.gains, [np.nan], self.curve)

    @property
    def gains(self) -> FollowGains:
        """Parameters of the kernel."""
        return FollowGains(self.k_r, self.b_d, self.epsilon**-2, self.parallel_share)

    @property
    def parallel_share(self) -> float:
        """ρ of a parallel flow, and 0 of the paper's."""
        return (1.0 - self.compensation) * self.parallel
