"""Force laws on CasADi symbols, built from the same kernels that the servo executes."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import casadi

from controllers.certificates.loop.device import FUNCTIONS_KEPT, Device, Symbol, matrix, vector
from controllers.curves.trajectory import PIECE, piece_acceleration, piece_point, piece_velocity
from controllers.fields.algebra.weights import window
from controllers.fields.bunny import gaussian
from controllers.fields.follow import follow_force, parallel_pace
from controllers.fields.stretchy_tubes import stretch_force


class SymbolicLaw(NamedTuple):
    """A force law on symbols.

    Attributes
    ----------
    force : callable
        ``force(p, v, piece, u, k_r, b_d, width)`` in H: the curve's piece as 28 coefficients, the phase u in it [s],
        and `width` = 1/ε² or 1/δ² [1/m²]. Linear in k_r and b_d.
    slides : bool
        Whether there are neutral displacements, which cause no restoring force: for a law that carries the hand, the
        displacement along the curve.
    carries : bool
        Whether the hand is driven along the curve; otherwise it comes to rest.
    parallel : float
        ρ of a flow along parallel curves (`controllers.fields.follow.Follow`), else 0.
    """

    force: Callable[..., Symbol]
    slides: bool
    carries: bool
    parallel: float = 0.0


def nearest_phase(p: Symbol, piece: Symbol, u: Symbol) -> Symbol:
    """t* as a function of p: one Newton step from the nearest phase u, which is exact in value and first derivative."""
    slope = casadi.dot(vector(piece_point.py_func(piece, 0, u)) - p, vector(piece_velocity.py_func(piece, 0, u)))
    return u - slope / casadi.jacobian(slope, u)


@dataclass(frozen=True)
class FollowForce:
    """Force of FOLLOW, attracted by the nearest point; a parallel flow within the distance at which γ is not clamped.

    Attributes
    ----------
    parallel : float
        As in `SymbolicLaw`.
    """

    parallel: float

    def __call__(
        self, p: Symbol, v: Symbol, piece: Symbol, u: Symbol, k_r: Symbol, b_d: Symbol, width: Symbol
    ) -> Symbol:
        """The force, with the arguments of `SymbolicLaw.force`."""
        nearest, pace = nearest_phase(p, piece, u), 1.0
        p_curve, v_curve = piece_point.py_func(piece, 0, nearest), piece_velocity.py_func(piece, 0, nearest)
        if self.parallel > 0.0:
            abreast = parallel_pace.py_func(p, p_curve, v_curve, piece_acceleration.py_func(piece, 0, nearest))
            pace = 1.0 + self.parallel * (abreast - 1.0)
        w = window.py_func(casadi.sumsqr(vector(p_curve) - p) * width)
        return w * vector([follow_force.py_func(p[i], v[i], p_curve[i], pace * v_curve[i], k_r, b_d) for i in range(3)])


def _bunny(p: Symbol, v: Symbol, piece: Symbol, u: Symbol, k_r: Symbol, b_d: Symbol, width: Symbol) -> Symbol:
    """Bunny in its point form, in which the attractor does not depend on the hand."""
    p_curve, v_curve = piece_point.py_func(piece, 0, u), piece_velocity.py_func(piece, 0, u)
    pull = gaussian.py_func(casadi.sumsqr(vector(p_curve) - p), width)
    return pull * vector([follow_force.py_func(p[i], v[i], p_curve[i], v_curve[i], k_r, b_d) for i in range(3)])


def _seek(p: Symbol, v: Symbol, piece: Symbol, u: Symbol, k_f: Symbol, b: Symbol, width: Symbol) -> Symbol:
    """Stretchy tubes with the switch open: attracted by the nearest point, and damped."""
    target = piece_point.py_func(piece, 0, nearest_phase(p, piece, u))
    return vector([stretch_force.py_func(p[i], v[i], target[i], k_f, b) for i in range(3)])


def _hold(p: Symbol, v: Symbol, piece: Symbol, u: Symbol, k_s: Symbol, b: Symbol, width: Symbol) -> Symbol:
    """Stretchy tubes with the switch closed: attracted by the grasped point, independently of the curve."""
    target = piece_point.py_func(piece, 0, u)
    return vector([stretch_force.py_func(p[i], v[i], target[i], k_s, b) for i in range(3)])


def follow_law(parallel: float) -> SymbolicLaw:
    """FOLLOW with the share ρ of a parallel flow; 0 for the paper's."""
    return SymbolicLaw(FollowForce(parallel), slides=True, carries=True, parallel=parallel)


FOLLOW_LAW = follow_law(0.0)
BUNNY_LAW = SymbolicLaw(_bunny, slides=False, carries=True)
SEEK_LAW = SymbolicLaw(_seek, slides=True, carries=False)
HOLD_LAW = SymbolicLaw(_hold, slides=False, carries=False)
LAWS = {"follow": FOLLOW_LAW, "bunny": BUNNY_LAW, "seek": SEEK_LAW, "hold": HOLD_LAW}


@lru_cache(FUNCTIONS_KEPT)
def torque_function(device: Device, law: SymbolicLaw) -> Any:
    """CasADi function (θ, ω, piece, u, k_r, b_d, width) → torques τ = J(θ)ᵀ F + N(θ), and their derivatives by θ, ω.

    ω are the filtered rates, independent of θ: the force is F(p(θ), J(θ) ω).
    """
    theta, omega, piece = casadi.SX.sym("theta", 3), casadi.SX.sym("omega", 3), casadi.SX.sym("piece", PIECE)
    u, k_r, b_d, width = (casadi.SX.sym(name) for name in ("u", "k_r", "b_d", "width"))
    jacobian = matrix(device.jacobian(theta))
    force = law.force(vector(device.position(theta)), jacobian @ omega, piece, u, k_r, b_d, width)
    torque = jacobian.T @ force + vector(device.gravity(theta))
    return casadi.Function(
        "torque",
        [theta, omega, piece, u, k_r, b_d, width],
        [torque, casadi.jacobian(torque, theta), casadi.jacobian(torque, omega)],
    )
