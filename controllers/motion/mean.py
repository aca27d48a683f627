r"""Weighted mean of rotations, and its derivative.

The mean minimises Σ w_i |R − R_i|², the chordal metric (Markley et al. 2007, "Averaging quaternions"): its
quaternion is the eigenvector of M = Σ w_i q_i q_iᵀ with the largest eigenvalue λ. We prefer it to the Karcher mean,
with which it agrees to third order in the spread of the rotations: the sign of a quaternion does not matter, and it
is smooth except where λ is double (two rotations half a turn apart with equal weights: a single point), while the
Karcher mean jumps as soon as two are half a turn apart, whatever their weights. So a somersault can be blended with a
walk.

With r_i = q⁻¹ ⊗ q_i = (s_i, v_i), the mean satisfies g = Σ w_i s_i v_i = 0 and A = Σ w_i (s_i² I − v_i v_iᵀ), which
is λI − M in the tangent space of q, is positive definite: that proves that the iteration found the largest eigenvalue.
All of this also holds if some weights are negative: M need not be definite.

The single point is met, however, where a hand stays on a curve on which two clips have equal weights: as their
rotations pass half a turn, the mean flips by half a turn from one moment to the next. Joints of which that is true are
blended by the normalised sum of their quaternions with signs that are continuous round the lap (`signed_mean`): the
mean of an arm 100° ahead and one 100° behind hangs down, and does not change over to the other side at 90°.
"""

import numpy as np
from numba import njit

from controllers.state import Quat
from controllers.work_array import work_array
from geometry.arrays import Array
from geometry.rotations import multiply, relative

_NormalEquations = tuple[float, float, float, float, float, float, float, float, float]


@njit(forceinline=True)
def _normal_equations(unit: Array, weights: Array, q: Quat) -> _NormalEquations:
    """Entries A11, A12, A13, A22, A23, A33 of A and g1, g2, g3 of g (see the module's docstring)."""
    a11 = a12 = a13 = a22 = a23 = a33 = g1 = g2 = g3 = 0.0
    for i in range(unit.shape[0]):
        w = weights[i]
        s, x, y, z = relative(q[0], q[1], q[2], q[3], unit[i, 0], unit[i, 1], unit[i, 2], unit[i, 3])
        a11 += w * (s * s - x * x)
        a22 += w * (s * s - y * y)
        a33 += w * (s * s - z * z)
        a12 -= w * x * y
        a13 -= w * x * z
        a23 -= w * y * z
        g1 += w * s * x
        g2 += w * s * y
        g3 += w * s * z
    return a11, a12, a13, a22, a23, a33, g1, g2, g3


@njit
def _solve(e: _NormalEquations, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A⁻¹ (x, y, z) by cofactors; zero when A is singular (the mean is not unique there)."""
    c11, c12, c13 = e[3] * e[5] - e[4] * e[4], e[2] * e[4] - e[1] * e[5], e[1] * e[4] - e[2] * e[3]
    c22, c23, c33 = e[0] * e[5] - e[2] * e[2], e[1] * e[2] - e[0] * e[4], e[0] * e[3] - e[1] * e[1]
    determinant = e[0] * c11 + e[1] * c12 + e[2] * c13
    if abs(determinant) < 1e-18:
        return 0.0, 0.0, 0.0
    return (
        (c11 * x + c12 * y + c13 * z) / determinant,
        (c12 * x + c22 * y + c23 * z) / determinant,
        (c13 * x + c23 * y + c33 * z) / determinant,
    )


@njit(forceinline=True)
def _refine(unit: Array, weights: Array, q: Quat) -> bool:
    """Newton steps q ← q ⊗ (1, A⁻¹ g), which converge cubically; returns whether A is then positive definite."""
    e = _normal_equations(unit, weights, q)
    for _ in range(8):
        x, y, z = _solve(e, e[6], e[7], e[8])
        square = x * x + y * y + z * z
        scale = 1.0 / np.sqrt(1.0 + square)
        q[0], q[1], q[2], q[3] = multiply(q[0], q[1], q[2], q[3], scale, scale * x, scale * y, scale * z)
        if square < 1e-12:
            break
        e = _normal_equations(unit, weights, q)
    second = e[0] * e[3] - e[1] * e[1]
    third = e[5] * second - e[0] * e[4] * e[4] + 2.0 * e[1] * e[2] * e[4] - e[3] * e[2] * e[2]
    return e[0] > 0.0 and second > 0.0 and third > 0.0


@njit
def _dominant_eigenvector(unit: Array, weights: Array, q: Quat) -> None:  # noqa: C901 - loops over a 4 × 4 matrix, which a call would allocate
    """Eigenvector of the largest eigenvalue of M by squaring M 24 times: slower than `_refine`, but always converges.

    In compiled code `numpy.linalg.eigh` allocates and calls LAPACK: 3.3 µs instead of 0.9, and 5 s more to compile.
    """
    m, square = work_array((4, 4)), work_array((4, 4))
    m[:] = 0.0
    for i in range(unit.shape[0]):
        # A multiple of the identity makes M positive despite negative weights, and changes no eigenvector.
        for j in range(4):
            m[j, j] += max(-weights[i], 0.0)
        for j in range(4):
            for k in range(4):
                m[j, k] += weights[i] * unit[i, j] * unit[i, k]
    for _ in range(24):
        trace = m[0, 0] + m[1, 1] + m[2, 2] + m[3, 3]
        for j in range(4):
            for k in range(4):
                total = 0.0
                for n in range(4):
                    total += m[j, n] * m[n, k]
                square[j, k] = total / (trace * trace)
        m, square = square, m
    column = 0
    for j in range(1, 4):
        if m[j, j] > m[column, column]:
            column = j
    norm = 0.0
    for j in range(4):
        norm += m[j, column] * m[j, column]
    for j in range(4):
        q[j] = m[j, column] / np.sqrt(norm)


@njit(forceinline=True)
def mean_rotation(unit: Array, weights: Array, q: Quat) -> None:
    """Weighted mean of rotations.

    Parameters
    ----------
    unit : Array, shape (m, 4)
        Unit quaternions wxyz, of any sign.
    weights : Array, shape (m,)
        Sum 1; negative ones are allowed as long as the largest eigenvalue of M is simple.
    q : Quat
        Written: the mean, with the sign of the heaviest quaternion.
    """
    heaviest = 0
    for i in range(1, unit.shape[0]):
        if weights[i] > weights[heaviest]:
            heaviest = i
    q[:] = 0.0
    for i in range(unit.shape[0]):
        dot = 0.0
        for j in range(4):
            dot += unit[i, j] * unit[heaviest, j]
        # Negative weights are left out of the initial guess, so that it is never zero.
        w = max(weights[i], 0.0) if dot >= 0.0 else -max(weights[i], 0.0)
        for j in range(4):
            q[j] += w * unit[i, j]
    norm = np.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
    for j in range(4):
        q[j] /= norm
    if not _refine(unit, weights, q):
        _dominant_eigenvector(unit, weights, q)
        _refine(unit, weights, q)
    dot = 0.0
    for j in range(4):
        dot += q[j] * unit[heaviest, j]
    if dot < 0.0:
        for j in range(4):
            q[j] = -q[j]


@njit
def mean_derivative(unit: Array, spin: Array, weights: Array, changes: Array, q: Quat, tangent: Array) -> None:
    """Local angular velocities of the mean as its rotations turn, and as its weights change.

    From dM q projected on the tangent space: A ω/2 = Σ dw_i s_i v_i + ½ w_i (s_i² ω_i + s_i v_i × ω_i − v_i
    (v_i·ω_i)).

    Parameters
    ----------
    unit, weights, q
        As in `mean_rotation`, q being the mean.
    spin : Array, shape (m, 3)
        ω_i, local angular velocities of the rotations with respect to one parameter.
    changes : Array, shape (k, m)
        Derivatives of the weights with respect to k parameters; the first is the parameter of `spin`.
    tangent : Array, shape (3, k)
        Written: local angular velocity of the mean with respect to each parameter.
    """
    e = _normal_equations(unit, weights, q)
    tangent[:] = 0.0
    for i in range(unit.shape[0]):
        s, x, y, z = relative(q[0], q[1], q[2], q[3], unit[i, 0], unit[i, 1], unit[i, 2], unit[i, 3])
        a, b, c = spin[i, 0], spin[i, 1], spin[i, 2]
        along = x * a + y * b + z * c
        half = 0.5 * weights[i]
        tangent[0, 0] += half * (s * s * a + s * (y * c - z * b) - x * along)
        tangent[1, 0] += half * (s * s * b + s * (z * a - x * c) - y * along)
        tangent[2, 0] += half * (s * s * c + s * (x * b - y * a) - z * along)
        for k in range(changes.shape[0]):
            tangent[0, k] += changes[k, i] * s * x
            tangent[1, k] += changes[k, i] * s * y
            tangent[2, k] += changes[k, i] * s * z
    for k in range(tangent.shape[1]):
        x, y, z = _solve(e, 2.0 * tangent[0, k], 2.0 * tangent[1, k], 2.0 * tangent[2, k])
        tangent[0, k], tangent[1, k], tangent[2, k] = x, y, z


@njit
def signed_mean(unit: Array, weights: Array, q: Quat) -> None:
    """Normalised sum of weighted quaternions whose signs matter; the arguments are those of `mean_rotation`."""
    q[:] = 0.0
    for i in range(unit.shape[0]):
        for j in range(4):
            q[j] += weights[i] * unit[i, j]
    norm = max(np.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + q[3] ** 2), 1e-12)
    for j in range(4):
        q[j] /= norm


@njit
def signed_mean_derivative(unit: Array, spin: Array, weights: Array, changes: Array, q: Quat, tangent: Array) -> None:
    """Local angular velocities of `signed_mean`; the arguments are those of `mean_derivative`.

    From q |Σ w_i q_i| = Σ w_i q_i: ω Σ w_i s_i = Σ 2 dw_i v_i + w_i (s_i ω_i + v_i × ω_i).
    """
    tangent[:] = 0.0
    norm = 0.0
    for i in range(unit.shape[0]):
        s, x, y, z = relative(q[0], q[1], q[2], q[3], unit[i, 0], unit[i, 1], unit[i, 2], unit[i, 3])
        a, b, c = spin[i, 0], spin[i, 1], spin[i, 2]
        norm += weights[i] * s
        tangent[0, 0] += weights[i] * (s * a + y * c - z * b)
        tangent[1, 0] += weights[i] * (s * b + z * a - x * c)
        tangent[2, 0] += weights[i] * (s * c + x * b - y * a)
        for k in range(changes.shape[0]):
            tangent[0, k] += 2.0 * changes[k, i] * x
            tangent[1, k] += 2.0 * changes[k, i] * y
            tangent[2, k] += 2.0 * changes[k, i] * z
    norm = max(norm, 1e-12)
    for k in range(tangent.shape[1]):
        for j in range(3):
            tangent[j, k] /= norm
