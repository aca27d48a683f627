"""Whole-body control of the physical figure, compiled; see `sim.body.figure` for the equations."""

from numba import njit

from controllers.work_array import work_array
from sim.body.cholesky import factor, substitute
from sim.body.contact_forces import N_EDGES, cone_edges, shared_forces
from sim.body.falls import DOWN, RECOVERING, UP, update_fall, update_recovery_target
from sim.body.feedback import limit_length, wanted_acceleration
from sim.body.figure_state import (
    N_FOOT,
    REPORT_DOWN,
    REPORT_FLIES,
    REPORT_RESIDUAL,
    REPORT_SATURATED,
    REPORT_SUPPORT,
    Array,
    FigureState,
)
from sim.body.foot_placement import place_feet
from sim.body.mass_matrix import inertia, inertial_force
from sim.body.stance import N_LEG, stance_response
from sim.body.support import find_support

# [m] lever arm that converts moment to force in the cost of the residual: it trades one for the other. The RMS residual
# force of walk, run and jump is 0.6, 1.7 and 2.8 % of weight; with twice the value 0.4, 1.3 and 1.7, with half 0.8,
# 2.3 and 3.7.
_LEVER_ARM = 0.5
# Share of a point on the floor; 1/share is the relative error due to spreading the load. A tenth of it or ten times as
# much changes the residual of five clips by less than 0.1 % of weight.
_MAX_SHARE = 3e3
_MAX_PLANS = 4  # per control tick; each plan reduces the acceleration of joints that saturated in the previous one
# Largest speed of the target of a figure that is set back [m/s], [rad/s]. A metre and half a turn need 1.9 m/s and
# 5.9 rad/s, as the greatest slope of `smooth_step` is 15/8 and the return takes `RECOVERY_TIME`.
_MAX_RECOVERY_SPEED = 20.0


@njit
def figure_torque(s: FigureState, q_r: Array, v_r: Array, a_r: Array) -> None:
    """Set the motors' torques and the root's residual wrench for the reference of this control tick.

    Parameters
    ----------
    s : FigureState
        State and dynamics of the last physics step are read; `ctrl`, `applied` and `report` are written.
    q_r, v_r, a_r : Array
        Reference pose (75), velocity (57) and acceleration (57), in the conventions of qpos and qvel.
    """
    wanted_acceleration(s, q_r, v_r, a_r)
    s.wanted_root[:] = s.acceleration[:6]
    support = find_support(s, q_r, v_r, a_r)
    if s.report[REPORT_FLIES] == 1.0 and s.loaded.max() == 0.0:
        place_feet(s, q_r, v_r)
    mode = update_fall(s.twin_model, s.fall, s.qpos, q_r, s.points[:, 2].min())
    s.report[REPORT_DOWN] = mode
    if mode == UP:
        _control_upright(s, support)
    elif mode == DOWN:
        s.ctrl[:] = 0.0
        s.wrench[:] = 0.0
    elif mode == RECOVERING:
        _control_recovery(s, q_r)
    s.applied[:] = s.wrench
    s.report[REPORT_SUPPORT] = support
    s.report[REPORT_SATURATED] = _saturated_count(s.ctrl, s.torque_limit)
    s.report[REPORT_RESIDUAL : REPORT_RESIDUAL + 6] = s.wrench


@njit
def _saturated_count(torques: Array, limits: Array) -> int:
    """Number of motors at their limits."""
    count = 0
    for k in range(torques.shape[0]):
        if abs(torques[k]) >= 0.999 * limits[k]:
            count += 1
    return count


@njit
def _control_recovery(s: FigureState, q_r: Array) -> None:
    """Torques, and an unbounded wrench at the root, that carry a fallen figure back to the reference."""
    update_recovery_target(s.twin_model, s.fall, q_r)
    for k in range(0, s.fall.velocity.shape[0], 3):
        limit_length(s.fall.velocity[k : k + 3], _MAX_RECOVERY_SPEED)  # the reference may jump
    wanted_acceleration(s, s.fall.target, s.fall.velocity, s.fall.still)
    rate = s.gains.root_rate
    for i in range(3):  # without the bound `max_root_acceleration`: the animation may have moved far away
        s.acceleration[i] = 2.0 * rate * (s.fall.velocity[i] - s.qvel[i]) + rate**2 * (s.fall.target[i] - s.qpos[i])
    s.given[:], s.share[:], s.yielding[:] = 0.0, 0.0, 0
    for plan in range(_MAX_PLANS):
        if not _plan_torques(s) or plan == _MAX_PLANS - 1 or not _reduce_saturated_joints(s):
            break
    for i in range(6):
        s.wrench[i] = inertial_force(s.mass, i, s.acceleration, s.bias[i] - s.passive[i])


@njit
def _control_upright(s: FigureState, support: float) -> None:
    """Torques and residual wrench of a figure that is up (see `sim.body.figure`)."""
    for leg in range(2):
        foot = slice(N_FOOT * leg, N_FOOT * leg + N_FOOT)
        stance_response(
            s.legs[leg], s.points[foot], s.share[foot], s.near[foot], s.xpos, s.xmat, s.qvel, s.acceleration,
            s.offset, s.response[leg],
        )  # fmt: skip
        for k in range(N_LEG):
            s.acceleration[3 + 3 * s.legs[leg, k // 3] + k % 3] += s.offset[k]
    s.yielding[:] = 0
    for plan in range(_MAX_PLANS):
        s.acceleration[:6] = s.wanted_root
        met = _plan_contacts(s, support)
        _blend_free_root_motion(s, support if met else 0.0)
        if not _plan_torques(s) or plan == _MAX_PLANS - 1 or not _reduce_saturated_joints(s):
            break
    _compensate_leg_torques(s, support)


@njit
def _plan_contacts(s: FigureState, support: float) -> bool:
    """Plan contact forces and residual for the root's demand (M a* + c)_r, and their generalised forces.

    Returns whether the demand is met: not if no point bears load or the residual exceeded its bounds.
    """
    R, w, y, arm = s.xmat[0], s.wrench, s.residual, work_array(3)
    w[:] = 0.0
    s.force[:] = 0.0
    s.given[:] = 0.0
    if s.share.max() <= 0.0:
        y[:] = 0.0
        return False
    for i in range(6):
        s.demand[i] = inertial_force(s.mass, i, s.acceleration, s.bias[i] - s.passive[i])
    for i in range(3):  # moments in world axes, so that the friction cones need not be rotated
        s.scaled[i] = s.demand[i] / s.weight
        moment = R[3 * i] * s.demand[3] + R[3 * i + 1] * s.demand[4] + R[3 * i + 2] * s.demand[5]
        s.scaled[3 + i] = moment / (s.weight * _LEVER_ARM)
    for c in range(s.share.shape[0]):
        edges = s.edges[N_EDGES * c : N_EDGES * c + N_EDGES]
        for i in range(3):
            arm[i] = s.points[c, i] - s.xpos[0, i]
        cone_edges(arm, s.friction, edges)
        edges[:, 3:] /= _LEVER_ARM
        s.edge_share[N_EDGES * c : N_EDGES * c + N_EDGES] = _MAX_SHARE * s.share[c]
    shared_forces(s.edges, s.edge_share, s.scaled, y, s.edge_force)
    for c in range(s.share.shape[0]):
        for e in range(N_EDGES * c, N_EDGES * c + N_EDGES):
            for i in range(3):
                s.force[c, i] += s.weight * s.edge_force[e] * s.edges[e, i]
        if s.force[c, 2] > 0.0:
            _add_contact(s, c)
    for i in range(3):
        w[i] = y[i] * s.weight
        w[3 + i] = (R[i] * y[3] + R[3 + i] * y[4] + R[6 + i] * y[5]) * s.weight * _LEVER_ARM
    return not _bound_residual(s, support)


@njit
def _bound_residual(s: FigureState, support: float) -> bool:
    """Saturate the residual at its bounds, which scale with the support; returns whether it exceeded them."""
    force = limit_length(s.wrench[:3], support * s.gains.force_bound * s.weight)
    moment = limit_length(s.wrench[3:], support * s.gains.moment_bound * s.weight * s.stature)
    return force or moment


@njit
def _add_contact(s: FigureState, c: int) -> None:
    """Add Jᵀ f of one contact point: the force on the root, and moments about each joint from the body to the root."""
    f = s.force[c]
    s.given[:3] += f
    body = s.contact_body[c]
    while body >= 0:
        R = s.xmat[body]
        x, y, z = s.points[c, 0] - s.xpos[body, 0], s.points[c, 1] - s.xpos[body, 1], s.points[c, 2] - s.xpos[body, 2]
        mx, my, mz = y * f[2] - z * f[1], z * f[0] - x * f[2], x * f[1] - y * f[0]
        for i in range(3):
            s.given[3 + 3 * body + i] += R[i] * mx + R[3 + i] * my + R[6 + i] * mz
        body = s.parent[body]


@njit
def _blend_free_root_motion(s: FigureState, support: float) -> None:
    """Blend the root's planned acceleration with that of its free motion, M_rr a_r = J_rᵀ f + w − c_r − M_rj a_j.

    The wanted acceleration is weighted by the support, the free one by the rest. The caller sets the support to zero
    also where the residual is at its bounds: torques planned for an acceleration that does not occur move the limbs.
    """
    if support >= 1.0:
        return
    a, falling, block = s.acceleration, s.demand, s.block[:6, :6]
    for i in range(6):
        falling[i] = s.given[i] + s.wrench[i] - s.bias[i] + s.passive[i]
        for k in range(6):
            block[i, k] = inertia(s.mass, i, k)
        for k in range(6, a.shape[0]):
            falling[i] -= inertia(s.mass, i, k) * a[k]
    factor(block)
    substitute(block, falling)
    for i in range(6):
        a[i] = support * s.wanted_root[i] + (1.0 - support) * falling[i]


@njit
def _plan_torques(s: FigureState) -> bool:
    """Set the torques of the planned motion within the motors' limits; returns whether any motor saturates."""
    a, saturated = s.acceleration, False
    for motor in range(s.ctrl.shape[0]):
        i = motor + 6
        torque = inertial_force(s.mass, i, a, s.bias[i] - s.passive[i] - s.given[i])
        limit = s.torque_limit[motor]
        s.ctrl[motor] = min(max(torque, -limit), limit)
        s.lost[motor] = torque - s.ctrl[motor]
        if s.lost[motor] != 0.0:
            saturated = True
    return saturated


@njit
def _reduce_saturated_joints(s: FigureState) -> bool:  # noqa: C901 - loops over motors, which a call would allocate
    """Reduce the accelerations of saturated joints to what their limits allow: M_ss Δa = −lost.

    Joints of standing legs are left out (see `_compensate_leg_torques`). Returns whether any acceleration was changed.
    """
    for motor in range(s.lost.shape[0]):
        if s.lost[motor] != 0.0:
            s.yielding[motor] = 1
    for leg in range(2):
        if s.share[N_FOOT * leg : N_FOOT * leg + N_FOOT].max() > 0.0:
            for k in range(N_LEG):
                s.yielding[3 * s.legs[leg, k // 3] + k % 3 - 3] = 0
    n = 0
    for i in range(s.lost.shape[0]):
        if s.yielding[i] == 0:
            continue
        s.correction[n] = -s.lost[i]
        m = 0
        for k in range(i + 1):
            if s.yielding[k] == 1:
                s.block[n, m] = inertia(s.mass, 6 + i, 6 + k)
                m += 1
        n += 1
    if n == 0:
        return False
    factor(s.block[:n, :n])
    substitute(s.block[:n, :n], s.correction[:n])
    n = 0
    for i in range(s.lost.shape[0]):
        if s.yielding[i] == 1:
            s.acceleration[6 + i] += s.correction[n]
            n += 1
    return True


@njit
def _compensate_leg_torques(s: FigureState, support: float) -> None:
    """Add to the residual what standing legs cannot provide within their torque limits, by virtual work: Kᵀ lost."""
    for leg in range(2):
        for k in range(N_LEG):
            lost = s.lost[3 * s.legs[leg, k // 3] + k % 3 - 3]
            for i in range(6):
                s.wrench[i] += s.response[leg, k, i] * lost
    _bound_residual(s, support)
