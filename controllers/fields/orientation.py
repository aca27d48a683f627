"""Orientation along a curve, and the field that aligns the stylus with it: a rotational spring and damper."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from controllers.checks import check_field_types, checked
from controllers.curves.closest_point import closest_phase
from controllers.curves.trajectory import BREAKS, COEFFICIENTS, PIECE, Trajectory, find_piece, wrap_phase
from controllers.fields.algebra.instructions import write_trace
from controllers.fields.algebra.law import Law, Program
from controllers.fields.algebra.window import window
from controllers.state import HAND_ANGULAR_VELOCITY, HAND_POSITION, HAND_QUATERNION
from controllers.work_array import work_array
from geometry.arrays import Array
from geometry.rotations import logarithm, multiply
from geometry.vectors import Quaternion, Vector


@njit
def curve_orientation(blob: Array, at: int, t: float) -> tuple[Quaternion, Vector]:
    """Orientation R_H(t), unit quaternion wxyz, and its angular velocity ω_H [rad/s], of the curve at ``blob[at:]``.

    With s the spline through the quaternions, q = s/|s| and ω = 2 Im(ṡ ⊗ s*)/|s|². Where the phase of an open curve is
    clamped to an end, ω is that at the end, as for `curve_velocity`.
    """
    t = wrap_phase(blob, at, t)
    piece = find_piece(blob, at, t)
    u = t - blob[at + int(blob[at + BREAKS]) + piece]
    row = at + int(blob[at + COEFFICIENTS]) + piece * PIECE + 3
    s, d = work_array(4), work_array(4)
    for k in range(4):
        a, b, c, e = blob[row + k], blob[row + 7 + k], blob[row + 14 + k], blob[row + 21 + k]
        s[k], d[k] = a + u * (b + u * (c + u * e)), b + u * (2.0 * c + 3.0 * u * e)
    square = s[0] * s[0] + s[1] * s[1] + s[2] * s[2] + s[3] * s[3]
    _, x, y, z = multiply(d[0], d[1], d[2], d[3], s[0], -s[1], -s[2], -s[3])
    scale, rate = 1.0 / np.sqrt(square), 2.0 / square
    return (scale * s[0], scale * s[1], scale * s[2], scale * s[3]), (rate * x, rate * y, rate * z)


class OrientationGains(NamedTuple):
    """Parameters of `orientation_wrench`: k_o [N m/rad], b_o [N m s/rad] and 1/ε² [1/m²]."""

    k_o: float
    b_o: float
    inverse_square: float


@njit
def orientation_wrench(
    params: Array, at: int, curve: int, memory: Array, slot: int, hand: Array, wrench: Array
) -> None:
    """Kernel of `Orientation`: parameters `OrientationGains`, memory [t*]."""
    gains = OrientationGains(params[at], params[at + 1], params[at + 2])
    p, q, w = hand[HAND_POSITION:], hand[HAND_QUATERNION:], hand[HAND_ANGULAR_VELOCITY:]
    phase, distance = closest_phase(params, curve, p[0], p[1], p[2], memory[slot])
    memory[slot] = phase
    (a, b, c, d), spin = curve_orientation(params, curve, phase)
    error = logarithm(*multiply(a, b, c, d, q[0], -q[1], -q[2], -q[3]))
    share = window(distance * distance * gains.inverse_square)
    for i in range(3):
        wrench[i] = 0.0
        wrench[3 + i] = share * (gains.k_o * error[i] + gains.b_o * (spin[i] - w[i]))
    write_trace(params, curve, memory, phase, distance, phase)


@dataclass(frozen=True, eq=False)
class Orientation(Law):
    r"""Moment that turns the stylus to the curve's orientation at the point nearest to the hand; no force.

    .. math:: \tau = w(d/\varepsilon)\,\bigl(k_o \log(R_c R^T) + b_o\,(\omega_c - \omega)\bigr), \qquad R_c = R(t^*)

    All in H; log gives the rotation vector of the shortest turn from R to R_c, so the spring pulls along the geodesic
    of SO(3) and is −grad of ½ k_o α², α the angle between the two. t*, d and the window w are those of FOLLOW, ω_c is
    the curve's angular velocity at t*. τ is finite everywhere, with |log| ≤ π. It is
    discontinuous at α = π, where both ways round are equally short and τ changes its sign, and where t* jumps (the
    medial axis of the curve).

    A device with three motors, such as the Phantom, cannot render a moment: τ is evaluated and recorded (the last
    three numbers of the channel ``field``), and the limiter drops it. A device with six motors would take it as it is.

    Parameters
    ----------
    curve : Trajectory
        φ, in the hand frame H, with its orientations.
    k_o : float
        Rotational stiffness [N m/rad].
    b_o : float
        Rotational damping [N m s/rad].
    epsilon : float
        ε, radius of the tube [m], may be infinite.

    Raises
    ------
    ParameterError
        If a gain is negative or not finite, or ε below 1e-4 m.
    """

    curve: Trajectory
    k_o: float
    b_o: float
    epsilon: float = 0.25

    def __post_init__(self) -> None:
        check_field_types(self)
        checked("k_o", self.k_o, "N m/rad")
        checked("b_o", self.b_o, "N m s/rad")
        checked("epsilon", self.epsilon, "m", least=1e-4, infinite=True)

    def _compose(self) -> Program:
        gains = OrientationGains(self.k_o, self.b_o, self.epsilon**-2)
        return Program.of(self, orientation_wrench, gains, [np.nan], self.curve)
