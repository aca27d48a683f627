"""Vectors and unit quaternions (wxyz) as tuples, for kernels that would otherwise spell them out number by number."""

import numpy as np
from numba import njit

from geometry.arrays import Array
from geometry.rotations import multiply, relative, rotate

Triple = tuple[float, float, float]
Vector = Triple
Quaternion = tuple[float, float, float, float]


@njit
def dot(a: Vector, b: Vector) -> float:
    """Scalar product a · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit
def cross(a: Vector, b: Vector) -> Vector:
    """Vector product a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit
def plus(a: Vector, b: Vector) -> Vector:
    """Sum a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@njit
def minus(a: Vector, b: Vector) -> Vector:
    """Difference a − b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@njit
def turned(q: Quaternion, v: Vector) -> Vector:
    """Vector v turned by q."""
    return rotate(q[0], q[1], q[2], q[3], v[0], v[1], v[2])


@njit
def turned_back(q: Quaternion, v: Vector) -> Vector:
    """Vector v turned by the inverse of q."""
    return rotate(q[0], -q[1], -q[2], -q[3], v[0], v[1], v[2])


@njit
def product(a: Quaternion, b: Quaternion) -> Quaternion:
    """Hamilton product a ⊗ b."""
    return multiply(a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3])


@njit
def scaled(k: float, v: Vector) -> Vector:
    """Multiple k v."""
    return k * v[0], k * v[1], k * v[2]


@njit(forceinline=True)
def unit_rotation(s: Array, slope: Array, rate: float, q: Array) -> Vector:
    """Write q = s/|s| (4,); returns its local angular velocity 2 Im(q⁻¹ ⊗ ṡ)/|s|, ṡ the slope (4,), times a rate."""
    scale = 1.0 / np.sqrt(max(s[0] * s[0] + s[1] * s[1] + s[2] * s[2] + s[3] * s[3], 1e-12))
    for j in range(4):
        q[j] = scale * s[j]
    _, x, y, z = relative(q[0], q[1], q[2], q[3], slope[0], slope[1], slope[2], slope[3])
    return scaled(2.0 * rate * scale, (x, y, z))


@njit
def vector_at(array: Array, at: int) -> Vector:
    """Three numbers of an array (n,)."""
    return array[at], array[at + 1], array[at + 2]


@njit
def quaternion_at(array: Array, row: int) -> Quaternion:
    """A row of an array (n, 4)."""
    return array[row, 0], array[row, 1], array[row, 2], array[row, 3]
