"""The governor: a force that resists playing a motion slower or faster than is physically feasible."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from controllers.checks import check_field_types, checked
from controllers.curves.closest_point import closest_phase
from controllers.curves.trajectory import END, START, Trajectory, curve_velocity
from controllers.fields.admissible import admissible_speeds, checked_speeds
from controllers.fields.algebra.instructions import write_trace
from controllers.fields.algebra.law import Law, Program
from controllers.fields.algebra.weights import window
from controllers.state import HAND_POSITION, HAND_VELOCITY
from geometry.arrays import Array

_SPEEDS_OFFSET = 3  # offset of the pairs of speeds, which follow `GovernorGains`


class GovernorGains(NamedTuple):
    """Parameters of `governor_wrench`: b [N s/m], 1/ε² [1/m²], and the number of pairs of speeds that follow."""

    drag: float
    inverse_square: float
    rows: float


@njit
def governor_force(speed: float, least: float, greatest: float, drag: float) -> float:
    """Force along the curve, b (⟨v_min − s⟩ − ⟨s − v_max⟩) [N], for a hand speed s along the curve; speeds in m/s."""
    return drag * (np.maximum(0.0, least - speed) - np.maximum(0.0, speed - greatest))


@njit
def governor_wrench(params: Array, at: int, curve: int, memory: Array, slot: int, hand: Array, wrench: Array) -> None:
    """Kernel of `Governor`: parameters `GovernorGains` and the speeds, memory [t*]."""
    gains = GovernorGains(params[at], params[at + 1], params[at + 2])
    p, v = hand[HAND_POSITION : HAND_POSITION + 3], hand[HAND_VELOCITY : HAND_VELOCITY + 3]
    phase, distance = closest_phase(params, curve, p[0], p[1], p[2], memory[slot])
    memory[slot] = phase
    x, y, z = curve_velocity(params, curve, phase)
    # Where the curve's velocity is zero it has no direction; the bound then makes the force zero.
    pace = max(np.sqrt(x * x + y * y + z * z), 1e-12)
    share = (phase - params[curve + START]) / (params[curve + END] - params[curve + START])
    least, greatest = admissible_speeds(params, at + _SPEEDS_OFFSET, int(gains.rows), share)
    speed = (v[0] * x + v[1] * y + v[2] * z) / pace
    force = governor_force(speed, least, greatest, gains.drag)
    force *= window(distance * distance * gains.inverse_square) / pace
    wrench[0], wrench[1], wrench[2] = force * x, force * y, force * z
    wrench[3:] = 0.0
    write_trace(params, curve, memory, phase, distance, phase)


@dataclass(frozen=True, eq=False)
class Governor(Law):
    r"""Force that keeps a hand's speed along a curve within the speeds that the animated motion admits.

    .. math:: F = w(d/\varepsilon)\,b\,\bigl(\langle v_{min} - s\rangle - \langle s - v_{max}\rangle\bigr)\,
              \frac{\dot\varphi}{|\dot\varphi|}, \qquad s = \dot p \cdot \frac{\dot\varphi}{|\dot\varphi|},
              \quad \langle x \rangle = \max(0, x)

    at t*, the phase of the curve's point nearest to the hand, with d its distance and w the C² `window`. Inside
    [v_min, v_max] there is no force, at its ends the force is continuous, and outside it is viscous drag on the excess
    speed. It does not hold the hand to the curve by itself: add it to a field that does.

    Parameters
    ----------
    curve : Trajectory
        φ, in the hand frame H.
    speeds : array_like, shape (m, 2)
        v_min and v_max [m/s] at m phases equally spaced from the curve's start to its end, linear between them, as in
        `River.speeds`; `controllers.certificates.flight.rate_bounds.RateBounds.stylus_speed` computes them.
    drag : float
        b [N s/m].
    epsilon : float
        ε, radius of the tube [m], may be infinite.

    Raises
    ------
    ParameterError
        If b is negative or not finite, ε below 1e-4 m, or the speeds are not pairs 0 ≤ v_min ≤ v_max.
    """

    curve: Trajectory
    speeds: npt.ArrayLike
    drag: float = 8.0
    epsilon: float = 0.25

    def __post_init__(self) -> None:
        check_field_types(self)
        checked("drag", self.drag, "N s/m")
        checked("epsilon", self.epsilon, "m", least=1e-4, infinite=True)
        object.__setattr__(self, "speeds", checked_speeds("governor", self.speeds))

    def _compose(self) -> Program:
        speeds = np.asarray(self.speeds)
        numbers = np.concatenate([GovernorGains(self.drag, self.epsilon**-2, len(speeds)), speeds.ravel()])
        return Program.of(self, governor_wrench, numbers, [np.nan], self.curve)
