"""Linearisation of device, hand and law along a river's curve, with exact derivatives.

Kinematics, dynamics and law are the kernels that the servo executes, evaluated on CasADi symbols and differentiated by
CasADi. `sampled_loop` builds the sampled-data loop from the derivatives.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from controllers.certificates.loop.device import Device, kinematics_function, plant_function
from controllers.certificates.loop.hand import HandImpedance
from controllers.certificates.loop.laws import SymbolicLaw, torque_function
from controllers.curves.trajectory import Trajectory
from controllers.errors import CurveError
from geometry.arrays import Array

_STIFFNESS_TOLERANCE = 1e-6  # fraction of a law's largest stiffness below which a stiffness counts as zero


@dataclass(frozen=True, eq=False)
class LinearLoop:
    """Derivatives of plant and law at n phases of a curve; gains and sampling are chosen afterwards.

    Attributes
    ----------
    phases : Array, shape (n,)
        t [s].
    theta, rate : Array, shape (n, 3)
        Joint angles on the curve and their rates along it.
    jacobian : Array, shape (n, 3, 3)
        J in H.
    mass : Array, shape (n, 3, 3)
        M of linkage and hand.
    inverse_theta, inverse_rate : Array, shape (n, 3, 3)
        Derivatives of the inverse dynamics by θ and θ̇.
    weight_theta : Array, shape (n, 3, 3)
        Derivative of the gravity compensation by θ.
    unit_theta, unit_omega : Array, shape (2, n, 3, 3)
        Derivatives of the law's torques by θ and ω, for (k_r, b_d) = (1, 0) and (0, 1).
    velocity : Array, shape (n, 3)
        φ̇ in H.
    neutral : Array, shape (n, 3, m)
        Neutral displacements of the tip, without restoring force: along the curve, along a led figure's path, or none.
    shift : Array, shape (n, 12, m)
        Derivatives of the state (θ, θ̇, θ_{k−1}, ω_{k−1}) by these displacements, for T → 0.
    held : bool
        Whether the hand has a stiffness, so that no displacement is neutral.
    """

    phases: Array
    theta: Array
    rate: Array
    jacobian: Array
    mass: Array
    inverse_theta: Array
    inverse_rate: Array
    weight_theta: Array
    unit_theta: Array
    unit_omega: Array
    velocity: Array
    neutral: Array
    shift: Array
    held: bool

    def lap(self, curve: Trajectory, n: int) -> "LinearLoop":
        """The loop at n equal phases of a closed curve, by periodic splines through all derivatives."""
        phases = curve.start + curve.duration * np.arange(n) / n
        knots = np.append(self.phases, self.phases[0] + curve.duration)

        def spread(values: Array, axis: int = 0) -> Array:
            closed = np.concatenate([values, np.take(values, [0], axis)], axis)
            return CubicSpline(knots, closed, axis=axis, bc_type="periodic")(phases)

        return LinearLoop(
            phases=phases, theta=spread(self.theta), rate=spread(self.rate), jacobian=spread(self.jacobian),
            mass=spread(self.mass), inverse_theta=spread(self.inverse_theta), inverse_rate=spread(self.inverse_rate),
            weight_theta=spread(self.weight_theta), unit_theta=spread(self.unit_theta, 1),
            unit_omega=spread(self.unit_omega, 1), velocity=spread(self.velocity), neutral=spread(self.neutral),
            shift=spread(self.shift), held=self.held,
        )  # fmt: skip


def linearise(
    device: Device, law: SymbolicLaw, curve: Trajectory, phases: Array, hand: HandImpedance, width: float = np.inf
) -> LinearLoop:
    """Linearise the loop at phases of a curve, about motion along it at its own speed.

    Parameters
    ----------
    device, law, curve, hand
        Parts of the loop.
    phases : Array, shape (n,)
        Phases [s]; they must lie inside an open curve, since t* is clamped at its ends.
    width : float
        ε or δ of the law [m].

    Raises
    ------
    CurveError
        If the curve stands still at a phase: there is no direction along it.
    """
    speeds = np.linalg.norm(curve.velocity(phases), axis=1)
    if np.any(speeds < 1e-9):
        raise CurveError(f"the curve stands still at phase {phases[np.argmin(speeds)]:.4g} s: no direction along it")
    points, velocity, acceleration = curve.point(phases), curve.velocity(phases), curve.acceleration(phases)
    theta = np.array([device.angles(point) for point in points])
    kinematics = kinematics_function(device).map(len(phases))
    jacobian = _stack_blocks(kinematics(theta.T, 0.0)[0])
    rate = joint_motion(jacobian, velocity)
    bias_acceleration = np.array(kinematics(theta.T, rate.T)[1]).T
    joint_acceleration = joint_motion(jacobian, acceleration - bias_acceleration)
    mass, by_theta, by_rate, weight = (
        _stack_blocks(block)
        for block in plant_function(device).map(len(phases))(
            theta.T, rate.T, joint_acceleration.T, points.T, velocity.T, np.tile(hand.numbers(), (len(phases), 1)).T
        )
    )
    breaks = np.asarray(curve.times, dtype=np.float64)
    piece = np.clip(np.searchsorted(breaks, phases, side="right") - 1, 0, len(breaks) - 2)
    pieces, within = curve.coefficients[piece].reshape(len(phases), -1), phases - breaks[piece]
    torques = torque_function(device, law).map(len(phases))
    # τ is affine in the gains: derivatives for unit gains minus those for zero gains.
    without_gains, *units = (
        [_stack_blocks(block) for block in torques(theta.T, rate.T, pieces.T, within[None], k_r, b_d, width**-2)[1:]]
        for k_r, b_d in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))
    )
    unit_theta = np.array([unit[0] - without_gains[0] for unit in units])
    held = hand.stiffness > 0.0
    neutral = np.zeros((len(phases), 3, 0))
    if law.slides and not held:
        neutral = velocity[:, :, None] if law.carries else _neutral_displacements(jacobian, unit_theta[0])
    turns = joint_acceleration[:, :, None] if law.carries and neutral.shape[2] else 0.0 * neutral
    joints = np.linalg.solve(jacobian, neutral)
    shift = np.asarray(np.concatenate([joints, turns, joints, turns], axis=1), dtype=np.float64)
    return LinearLoop(
        phases=phases, theta=theta, rate=rate, jacobian=jacobian, mass=mass, inverse_theta=by_theta,
        inverse_rate=by_rate, weight_theta=weight, unit_theta=unit_theta,
        unit_omega=np.array([unit[1] for unit in units]), velocity=velocity, neutral=neutral, shift=shift, held=held,
    )  # fmt: skip


def _neutral_displacements(jacobian: Array, by_theta: Array) -> Array:
    """Orthonormal tip displacements without restoring force of a law at rest, (n, 3, m); m is equal at all phases."""
    stiffness = np.linalg.solve(jacobian.transpose(0, 2, 1), by_theta) @ np.linalg.inv(jacobian)
    _, sizes, rows = np.linalg.svd(stiffness)
    rank = int(np.sum(sizes[0] > _STIFFNESS_TOLERANCE * sizes[0, 0]))
    return rows[:, rank:].transpose(0, 2, 1)


def joint_motion(jacobian: Array, tip: Array) -> Array:
    """J⁻¹ x: the joint motion that moves the tip by x, for n Jacobians and vectors, shape (n, 3)."""
    return np.asarray(np.linalg.solve(jacobian, tip[..., None])[..., 0], dtype=np.float64)


def _stack_blocks(blocks: Any) -> Array:
    """A CasADi matrix of n blocks side by side, 3 × 3 n, as an array (n, 3, 3)."""
    return np.ascontiguousarray(np.array(blocks).reshape(3, -1, 3).transpose(1, 0, 2))
