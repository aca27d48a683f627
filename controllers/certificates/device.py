"""What a certificate knows of a device, a hand and a clock; the device's kernels are handed over by who knows it."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np

from controllers.errors import ParameterError
from controllers.state import Array, Vec3

casadi.GlobalOptions.setNumpyMode(1)

Symbol = Any  # casadi.SX: the library is untyped
Triple = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Device:
    r"""Force-feedback arm with three motors: kernels that evaluate on CasADi symbols, and its friction and limits.

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
        θ [rad] of a point of H; numbers only.
    viscous, coulomb : three floats
        D [N m s/rad] and f_c [N m] at the joints.
    encoder_step : three floats
        Δ at the joints [rad].
    peak_torque : three floats
        [N m].
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


@dataclass(frozen=True)
class HandImpedance:
    """Hand on the stylus tip: F = −m v̇ − b (v − v_d) − k (p − p_d), about a motion (p_d, v_d) of its own.

    Parameters
    ----------
    mass, damping, stiffness : float
        m [kg], b [N s/m], k [N/m]; all zero: no hand.

    Raises
    ------
    ParameterError
        If one is negative or not finite.
    """

    mass: float = 0.0
    damping: float = 0.0
    stiffness: float = 0.0

    def __post_init__(self) -> None:
        for name in ("mass", "damping", "stiffness"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ParameterError(f"{name} of a hand must be finite and at least 0, got {value}")

    def numbers(self) -> Array:
        """[m, b, k]."""
        return np.array([self.mass, self.damping, self.stiffness])


NO_HAND = HandImpedance()


@dataclass(frozen=True)
class Sampling:
    """Clock of the servo: how often it samples, how late its torques come, and how it filters velocities.

    Parameters
    ----------
    period : float
        T [s].
    delay : float
        From a sample to its torque [s]; need not be a multiple of T.
    cutoff : float
        Corner frequency of the velocity filter [Hz].

    Raises
    ------
    ParameterError
        If the period or the cutoff is not positive, the delay negative, or one of them not finite.
    """

    period: float
    delay: float = 0.0
    cutoff: float = 150.0

    def __post_init__(self) -> None:
        values = (self.period, self.delay, self.cutoff)
        if not all(math.isfinite(value) for value in values) or self.period <= 0.0 or self.cutoff <= 0.0:
            raise ParameterError(f"period and cutoff of a loop must be positive and finite, got {self}")
        if self.delay < 0.0:
            raise ParameterError(f"the delay of a loop must be at least 0 s, got {self.delay}")

    @property
    def keep(self) -> float:
        """Share s of the old rate that the velocity filter keeps: e^{−2π f T}."""
        return math.exp(-2.0 * math.pi * self.cutoff * self.period)

    @property
    def whole_delay(self) -> int:
        """Whole periods in the delay."""
        return int(self.delay / self.period + 1e-9)

    @property
    def rest_delay(self) -> float:
        """What is left of the delay [s]; nothing if it is a whole number of periods."""
        rest = self.delay - self.whole_delay * self.period
        return rest if rest > 1e-9 * self.period else 0.0


def vector(scalars: Any) -> Symbol:
    """Column of scalars."""
    return casadi.vertcat(*scalars)


def matrix(rows: Any) -> Symbol:
    """Matrix of rows of scalars."""
    return casadi.vertcat(*(casadi.horzcat(*row) for row in rows))


def kinematics_function(device: Device) -> Any:
    """CasADi function (θ, θ̇) → J, J̇ θ̇, in H."""
    theta, rate = casadi.SX.sym("theta", 3), casadi.SX.sym("rate", 3)
    jacobian = matrix(device.jacobian(theta))
    return casadi.Function("kinematics", [theta, rate], [jacobian, casadi.jtimes(jacobian @ rate, theta, rate)])


def plant_function(device: Device) -> Any:
    """CasADi function (θ, θ̇, θ̈, p_d, v_d, [m, b, k]) → mass matrix of linkage and hand, ∂ID/∂θ, ∂ID/∂θ̇, ∂N/∂θ.

    ID is the inverse dynamics, viscous friction and hand included: the joint torques of a motion.
    """
    theta, rate, turn = (casadi.SX.sym(name, 3) for name in ("theta", "rate", "turn"))
    p_d, v_d, hand = (casadi.SX.sym(name, 3) for name in ("p_d", "v_d", "hand"))
    jacobian = matrix(device.jacobian(theta))
    velocity = jacobian @ rate
    weight = vector(device.gravity(theta))
    linkage_mass = matrix(device.mass(theta))
    acceleration = jacobian @ turn + casadi.jtimes(velocity, theta, rate)
    push = hand[0] * acceleration + hand[1] * (velocity - v_d) + hand[2] * (vector(device.position(theta)) - p_d)
    torque = (
        linkage_mass @ turn
        + matrix(device.coriolis(theta, rate)) @ rate
        + casadi.DM(device.viscous) * rate
        + weight
        + jacobian.T @ push
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
