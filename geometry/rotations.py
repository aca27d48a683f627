"""Unit quaternions (wxyz) as numbers: products, exponential and logarithm, for kernels and, by ``.py_func``, CasADi.

A rotation is given by four numbers, never by an array, so that compiled code keeps it in registers. Angular velocity
is *local* (in the rotated frame): q̇ = ½ q ⊗ ω.
"""

import numpy as np
from numba import njit


@njit
def multiply(
    aw: float, ax: float, ay: float, az: float, bw: float, bx: float, by: float, bz: float
) -> tuple[float, float, float, float]:
    """Hamilton product a ⊗ b: first b, then a."""
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


@njit
def relative(
    aw: float, ax: float, ay: float, az: float, bw: float, bx: float, by: float, bz: float
) -> tuple[float, float, float, float]:
    """Difference a⁻¹ ⊗ b of two unit quaternions: b as seen from a."""
    return (
        aw * bw + ax * bx + ay * by + az * bz,
        aw * bx - ax * bw - ay * bz + az * by,
        aw * by + ax * bz - ay * bw - az * bx,
        aw * bz - ax * by + ay * bx - az * bw,
    )


@njit
def rotate(qw: float, qx: float, qy: float, qz: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Vector v turned by the unit quaternion q: v + 2 w (u × v) + 2 u × (u × v), u the vector part."""
    cx, cy, cz = qy * z - qz * y, qz * x - qx * z, qx * y - qy * x
    return (
        x + 2.0 * (qw * cx + qy * cz - qz * cy),
        y + 2.0 * (qw * cy + qz * cx - qx * cz),
        z + 2.0 * (qw * cz + qx * cy - qy * cx),
    )


@njit
def exponential(x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Unit quaternion of a rotation vector [rad]."""
    # The offset keeps the quotient finite at zero; it changes no digit elsewhere.
    angle = np.sqrt(x * x + y * y + z * z + 1e-60)
    scale = np.sin(0.5 * angle) / angle
    return np.cos(0.5 * angle), scale * x, scale * y, scale * z


@njit
def logarithm(w: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Shortest rotation vector [rad] of a unit quaternion: its angle is at most π, for either sign of q."""
    sine = np.sqrt(x * x + y * y + z * z + 1e-60)
    # atan instead of acos: accurate at small angles; the quotient by w makes q and −q the same.
    angle = 2.0 * np.arctan2(sine, np.fabs(w))
    scale = np.copysign(angle / sine, w)
    return scale * x, scale * y, scale * z


@njit
def angular_velocity(x: float, y: float, z: float, dx: float, dy: float, dz: float) -> tuple[float, float, float]:
    """Local angular velocity of exp(v) as v changes: ω = J_r(v) v̇; in the fixed frame it is J_r(−v) v̇.

    J_r(v) v̇ = v̇ − (1 − cos α)/α² v × v̇ + (α − sin α)/α³ v × (v × v̇), α = |v| (Chirikjian 2012, section 10.6).
    """
    angle = np.sqrt(x * x + y * y + z * z + 1e-60)
    first = 2.0 * (np.sin(0.5 * angle) / angle) ** 2
    # Digits are lost at small angles, where the factor v × (v × v̇) is negligible.
    second = (angle - np.sin(angle)) / (angle * angle * angle)
    cx, cy, cz = y * dz - z * dy, z * dx - x * dz, x * dy - y * dx
    return (
        dx - first * cx + second * (y * cz - z * cy),
        dy - first * cy + second * (z * cx - x * cz),
        dz - first * cz + second * (x * cy - y * cx),
    )


@njit
def rotation_vector_rate(x: float, y: float, z: float, a: float, b: float, c: float) -> tuple[float, float, float]:
    """Rate of a rotation vector v, |v| ≤ π, whose rotation turns with the local angular velocity ω: v̇ = J_r(v)⁻¹ ω.

    J_r(v)⁻¹ ω = ω + v × ω / 2 + (1 − (α/2) cot(α/2))/α² v × (v × ω); for ω in the fixed frame it is J_r(−v)⁻¹ ω.
    """
    half = 0.5 * np.sqrt(x * x + y * y + z * z + 1e-60)
    second = 0.25 * (1.0 - half * np.cos(half) / np.sin(half)) / (half * half)
    cx, cy, cz = y * c - z * b, z * a - x * c, x * b - y * a
    return (
        a + 0.5 * cx + second * (y * cz - z * cy),
        b + 0.5 * cy + second * (z * cx - x * cz),
        c + 0.5 * cz + second * (x * cy - y * cx),
    )
