r"""Support of the physical figure: which contact points bear load, from the reference now and shortly ahead.

A contact point of the figure bears load if it touches the floor and the reference has it near the floor and at rest,
now and at a time T ahead, predicted with constant acceleration,

.. math:: q_r(t + T) \approx q_r \oplus \left(v_r T + \tfrac12 a_r T^2\right) .

There are two such times. A point that will leave the floor within `unload_time` is released, and its load is moved to
the others before that, so that its leg need not catch up. Where no other point can take the load, before a flight, it
bears load until `lift_time` before it leaves. With the longer time alone the legs would stop pushing too soon: with
0.05 s the residual of a run is 12.0 % of weight instead of 6, and jumping falls. With the shorter time alone a foot
that leaves while the other stands is held too long: a dance has 4.1 % instead of 1.9, and a spin falls
(docs/validation/preparation-choices.md).

A point above the floor may bear load, too, if its foot stands on others and the reference has it in stance: it is about
to touch down. Not if the reference holds it up, as on the ball of a foot that turns: the plan would load it, the foot
roll over to it, and then stand flat while the reference turns (docs/validation/preparation-choices.md#pivoting).
"""

import numpy as np
from numba import njit

from controllers.work_array import work_array
from geometry.arrays import Array
from models.humanoid.skeleton import FOOT_CONTACTS, HAND_CONTACTS, N_TANGENT
from sim.body.figure_state import N_FOOT, REPORT_FLIES, FigureState
from sim.compilation.native import mj_integrate_pos, mj_kinematics

_N_CONTACTS = len(FOOT_CONTACTS + HAND_CONTACTS)


@njit
def find_support(s: FigureState, q_r: Array, v_r: Array, a_r: Array) -> float:
    """Set the share of load of each contact point, and return the support.

    A point of the reference that swings low over the floor is not in stance. The support is the largest contact of a
    point that the reference has below `flight_height` until `lift_time` ahead, 0 to 1.

    Parameters
    ----------
    s : FigureState
        The figure's contact points are read; `share`, `near`, `loaded`, `points` and the report of flight are written.
    q_r, v_r, a_r : Array
        Reference pose (75), velocity (57) and acceleration (57).
    """
    gains = s.gains
    at_unload, at_lift, lift_share = work_array((_N_CONTACTS, 3)), work_array((_N_CONTACTS, 3)), work_array(_N_CONTACTS)
    _predict_contacts(s, q_r, v_r, a_r, gains.unload_time, at_unload)
    _predict_contacts(s, q_r, v_r, a_r, gains.lift_time, at_lift)
    s.twin_qpos[:] = q_r
    mj_kinematics(s.twin_model, s.twin_data)
    for c in range(_N_CONTACTS):
        s.points[c] = s.contact_pos[s.contact[c]]
        s.points[c, 2] -= s.radius
    for leg in range(2):
        s.loaded[leg] = 0.0
        for c in range(N_FOOT * leg, N_FOOT * leg + N_FOOT):
            s.loaded[leg] = max(s.loaded[leg], _nearness(s.points[c, 2], gains.contact_reach))
    support, lowest = 0.0, np.inf
    for c in range(_N_CONTACTS):
        now = s.twin_contact_pos[s.twin_contact[c]]
        touch = _nearness(s.points[c, 2], gains.contact_reach)
        if c < 2 * N_FOOT:
            settling = s.loaded[c // N_FOOT] * _nearness(now[2] - s.radius, gains.stance_height)
            touch = max(touch, settling * _nearness(s.points[c, 2], gains.settling_reach))
        stillness = _stillness(now, at_unload[c], gains.unload_time * gains.swing_speed)
        height = max(now[2], at_unload[c, 2]) - s.radius
        s.near[c] = stillness * _nearness(height, gains.stance_height)
        s.share[c] = touch * stillness * _nearness(height, gains.reference_reach)
        stillness = _stillness(now, at_lift[c], gains.lift_time * gains.swing_speed)
        height = max(now[2], at_lift[c, 2]) - s.radius
        lift_share[c] = touch * stillness * _nearness(height, gains.reference_reach)
        support = max(support, touch * _nearness(height, gains.flight_height))
        lowest = min(lowest, now[2] - s.radius)
    missing_share = 1.0 - s.share.max()
    for c in range(_N_CONTACTS):
        s.share[c] += missing_share * max(lift_share[c] - s.share[c], 0.0)
    s.report[REPORT_FLIES] = 1.0 if lowest > gains.flight_height else 0.0
    return support


@njit
def _predict_contacts(s: FigureState, q_r: Array, v_r: Array, a_r: Array, ahead: float, positions: Array) -> None:
    """Write the contact points of the reference at a time ahead, with constant acceleration, shape (10, 3) [m]."""
    mean = work_array(N_TANGENT)
    for i in range(N_TANGENT):
        mean[i] = v_r[i] + 0.5 * ahead * a_r[i]
    s.twin_qpos[:] = q_r
    mj_integrate_pos(s.twin_model, s.twin_qpos.ctypes, mean.ctypes, ahead)
    mj_kinematics(s.twin_model, s.twin_data)
    for c in range(_N_CONTACTS):
        positions[c] = s.twin_contact_pos[s.twin_contact[c]]


@njit
def _stillness(now: Array, then: Array, reach: float) -> float:
    """1 for a point that does not move over the floor, 0 for one that moves by `reach` or more."""
    return _nearness(np.sqrt((then[0] - now[0]) ** 2 + (then[1] - now[1]) ** 2), reach)


@njit
def _nearness(height: float, reach: float) -> float:
    """1 at height 0 or below, 0 from a height `reach` on, C¹ between."""
    x = min(max(height / reach, 0.0), 1.0)
    return (1.0 - x) ** 2 * (1.0 + 2.0 * x)
