r"""Where feet go in a flight whose root is not where the reference has it: over their places on the floor all the same.

With the joints of the reference a foot is off by what the root is. It would land there and stay, while the root is
brought back over it; the legs would push off from the wrong place, and the next flight would miss by more. So in
flight the joints of each leg are displaced by

.. math:: \min_\delta \tfrac12 \|\delta\|^2 + \tfrac\kappa2 \sum_p \|H (J_p\, \delta - \sigma (p_r - T p_r))\|^2 ,

where p_r are the contact points of the foot in the reference, T takes the reference's root to the figure's, H takes the
horizontal part (a leg that were to reach up or down would bend or stretch far), and σ ≤ 1 shortens what is longer than
a reach: legs that turn far turn the root the other way. σ also ends, between 26 and 60° from the plumb line, for a foot
that is not under the root: in a somersault none is about to land. The wanted acceleration of the leg has ω² δ + 2ω δ'
more, δ' of the rate at which the root's error grows.
"""

import numpy as np
from numba import njit

from controllers.rotations import rotate
from controllers.state import Array, IntArray
from controllers.work_array import work_array
from sim.body.figure_state import N_FOOT, FigureState
from sim.body.stance import N_LEG, cross_add, factor, substitute

_CLOSENESS = 300.0  # κ [1/m²]: within 1 % of what is asked for, and bounded where a leg is straight
_ASIDE, _UNDER = 0.5, 0.9
"""Cosines of the angles between root to foot and the plumb line, from which a foot is placed at all, and wholly.
Without them snu/backflip lacks 27 % of weight, with them 8 (no placement: 7); a ramp up to 0.75 leaves 14."""


@njit
def place_feet(s: FigureState, q_r: Array, v_r: Array) -> None:
    """Amend the wanted accelerations of both legs of a figure in flight.

    Parameters
    ----------
    s : FigureState
        Reads state, reference's contact points and gains, writes `acceleration`.
    q_r, v_r : Array
        Reference pose (75) and velocity (57), in the conventions of qpos and qvel.
    """
    away, drift, offset, rate = work_array((N_FOOT, 3)), work_array((N_FOOT, 3)), work_array(N_LEG), work_array(N_LEG)
    omega = s.gains.joint_rate
    for leg in range(2):
        _displacements(s, q_r, v_r, leg, away, drift)
        _leg_for(s.legs[leg], s.points[N_FOOT * leg : N_FOOT * leg + N_FOOT], s.xpos, s.xmat, away, drift, offset, rate)
        for k in range(N_LEG):
            s.acceleration[3 + 3 * s.legs[leg, k // 3] + k % 3] += omega * (omega * offset[k] + 2.0 * rate[k])


@njit
def _displacements(s: FigureState, q_r: Array, v_r: Array, leg: int, away: Array, drift: Array) -> None:
    """What contact points of a foot are to be displaced by, σ (p_r − T p_r) (4, 3) [m], and its rate [m/s]."""
    R, turn, arm = s.xmat[0], work_array(3), work_array(3)
    turning = rotate(q_r[3], q_r[4], q_r[5], q_r[6], v_r[3], v_r[4], v_r[5])
    for i in range(3):
        turn[i] = turning[i] - (R[3 * i] * s.qvel[3] + R[3 * i + 1] * s.qvel[4] + R[3 * i + 2] * s.qvel[5])
    for p in range(N_FOOT):
        there = s.twin_contact_pos[s.twin_contact[N_FOOT * leg + p]]
        own = rotate(  # of the point in the root's frame
            q_r[3], -q_r[4], -q_r[5], -q_r[6], there[0] - q_r[0], there[1] - q_r[1], there[2] - q_r[2]
        )
        size = 0.0
        for i in range(3):
            arm[i] = R[3 * i] * own[0] + R[3 * i + 1] * own[1] + R[3 * i + 2] * own[2]
            away[p, i] = there[i] - s.qpos[i] - arm[i]
            drift[p, i] = v_r[i] - s.qvel[i]
            size += away[p, i] ** 2 if i < 2 else 0.0
        cross_add(turn, arm, drift[p])
        below = -arm[2] / max(np.sqrt(arm[0] ** 2 + arm[1] ** 2 + arm[2] ** 2), 1e-12)
        under = min(1.0, max(0.0, (below - _ASIDE) / (_UNDER - _ASIDE)))
        share = under * min(1.0, s.gains.placement_reach / max(np.sqrt(size), 1e-12))
        for i in range(3):
            away[p, i] *= share
            drift[p, i] *= share


@njit
def _leg_for(
    bodies: IntArray, points: Array, xpos: Array, xmat: Array, away: Array, drift: Array, offset: Array, rate: Array
) -> None:
    """Displacement δ of a leg's joints (9,) [rad] for those of its contact points, and its rate."""
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
            for i in range(2):  # horizontally
                offset[k] += _CLOSENESS * J[i, k] * away[p, i]
                rate[k] += _CLOSENESS * J[i, k] * drift[p, i]
                for m in range(k + 1):
                    normal[k, m] += _CLOSENESS * J[i, k] * J[i, m]
    factor(normal)
    substitute(normal, offset)
    substitute(normal, rate)
