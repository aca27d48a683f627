r"""Legs in stance: a loaded foot rests where it landed, not where the reference has it.

The feedback would drag a foot that landed a centimetre off its reference along the floor, against friction that the
plan lacks. So the wanted accelerations of a leg's nine degrees of freedom are changed by the smallest δ that brings its
contact points to rest on the floor:

.. math:: \min_\delta \tfrac12\|\delta\|^2 + \tfrac\kappa2 \sum_p n_p \|J_p (a^* + \delta) + \dot J_p v + \eta\,\dot p
          + \tfrac14 \eta^2 h_p e_z\|^2_{W_p} ,

with n_p the degree to which the point is in stance in the reference, and h_p its height. The horizontal weights in W_p
are the point's own fraction of its full load, the vertical one the largest fraction in its foot: a foot that lands
tilted is set flat.
"""

from numba import njit

from controllers.work_array import work_array
from geometry.arrays import Array, IntArray
from sim.body.cholesky import factor, substitute

# κ, weight of contact points at rest against small δ. Half or twice the value changes the residual of walk, run and
# jump by at most 0.1 % of weight; the slide of feet is about the same.
_CONTACT_WEIGHT = 300.0
# η [1/s], rate at which a foot comes to rest on the floor. Half or twice the value changes the residual of walk, run
# and jump by at most 0.1 % of weight.
_SETTLING_RATE = 40.0
N_LEG = 9  # degrees of freedom of a leg: three each of hip, knee and ankle


@njit
def cross_add(a: Array, b: Array, out: Array) -> None:
    """Out += a × b."""
    out[0] += a[1] * b[2] - a[2] * b[1]
    out[1] += a[2] * b[0] - a[0] * b[2]
    out[2] += a[0] * b[1] - a[1] * b[0]


@njit
def _subtract(a: Array, b: Array, out: Array) -> None:
    """Out = a − b."""
    for i in range(3):
        out[i] = a[i] - b[i]


@njit
def _propagate_velocities(
    bodies: IntArray, xpos: Array, xmat: Array, v: Array, omega: Array, linear_drift: Array, angular_drift: Array
) -> None:
    """Angular velocities of root, thigh, shank and foot, and their accelerations due to velocities alone.

    Written, each of shape (4, 3): ω, and the linear and the angular acceleration. Other arguments as in
    `stance_response`.
    """
    relative, arm, spin = work_array(3), work_array(3), work_array(3)
    omega[:], linear_drift[:], angular_drift[:] = 0.0, 0.0, 0.0
    for level in range(4):
        body = 0 if level == 0 else bodies[level - 1]
        for i in range(3):
            relative[i] = 0.0
            for k in range(3):
                relative[i] += xmat[body, 3 * i + k] * v[3 + 3 * body + k]
        if level > 0:
            parent = 0 if level == 1 else bodies[level - 2]
            omega[level] = omega[level - 1]
            angular_drift[level] = angular_drift[level - 1]
            cross_add(omega[level - 1], relative, angular_drift[level])
            _subtract(xpos[body], xpos[parent], arm)
            linear_drift[level] = linear_drift[level - 1]
            cross_add(angular_drift[level - 1], arm, linear_drift[level])
            spin[:] = 0.0
            cross_add(omega[level - 1], arm, spin)
            cross_add(omega[level - 1], spin, linear_drift[level])
        for i in range(3):
            omega[level, i] += relative[i]


@njit
def _point_jacobians(bodies: IntArray, point: Array, xpos: Array, xmat: Array, J: Array, J_root: Array) -> None:
    """Jacobians of a point of the foot, written: by the leg's degrees of freedom (3, 9) and by the root's (3, 6)."""
    axis, arm, spin = work_array(3), work_array(3), work_array(3)
    for level in range(4):
        body = 0 if level == 0 else bodies[level - 1]
        _subtract(point, xpos[body], arm)
        for k in range(3):
            for i in range(3):
                axis[i] = xmat[body, 3 * i + k]
            spin[:] = 0.0
            cross_add(axis, arm, spin)
            if level == 0:
                J_root[:, 3 + k] = spin
            else:
                J[:, 3 * (level - 1) + k] = spin
    for i in range(3):
        J_root[i, :3] = 0.0
        J_root[i, i] = 1.0


@njit
def _negative_drift(arm: Array, omega: Array, linear_drift: Array, angular_drift: Array, result: Array) -> None:
    """Minus the acceleration due to velocities alone of a point at `arm` from the foot's origin, written to `result`.

    The other arguments are those of the foot in `_propagate_velocities`.
    """
    spin, relative = work_array(3), work_array(3)
    spin[:], relative[:] = 0.0, 0.0
    cross_add(omega, arm, spin)
    cross_add(angular_drift, arm, relative)
    cross_add(omega, spin, relative)
    for i in range(3):
        result[i] = -linear_drift[i] - relative[i]


@njit
def _add_point(
    J: Array, J_root: Array, wanted: Array, along: float, upward: float, offset: Array, response: Array, normal: Array
) -> None:
    """Add a point, with its weights along the floor and upwards, to the normal equations and their right-hand sides."""
    for k in range(N_LEG):
        for i in range(3):
            weight = along if i < 2 else upward
            offset[k] += weight * J[i, k] * wanted[i]
            for m in range(6):
                response[k, m] -= weight * J[i, k] * J_root[i, m]
            for m in range(k + 1):
                normal[k, m] += weight * J[i, k] * J[i, m]


@njit
def stance_response(  # noqa: PLR0913 - a kernel takes the arrays of a leg one by one
    bodies: IntArray, points: Array, share: Array, near: Array, xpos: Array, xmat: Array, v: Array, a: Array,
    offset: Array, response: Array,
) -> None:  # fmt: skip
    """Compute the change of one leg's wanted accelerations that brings its loaded contact points to rest.

    Parameters
    ----------
    bodies : IntArray
        Indices of thigh, shank and foot among the figure's bodies; the root is 0.
    points, share : Array
        Positions (n, 3) of the foot's contact points in the world, floor at z = 0, and their shares of load (n,).
    near : Array
        Degree to which the point is in stance in the reference, 0 to 1, shape (n,).
    xpos, xmat : Array
        Positions (18, 3) and rotation matrices (18, 9) of the figure's bodies.
    v, a : Array
        Velocity and wanted acceleration of the figure (57).
    offset, response : Array
        Written: δ (9,), and its derivative K with respect to the root's acceleration (9, 6).
    """
    offset[:] = 0.0
    response[:] = 0.0
    loaded = share.max()
    if loaded <= 0.0:
        return
    normal = work_array((N_LEG, N_LEG))
    for k in range(N_LEG):
        normal[k] = 0.0
        normal[k, k] = 1.0
    J, J_root, wanted, arm = work_array((3, N_LEG)), work_array((3, 6)), work_array(3), work_array(3)
    omega, linear_drift, angular_drift = work_array((4, 3)), work_array((4, 3)), work_array((4, 3))
    _propagate_velocities(bodies, xpos, xmat, v, omega, linear_drift, angular_drift)
    for p in range(share.shape[0]):
        if near[p] <= 0.0:
            continue
        _subtract(points[p], xpos[bodies[2]], arm)
        _negative_drift(arm, omega[3], linear_drift[3], angular_drift[3], wanted)
        _point_jacobians(bodies, points[p], xpos, xmat, J, J_root)
        for i in range(3):
            for k in range(6):
                wanted[i] -= J_root[i, k] * (_SETTLING_RATE * v[k] + a[k])
            for k in range(N_LEG):
                t = 3 + 3 * bodies[k // 3] + k % 3
                wanted[i] -= J[i, k] * (_SETTLING_RATE * v[t] + a[t])
        wanted[2] -= (0.5 * _SETTLING_RATE) ** 2 * max(0.0, points[p, 2])
        weight = _CONTACT_WEIGHT * near[p]
        _add_point(J, J_root, wanted, weight * min(1.0, share[p]), weight * loaded, offset, response, normal)
    factor(normal)
    substitute(normal, offset)
    for m in range(6):
        substitute(normal, response[:, m])
