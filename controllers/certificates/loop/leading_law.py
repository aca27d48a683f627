r"""LEADING on CasADi symbols, built from the executed kernels: linear regimes, with the walker as part of the state.

The force is a spring outside dead bands, so it is piecewise linear. Each regime is one linear piece, linearised at the
edge of the dead bands, where the force is zero; a constant force of the hand would not change the derivatives.

.. math:: F = -k_l\,(\alpha\,t t^T + \beta\,n (n - c\,t)^T)\,\delta p - k_z\,\delta z\,e_z - b\,v

α is 1 where the stylus is farther along the path than the figure can follow; β is 1 where it is farther to the side
than the path can reach; c is κ_max times the distance beyond the path's front, by which the room to the sides grows.
k_z is scaled with k_l.
"""

from typing import NamedTuple

import casadi
import numpy as np

from controllers.certificates.loop.device import Symbol, vector
from controllers.certificates.loop.laws import SymbolicLaw
from controllers.certificates.loop.sampled_loop import UNDELAYED_SIZE, SampledLoop
from controllers.curves.trajectory import piece_point, piece_velocity
from controllers.fields.leading import LeadingGains, PathPoint, leading_force
from controllers.walking.walker import walker_acceleration
from geometry.arrays import Array

_EDGE_OFFSET = 1e-9  # [m] on the floor: distance from the edge, on the side where the spring acts
_INACTIVE_WIDTH = 10.0  # [m] width of a dead band for a spring that does not act


class Regime(NamedTuple):
    """A linear regime of LEADING's dead bands, and the direction of the path.

    Attributes
    ----------
    ahead, aside : bool
        Whether the springs along and across the path act: α and β.
    beyond : bool
        Whether the stylus is beyond the path's front; otherwise it is on the path.
    turn : float
        c, with the sign of the side; 1 m beyond the front and κ_max = 1/m give 1.
    heading : float
        Heading of the path relative to the curve along which the loop is linearised [rad].
    """

    ahead: bool
    aside: bool
    beyond: bool = False
    turn: float = 0.0
    heading: float = 0.0

    def tangent(self, way: Symbol) -> tuple[Symbol, Symbol]:
        """Tangent t of the path in the plane, for a direction of the curve."""
        x, y = way[0], way[1]
        size = (x * x + y * y) ** 0.5
        c, s = np.cos(self.heading), np.sin(self.heading)
        return (c * x - s * y) / size, (s * x + c * y) / size

    def law(self, scale: float, upright: float) -> SymbolicLaw:
        """The law in this regime; `scale` is S, `upright` is k_z/k_l."""

        def force(p: Symbol, v: Symbol, piece: Symbol, u: Symbol, k_l: Symbol, b: Symbol, width: Symbol) -> Symbol:
            here = piece_point.py_func(piece, 0, u)
            c, s = self.tangent(piece_velocity.py_func(piece, 0, u))
            advance = scale * (c * (p[0] - here[0]) + s * (p[1] - here[1]))
            # On the path, the nearest point moves along with the stylus, and there is no room to the sides.
            along = 0.0 if self.beyond else advance
            room = self.turn * advance - _EDGE_OFFSET if self.aside else _INACTIVE_WIDTH
            path = PathPoint(scale * here[0] + c * along, scale * here[1] + s * along, c, s, along, room)
            lead = -_EDGE_OFFSET if self.ahead else _INACTIVE_WIDTH
            gains = LeadingGains(k_l, b, upright * k_l, scale, lead, lead_back=_INACTIVE_WIDTH)
            return vector([*leading_force.py_func(p, v, path, gains)])

        return SymbolicLaw(force, slides=not (self.ahead and self.aside), carries=False)


def walking(loop: SampledLoop, regime: Regime, scale: float, rate: float, k_l: float, b: float) -> Array:
    """State matrices of a period with the walker as state, without the neutral displacements, shape (n, r, r).

    The walker (s, ṡ) steps before the force is evaluated, as in the servo: ṡ⁺ = ṡ + T s̈, s⁺ = s + T ṡ⁺, and s⁺ changes
    the spring force along the path by k_l s⁺/S. A joint displacement of stylus and walker along the path is neutral.

    Parameters
    ----------
    loop : SampledLoop
        Loop linearised in a regime in which the spring along the path acts and c is 0.
    regime : Regime
        That regime.
    scale, rate : float
        S and ω [1/s].
    k_l, b : float
        Stiffness [N/m] and damping [N s/m].
    """
    linear, period, size = loop.linear, loop.sampling.period, loop.size
    n = len(linear.phases)
    direction = np.zeros((n, 3))
    direction[:, 0], direction[:, 1] = regime.tangent(linear.velocity.T)
    goal = scale * np.einsum("ni,nij->nj", direction, linear.jacobian)
    walker: Symbol = casadi.SX.sym("walker", 2)
    slope = casadi.jacobian(walker_acceleration.py_func(walker[0], walker[1], rate), walker)
    by_lag, by_speed = (float(value) for value in np.ravel(casadi.evalf(slope)))
    next_speed = np.array([-period * by_lag, 1.0 + period * by_speed])
    steps = np.zeros((n, 2, size + 2))
    steps[:, :, :3] = np.array([[period * period], [period]]) * by_lag * goal[:, None]
    steps[:, :, size:] = np.array([1.0, 0.0]) + period * next_speed, next_speed
    pull_response = loop.fresh @ (k_l / scale * np.einsum("nij,ni->nj", linear.jacobian, direction))[:, :, None]
    maps = np.zeros((n, size + 2, size + 2))
    maps[:, :size, :size] = loop.matrices(k_l, b)
    maps[:, :size] += pull_response @ steps[:, :1]
    maps[:, size:] = steps
    if linear.held:
        return maps
    shift = np.zeros((n, size + 2, linear.shift.shape[2] + 1))
    joints = np.linalg.solve(linear.jacobian, direction[:, :, None])
    weight = np.tile(linear.weight_theta @ joints, (1, (size - UNDELAYED_SIZE) // 3, 1))
    shift[:, :size, :-1] = loop.shifts
    shift[:, 0:3, -1:], shift[:, 6:9, -1:], shift[:, UNDELAYED_SIZE:size, -1:] = joints, joints, weight
    shift[:, size, -1] = scale
    basis = np.linalg.qr(shift, mode="complete")[0][:, :, shift.shape[2] :]
    return basis.transpose(0, 2, 1) @ maps @ basis
