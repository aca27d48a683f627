r"""Foot placement in flight: feet are brought over the reference's footholds although the root is off its reference.

With the joint angles of the reference a foot has the error of the root. It would land with this error and keep it while
the root is brought back; the legs would then push off from the wrong place, and the next flight would miss by more. So
in flight the joints of each leg are displaced by

.. math:: \min_\delta \tfrac12 \|\delta\|^2 + \tfrac\kappa2 \sum_p \|H (J_p\, \delta - \sigma (p_r - T p_r))\|^2 ,

where p_r are the contact points of the foot in the reference, T is the displacement from the reference's root to the
figure's, and H takes the horizontal part (corrections of height would bend or stretch the leg far). σ ≤ 1 bounds the
displacement by `placement_reach`, since legs that swing far turn the root the other way. σ also fades to zero as the
line from root to foot goes from 26 to 60° off the vertical: in a somersault no foot is about to land. ω² δ + 2ω δ' is
added to the wanted acceleration of the leg, δ' being the solution for the rate of the root's error.
"""

import numpy as np
from numba import njit

from controllers.work_array import work_array
from geometry.arrays import Array, IntArray
from geometry.rotations import rotate
from sim.body.cholesky import factor, substitute
from sim.body.figure_state import N_FOOT, FigureState
from sim.body.stance import N_LEG, cross_add

_PLACEMENT_WEIGHT = 300.0  # κ [1/m²]: displacements are met within 1 %, and δ stays bounded where a leg is straight
_START_COSINE, _FULL_COSINE = 0.5, 0.9
"""Cosines of the angle between the line from root to foot and the vertical at which placement begins and is full.
Without this fading, with it and without placement, the residual of snu/backflip is 8.7, 8.1 and 8.2 % of weight, that
of jumping 5.4, 7.0 and 12.6 (measured on an earlier import of the captures)."""


@njit
def place_feet(s: FigureState, q_r: Array, v_r: Array) -> None:
    """Correct the wanted accelerations of both legs of a figure in flight.

    Parameters
    ----------
    s : FigureState
        State, contact points of the reference and gains are read, `acceleration` is written.
    q_r, v_r : Array
        Reference pose (75) and velocity (57), in the conventions of qpos and qvel.
    """
    shift, drift, offset, rate = work_array((N_FOOT, 3)), work_array((N_FOOT, 3)), work_array(N_LEG), work_array(N_LEG)
    omega = s.gains.joint_rate
    for leg in range(2):
        _contact_displacements(s, q_r, v_r, leg, shift, drift)
        _leg_displacement(
            s.legs[leg], s.points[N_FOOT * leg : N_FOOT * leg + N_FOOT], s.xpos, s.xmat, shift, drift, offset, rate
        )
        for k in range(N_LEG):
            s.acceleration[3 + 3 * s.legs[leg, k // 3] + k % 3] += omega * (omega * offset[k] + 2.0 * rate[k])


@njit
def _contact_displacements(s: FigureState, q_r: Array, v_r: Array, leg: int, shift: Array, drift: Array) -> None:
    """Write the wanted displacements of a foot's contact points, σ (p_r − T p_r) (4, 3) [m], and their rates [m/s]."""
    R, spin, arm = s.xmat[0], work_array(3), work_array(3)
    reference_rate = rotate(q_r[3], q_r[4], q_r[5], q_r[6], v_r[3], v_r[4], v_r[5])
    for i in range(3):
        spin[i] = reference_rate[i] - (R[3 * i] * s.qvel[3] + R[3 * i + 1] * s.qvel[4] + R[3 * i + 2] * s.qvel[5])
    for p in range(N_FOOT):
        target = s.twin_contact_pos[s.twin_contact[N_FOOT * leg + p]]
        local = rotate(  # the point in the root's frame
            q_r[3], -q_r[4], -q_r[5], -q_r[6], target[0] - q_r[0], target[1] - q_r[1], target[2] - q_r[2]
        )
        squared_length = 0.0
        for i in range(3):
            arm[i] = R[3 * i] * local[0] + R[3 * i + 1] * local[1] + R[3 * i + 2] * local[2]
            shift[p, i] = target[i] - s.qpos[i] - arm[i]
            drift[p, i] = v_r[i] - s.qvel[i]
            squared_length += shift[p, i] ** 2 if i < 2 else 0.0
        cross_add(spin, arm, drift[p])
        below = -arm[2] / max(np.sqrt(arm[0] ** 2 + arm[1] ** 2 + arm[2] ** 2), 1e-12)
        fade = min(1.0, max(0.0, (below - _START_COSINE) / (_FULL_COSINE - _START_COSINE)))
        share = fade * min(1.0, s.gains.placement_reach / max(np.sqrt(squared_length), 1e-12))
        for i in range(3):
            shift[p, i] *= share
            drift[p, i] *= share


@njit
def _leg_displacement(
    bodies: IntArray, points: Array, xpos: Array, xmat: Array, shift: Array, drift: Array, offset: Array, rate: Array
) -> None:
    """Write the displacement δ of a leg's joints (9,) [rad] for displacements of its contact points, and its rate."""
    normal, J = work_array((N_LEG, N_LEG)), work_array((3, N_LEG))
    axis, arm = work_array(3), work_array(3)
    offset[:], rate[:], normal[:] = 0.0, 0.0, 0.0
    for k in range(N_LEG):
        normal[k, k] = 1.0
    for p in range(points.shape[0]):
        J[:] = 0.0
        for k in range(N_LEG):
            body = bodies[k // 3]
            for i in range(3):
                axis[i] = xmat[body, 3 * i + k % 3]
                arm[i] = points[p, i] - xpos[body, i]
            cross_add(axis, arm, J[:, k])
        for k in range(N_LEG):
            for i in range(2):  # the horizontal components only
                offset[k] += _PLACEMENT_WEIGHT * J[i, k] * shift[p, i]
                rate[k] += _PLACEMENT_WEIGHT * J[i, k] * drift[p, i]
                for m in range(k + 1):
                    normal[k, m] += _PLACEMENT_WEIGHT * J[i, k] * J[i, m]
    factor(normal)
    substitute(normal, offset)
    substitute(normal, rate)
