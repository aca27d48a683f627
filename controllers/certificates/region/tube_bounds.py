r"""Bounds of the device's kinematics and dynamics in a tube about a curve, by interval arithmetic on covering boxes.

M = L Lᵀ is the linkage's mass matrix, J its Jacobian, Λ = J⁻ᵀ M J⁻¹ its mass at the tip. Rates of change are per metre
of the tip's motion. Where stated, they are in the metric of Λ (matrices X as Λ^{-1/2} X Λ^{-1/2}, forces as
Λ^{-1/2} f), in which heavy and light directions count equally.
"""

import itertools
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from controllers.certificates.interrupts import raise_lost_interrupts
from controllers.certificates.loop.device import Device, matrix, vector
from controllers.certificates.region.intervals import bounds, spectral_bound
from controllers.certificates.report import CertificateError
from controllers.curves.trajectory import Trajectory
from geometry.arrays import Array

N_SEGMENTS = 48  # of the curve: with 48 the bound on the demo's largest mass is 0.151 kg, with 24 0.179, with 96 0.145
N_PARTS = 8  # of a segment's box along each joint: with 4 this bound is 0.184 kg, with 16 0.143 at five times the time


class TubeBounds(NamedTuple):
    """Bounds over a tube.

    Attributes
    ----------
    mass_low, mass_high : float
        Eigenvalues of Λ [kg].
    mass_slope, jacobian_slope, coriolis : float
        Rates of change [1/m] of Λ in its metric, and of J as ∂J J⁻¹; Coriolis force in the metric over
        |Λ^{1/2} v| |v| [1/m].
    weight_slope : float
        Rate of change of the weight at the tip [N/m].
    drag : float
        Viscous friction in the metric [1/s].
    coulomb : float
        Coulomb friction at the tip [N].
    rounding : float
        Largest error of the tip's position by encoder quantisation [m].
    motor_force : float
        Force that the motors can apply in every direction while they carry the weight [N].
    """

    mass_low: float
    mass_high: float
    mass_slope: float
    jacobian_slope: float
    coriolis: float
    weight_slope: float
    drag: float
    coulomb: float
    rounding: float
    motor_force: float


@raise_lost_interrupts()
def tube_bounds(device: Device, curve: Trajectory, radius: float) -> TubeBounds:
    """Bounds within a radius [m] of a curve.

    Raises
    ------
    CertificateError
        If a box that covers the tube contains a singular configuration.
    """
    theta = ca.SX.sym("theta", 3)
    jacobian, mass = matrix(device.jacobian(theta)), matrix(device.mass(theta))
    back, lower = ca.inv(jacobian), _cholesky(mass)
    unit = ca.inv(lower)
    low, high = _boxes(device, curve, radius, ca.Function("back", [theta], [back]))

    def sup(expression: Any) -> float:
        return float(spectral_bound(*bounds(ca.Function("f", [theta], [expression]), low, high)).max())

    def magnitude(expression: Any) -> Array:
        ends = bounds(ca.Function("f", [theta], [expression]), low, high)
        return np.maximum(np.abs(ends[0]), np.abs(ends[1]))

    def slope(parts: list[Any]) -> float:
        """Bound of Σ X_i θ̇_i per metre of tip motion; the Frobenius norm bounds the spectral norm."""
        return sup(ca.horzcat(*(ca.vec(part) for part in parts)) @ back)

    jacobian_slopes = [ca.reshape(ca.jacobian(ca.vec(jacobian), theta[i]), 3, 3) for i in range(3)]
    mass_slopes = [ca.reshape(ca.jacobian(ca.vec(mass), theta[i]), 3, 3) for i in range(3)]
    by_mass: list[Any] = []
    by_coriolis: list[Any] = []
    for i in range(3):
        side = unit @ (back @ jacobian_slopes[i]).T @ lower
        by_mass.append(unit @ mass_slopes[i] @ unit.T - side - side.T)
        axis = [float(i == j) for j in range(3)]
        by_coriolis.append((unit @ matrix(device.coriolis(theta, axis)) - lower.T @ back @ jacobian_slopes[i]) @ unit.T)
    tip = jacobian @ unit.T
    mobility = bounds(ca.Function("f", [theta], [tip @ tip.T]), low, high)
    middle, spread = 0.5 * (mobility[0] + mobility[1]), 0.5 * (mobility[1] - mobility[0])
    eigenvalues, loose = np.linalg.eigvalsh(middle), np.linalg.norm(spread, axis=(1, 2))
    if np.any(eigenvalues[:, 0] <= loose):
        raise CertificateError("the tube comes too near to a singular configuration of the arm")
    weight, levers = magnitude(vector(device.gravity(theta)))[:, :, 0], magnitude(jacobian)
    spare_torque = np.array(device.peak_torque) - weight.max(axis=0)
    friction = np.array(device.coulomb)
    return TubeBounds(
        mass_low=float(1.0 / (eigenvalues[:, -1] + loose).max()),
        mass_high=float(1.0 / (eigenvalues[:, 0] - loose).min()),
        mass_slope=slope(by_mass),
        jacobian_slope=slope([jacobian_slope @ back for jacobian_slope in jacobian_slopes]),
        coriolis=slope(by_coriolis),
        weight_slope=sup(back.T @ ca.jacobian(vector(device.gravity(theta)), theta) @ back),
        drag=sup(unit @ ca.diag(ca.DM(device.viscous)) @ unit.T),
        coulomb=float(np.linalg.norm(magnitude(back.T) @ friction, axis=1).max()),
        rounding=float(np.linalg.norm(levers @ (0.5 * np.array(device.encoder_step)), axis=1).max()),
        motor_force=float((spare_torque / np.linalg.norm(levers, axis=1).max(axis=0)).min()),
    )


def _cholesky(m: Any) -> Any:
    """L with L Lᵀ = M, 3 × 3."""
    a = ca.sqrt(m[0, 0])
    b, c = m[1, 0] / a, m[2, 0] / a
    d = ca.sqrt(m[1, 1] - b * b)
    e = (m[2, 1] - b * c) / d
    return matrix([[a, 0.0, 0.0], [b, d, 0.0], [c, e, ca.sqrt(m[2, 2] - c * c - e * e)]])


def _boxes(device: Device, curve: Trajectory, radius: float, back: Any) -> tuple[Array, Array]:
    """Boxes of θ that cover the tube, low and high (n, 3): one about each segment's middle, divided into parts.

    A straight path of the tip from the middle stays in the box if the joint motion along it, bounded by the rows of J⁻¹
    over the box, stays in it; this is checked.
    """
    phases = curve.start + curve.duration * (np.arange(N_SEGMENTS) + 0.5) / N_SEGMENTS
    fine = curve.velocity(np.linspace(curve.start, curve.end, 16 * N_SEGMENTS))
    reach = radius + 0.51 * curve.duration / N_SEGMENTS * float(np.linalg.norm(fine, axis=1).max())
    middles = np.array([device.angles(point) for point in curve.point(phases)])
    rows = np.linalg.norm(bounds(back, middles, middles)[1], axis=2)
    cuts = np.array(list(itertools.product(range(N_PARTS), repeat=3)))
    for enlargement in (1.1, 1.3, 1.6):
        half = enlargement * rows * reach
        corner = (middles - half)[:, None] + 2.0 * half[:, None] * cuts / N_PARTS
        low, high = corner.reshape(-1, 3), (corner + 2.0 * half[:, None] / N_PARTS).reshape(-1, 3)
        ends = bounds(back, low, high)
        needed = np.linalg.norm(np.maximum(np.abs(ends[0]), np.abs(ends[1])), axis=2) * reach
        if np.all(needed.reshape(N_SEGMENTS, -1, 3).max(axis=1) <= half):
            return low, high
    raise CertificateError("the tube comes too near to a singular configuration of the arm")
