"""Model of a device for the certificates: kinematics and dynamics from the device's kernels, friction and limits."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi

from controllers.state import Vec3
from geometry.arrays import Array
from geometry.vectors import Triple

casadi.GlobalOptions.setNumpyMode(1)

Symbol = Any  # casadi.SX: the library is untyped
FUNCTIONS_KEPT = 4  # CasADi functions of devices and laws: a certificate evaluates the same ones for every hand


@dataclass(frozen=True, eq=False)
class Device:
    r"""Force-feedback arm with three motors: kernels that accept CasADi symbols, and its friction and limits.

    .. math:: M(\theta)\ddot\theta + C(\theta, \dot\theta)\dot\theta + D\dot\theta + f_c\,\mathrm{sign}\,\dot\theta
              + N(\theta) = \tau + J(\theta)^T F

    Parameters
    ----------
    position : callable
        p_H(θ) [m]: three scalars.
    jacobian : callable
        J = ∂p_H/∂θ: three rows of three [m/rad].
    mass, coriolis, gravity : callable
        M(θ), C(θ, θ̇) as three rows of three, N(θ) as three scalars [SI].
    angles : callable
        Inverse kinematics: θ [rad] of a point in H [m]; numbers only.
    viscous, coulomb : three floats
        Friction D [N m s/rad] and f_c [N m] at the joints.
    encoder_step : three floats
        Encoder resolution Δ at the joints [rad].
    peak_torque : three floats
        Largest motor torques at the joints [N m].
    numbers : callable
        θ (3,) → p_H (3,) [m], J (3, 3) [m/rad]; numbers only.
    """

    position: Callable[[Symbol], tuple[Symbol, ...]]
    jacobian: Callable[[Symbol], tuple[tuple[Symbol, ...], ...]]
    mass: Callable[[Symbol], tuple[tuple[Symbol, ...], ...]]
    coriolis: Callable[[Symbol, Symbol], tuple[tuple[Symbol, ...], ...]]
    gravity: Callable[[Symbol], tuple[Symbol, ...]]
    angles: Callable[[Vec3], Triple]
    viscous: Triple
    coulomb: Triple
    encoder_step: Triple
    peak_torque: Triple
    numbers: Callable[[Array], tuple[Array, Array]]


def vector(scalars: Any) -> Symbol:
    """Column of scalars."""
    return casadi.vertcat(*scalars)


def matrix(rows: Any) -> Symbol:
    """Matrix of rows of scalars."""
    return casadi.vertcat(*(casadi.horzcat(*row) for row in rows))


@lru_cache(FUNCTIONS_KEPT)
def kinematics_function(device: Device) -> Any:
    """CasADi function (θ, θ̇) → J, J̇ θ̇, in H."""
    theta, rate = casadi.SX.sym("theta", 3), casadi.SX.sym("rate", 3)
    jacobian = matrix(device.jacobian(theta))
    return casadi.Function("kinematics", [theta, rate], [jacobian, casadi.jtimes(jacobian @ rate, theta, rate)])


@lru_cache(FUNCTIONS_KEPT)
def plant_function(device: Device) -> Any:
    """CasADi function (θ, θ̇, θ̈, p_d, v_d, [m, b, k]) → mass matrix of linkage and hand, ∂ID/∂θ, ∂ID/∂θ̇, ∂N/∂θ.

    ID is the inverse dynamics, including viscous friction and hand: the joint torques that a motion needs.
    """
    theta, rate, turn = (casadi.SX.sym(name, 3) for name in ("theta", "rate", "turn"))
    p_d, v_d, hand = (casadi.SX.sym(name, 3) for name in ("p_d", "v_d", "hand"))
    jacobian = matrix(device.jacobian(theta))
    velocity = jacobian @ rate
    weight = vector(device.gravity(theta))
    linkage_mass = matrix(device.mass(theta))
    acceleration = jacobian @ turn + casadi.jtimes(velocity, theta, rate)
    hand_force = hand[0] * acceleration + hand[1] * (velocity - v_d) + hand[2] * (vector(device.position(theta)) - p_d)
    torque = (
        linkage_mass @ turn
        + matrix(device.coriolis(theta, rate)) @ rate
        + casadi.DM(device.viscous) * rate
        + weight
        + jacobian.T @ hand_force
    )
    return casadi.Function(
        "plant",
        [theta, rate, turn, p_d, v_d, hand],
        [
            casadi.jacobian(torque, turn),
            casadi.jacobian(torque, theta),
            casadi.jacobian(torque, rate),
            casadi.jacobian(weight, theta),
        ],
    )
