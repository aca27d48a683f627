r"""The physical figure: joint torques and ground contact that follow a reference pose, and as little else as possible.

Whole-body inverse dynamics at each control tick. With the reference pose, velocity and acceleration (q_r, v_r, a_r) the
wanted acceleration of all 57 degrees of freedom is

.. math:: a^* = a_r + 2\zeta\omega\,(v_r - v) + \omega^2\,(q_r \ominus q) .

Nothing but the ground may push the root, so its six rows of  M a + c = S^T τ + J^T f + w  are a demand on the contact forces,

.. math:: b = M_{ra} a^* + c_r = J_r^T f + w ,

met by f within the friction cones of the contact points near the floor (`sim.contact_forces`); the residual wrench w is what
is left, bounded, scaled down with the support and zero where the reference flies. The root's acceleration is then the one that
f and w really give, and the torques follow from the remaining 51 rows, clipped to the motors' limits:

.. math:: a_r^+ = M_{rr}^{-1}(J_r^T f + w - c_r - M_{rj} a_j^*), \qquad τ = M_{jr} a_r^+ + M_{jj} a_j^* + c_j - J_j^T f .

No spring holds the root: without contact it falls.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import mujoco
import numpy as np
import numpy.typing as npt
from numba import njit

from models.humanoid.skeleton import BODIES, FOOT_CONTACTS, HAND_CONTACTS, N_POSE, N_TANGENT, SEGMENTS
from sim.contact_forces import N_EDGES, cone_edges, shared_forces
from sim.errors import SimError
from sim.native import mj_full_m, mj_integrate_pos, mj_kinematics
from sim.stance import stance_response

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

CONTACTS = FOOT_CONTACTS + HAND_CONTACTS
_LEVER = 0.5  # m of lever arm at which a residual moment weighs as much as a residual force
_FULL_SHARE = 3e3  # share of a point on the floor; 1/share is the relative error that spreading the load may cost


class FigureState(NamedTuple):
    """What the kernel reads and writes: views of the world's MjData and scratch memory, all of the figure alone.

    Attributes
    ----------
    model, data : int
        Addresses of the world's MjModel and MjData.
    twin_model, twin_data : int
        Addresses of a model of the figure alone, in which the reference pose is looked at.
    """

    model: int
    data: int
    twin_model: int
    twin_data: int
    qpos: Array
    qvel: Array
    bias: Array
    passive: Array
    xpos: Array
    xmat: Array
    contact_pos: Array
    ctrl: Array
    applied: Array
    world_M: Array
    M: Array
    twin_qpos: Array
    twin_contact_pos: Array
    contact: IntArray
    twin_contact: IntArray
    contact_body: IntArray
    parent: IntArray
    torque_limit: Array
    weight: float
    radius: float
    friction: float
    joint_rate: float
    root_rate: float
    force_bound: float
    moment_bound: float
    reference_reach: float
    contact_reach: float
    flight_height: float
    lift_time: float
    linear_limit: float
    angular_limit: float
    acceleration: Array
    rotation: Array
    share: Array
    lost: Array
    edges: Array
    edge_share: Array
    edge_force: Array
    force: Array
    scaled: Array
    residual: Array
    demand: Array
    given: Array
    wrench: Array
    root_M: Array
    root_bias: Array
    wanted_root: Array
    points: Array
    legs: IntArray
    offset: Array
    response: Array
    report: Array


@njit
def _rotation_error(q: Array, q_r: Array, error: Array) -> None:
    """Rotation vector of q⁻¹ q_r, in the frame of q."""
    w = q[0] * q_r[0] + q[1] * q_r[1] + q[2] * q_r[2] + q[3] * q_r[3]
    x = q[0] * q_r[1] - q[1] * q_r[0] - q[2] * q_r[3] + q[3] * q_r[2]
    y = q[0] * q_r[2] - q[2] * q_r[0] - q[3] * q_r[1] + q[1] * q_r[3]
    z = q[0] * q_r[3] - q[3] * q_r[0] - q[1] * q_r[2] + q[2] * q_r[1]
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = np.sqrt(x * x + y * y + z * z)
    scale = 2.0 if sine < 1e-9 else 2.0 * np.arctan2(sine, w) / sine
    error[0], error[1], error[2] = scale * x, scale * y, scale * z


@njit
def _turned(rotation: Array, vector: Array, out: Array) -> None:
    """Out = exp(rotation) vector (Rodrigues)."""
    angle = np.sqrt(rotation[0] ** 2 + rotation[1] ** 2 + rotation[2] ** 2)
    a = 1.0 - angle**2 / 6.0 if angle < 1e-4 else np.sin(angle) / angle
    b = 0.5 if angle < 1e-4 else (1.0 - np.cos(angle)) / angle**2
    cx = rotation[1] * vector[2] - rotation[2] * vector[1]
    cy = rotation[2] * vector[0] - rotation[0] * vector[2]
    cz = rotation[0] * vector[1] - rotation[1] * vector[0]
    out[0] = vector[0] + a * cx + b * (rotation[1] * cz - rotation[2] * cy)
    out[1] = vector[1] + a * cy + b * (rotation[2] * cx - rotation[0] * cz)
    out[2] = vector[2] + a * cz + b * (rotation[0] * cy - rotation[1] * cx)


@njit
def _shortening(vector: Array, longest: float) -> float:
    """Factor that makes a 3-vector at most so long."""
    return min(1.0, longest / (np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2) + 1e-12))


@njit
def _wanted_acceleration(s: FigureState, q_r: Array, v_r: Array, a_r: Array) -> None:
    """a* of all 57 degrees of freedom: the reference's acceleration and critically damped feedback on the manifold."""
    a, k, c = s.acceleration, s.root_rate**2, 2.0 * s.root_rate
    limit = _shortening(a_r[:3], s.linear_limit)
    for i in range(3):
        a[i] = limit * a_r[i] + c * (v_r[i] - s.qvel[i]) + k * (q_r[i] - s.qpos[i])
    error, moved = s.rotation[0], s.rotation[1]
    for joint in range(s.xpos.shape[0]):
        k, c = s.root_rate**2, 2.0 * s.root_rate
        if joint > 0:
            k, c = s.joint_rate**2, 2.0 * s.joint_rate
        p, t = 3 + 4 * joint, 3 + 3 * joint
        _rotation_error(s.qpos[p : p + 4], q_r[p : p + 4], error)
        _turned(error, v_r[t : t + 3], moved)
        for i in range(3):
            a[t + i] = c * (moved[i] - s.qvel[t + i]) + k * error[i]
        _turned(error, a_r[t : t + 3], moved)
        limit = _shortening(moved, s.angular_limit)
        for i in range(3):
            a[t + i] += limit * moved[i]


@njit
def _nearness(height: float, reach: float) -> float:
    """1 on the floor or below, 0 from a height `reach` on, C¹ between."""
    x = min(max(height / reach, 0.0), 1.0)
    return (1.0 - x) ** 2 * (1.0 + 2.0 * x)


@njit
def _find_support(s: FigureState, q_r: Array, v_r: Array) -> float:
    """Share of each contact point: near the floor in fact, and in the reference now and a moment ahead.

    A point that the reference is about to lift is unloaded before, so that its leg need not catch up. Returns the largest
    share by the narrower measure of what counts as flight.
    """
    s.twin_qpos[:] = q_r
    mj_integrate_pos(s.twin_model, s.twin_qpos.ctypes, v_r.ctypes, s.lift_time)
    mj_kinematics(s.twin_model, s.twin_data)
    for i in range(s.share.shape[0]):
        s.share[i] = s.twin_contact_pos[s.twin_contact[i], 2]
    s.twin_qpos[:] = q_r
    mj_kinematics(s.twin_model, s.twin_data)
    support = 0.0
    for i in range(s.share.shape[0]):
        height = max(s.share[i], s.twin_contact_pos[s.twin_contact[i], 2]) - s.radius
        gap = s.contact_pos[s.contact[i], 2] - s.radius
        touch = _nearness(gap, s.contact_reach)
        s.share[i] = touch * _nearness(height, s.reference_reach)
        support = max(support, touch * _nearness(height, s.flight_height))
    return support


@njit
def figure_torque(s: FigureState, q_r: Array, v_r: Array, a_r: Array) -> None:
    """Set the motors' torques and the root's residual wrench for the reference of this control tick.

    Parameters
    ----------
    s : FigureState
        Reads the state and the dynamics of the last physics step; writes `ctrl`, `applied` and `report`.
    q_r, v_r, a_r : Array
        Reference pose (75), velocity (57) and acceleration (57), in the conventions of qpos and qvel.
    """
    n = s.acceleration.shape[0]
    _wanted_acceleration(s, q_r, v_r, a_r)
    support = _find_support(s, q_r, v_r)
    mj_full_m(s.model, s.data, s.world_M.ctypes)
    M, a, demand, w = s.M, s.acceleration, s.demand, s.wrench
    R, origin = s.xmat[0], s.xpos[0]
    for c in range(s.share.shape[0]):
        s.points[c] = s.contact_pos[s.contact[c]]
        s.points[c, 2] -= s.radius
    s.root_M[:] = M[:6, :6]
    s.wanted_root[:] = a[:6]
    a[:6] = 0.0
    for leg in range(2):
        stance_response(
            s.legs[leg],
            s.points[4 * leg : 4 * leg + 4],
            s.share[4 * leg : 4 * leg + 4],
            s.xpos,
            s.xmat,
            s.qvel,
            a,
            s.offset,
            s.response[leg],
        )
        for k in range(9):
            t = 3 + 3 * s.legs[leg, k // 3] + k % 3
            a[t] += s.offset[k]
            for i in range(6):
                for m in range(6):
                    s.root_M[i, m] += M[i, t] * s.response[leg, k, m]
    for i in range(6):
        s.root_bias[i] = s.bias[i] - s.passive[i]
        for k in range(6, n):
            s.root_bias[i] += M[i, k] * a[k]
        demand[i] = s.root_bias[i]
        for k in range(6):
            demand[i] += s.root_M[i, k] * s.wanted_root[k]
    w[:] = 0.0
    s.force[:] = 0.0
    if s.share.max() > 0.0:
        s.scaled[:3] = demand[:3] / s.weight
        for i in range(3):  # moments in world axes, so that the cones need no turning
            s.scaled[3 + i] = (R[3 * i] * demand[3] + R[3 * i + 1] * demand[4] + R[3 * i + 2] * demand[5]) / (
                s.weight * _LEVER
            )
        for c in range(s.share.shape[0]):
            point = s.rotation[0]
            point[:] = s.points[c] - origin
            edges = s.edges[N_EDGES * c : N_EDGES * c + N_EDGES]
            cone_edges(point, s.friction, edges)
            edges[:, 3:] /= _LEVER
            s.edge_share[N_EDGES * c : N_EDGES * c + N_EDGES] = _FULL_SHARE * s.share[c]
        shared_forces(s.edges, s.edge_share, s.scaled, s.residual, s.edge_force)
        for c in range(s.share.shape[0]):
            for e in range(N_EDGES * c, N_EDGES * c + N_EDGES):
                for i in range(3):
                    s.force[c, i] += s.weight * s.edge_force[e] * s.edges[e, i]
        _bounded_residual(s, support)
    else:
        s.residual[:] = 0.0
    # the root's acceleration under what ground and residual really give
    given = s.given
    given[:] = 0.0
    _contact_torques(s, given)
    a[:6] = np.linalg.solve(s.root_M, given[:6] + w - s.root_bias)
    for leg in range(2):
        for k in range(9):
            t = 3 + 3 * s.legs[leg, k // 3] + k % 3
            for m in range(6):
                a[t] += s.response[leg, k, m] * a[m]
    saturated = 0
    for i in range(6, n):
        torque = s.bias[i] - s.passive[i] - given[i]
        for k in range(n):
            torque += M[i, k] * a[k]
        limit = s.torque_limit[i - 6]
        s.ctrl[i - 6] = min(max(torque, -limit), limit)
        s.lost[i - 6] = torque - s.ctrl[i - 6]
        if abs(torque) > limit:
            saturated += 1
    if saturated > 0 and support > 0.0:
        for leg in range(2):
            for k in range(9):
                t = 3 * s.legs[leg, k // 3] + k % 3 - 3
                for m in range(6):
                    w[m] += s.response[leg, k, m] * s.lost[t]
        _bound(w, support * s.force_bound, support * s.moment_bound)
    s.applied[:] = w
    s.report[0] = support
    s.report[1] = saturated
    s.report[2:] = w


@njit
def _bounded_residual(s: FigureState, support: float) -> None:
    """Residual wrench in the root's tangent (force in the world, moment in the root's frame), within its bounds."""
    w, R, y = s.wrench, s.xmat[0], s.residual
    w[:3] = y[:3] * s.weight
    for i in range(3):
        w[3 + i] = (R[i] * y[3] + R[3 + i] * y[4] + R[6 + i] * y[5]) * s.weight * _LEVER
    _bound(w, support * s.force_bound, support * s.moment_bound)


@njit
def _bound(wrench: Array, force: float, moment: float) -> None:
    """Shorten force and moment to their bounds."""
    for first, bound in ((0, force), (3, moment)):
        size = np.sqrt(wrench[first] ** 2 + wrench[first + 1] ** 2 + wrench[first + 2] ** 2)
        if size > bound:
            wrench[first : first + 3] *= bound / size


@njit
def _contact_torques(s: FigureState, given: Array) -> None:
    """Jᵀ f of the planned contact forces: the root's rows, and the joints between the root and each contact."""
    R, origin = s.xmat, s.xpos
    for c in range(s.force.shape[0]):
        f = s.force[c]
        if f[2] == 0.0:
            continue
        for i in range(3):
            given[i] += f[i]
        body = s.contact_body[c]
        while body >= 0:
            x, y, z = (
                s.points[c, 0] - origin[body, 0],
                s.points[c, 1] - origin[body, 1],
                s.points[c, 2] - origin[body, 2],
            )
            mx, my, mz = y * f[2] - z * f[1], z * f[0] - x * f[2], x * f[1] - y * f[0]
            for i in range(3):
                given[3 + 3 * body + i] += R[body, i] * mx + R[body, 3 + i] * my + R[body, 6 + i] * mz
            body = s.parent[body]


@dataclass(frozen=True)
class FigureGains:
    """How closely the physical figure tracks, and how much help it may get.

    Parameters
    ----------
    joint_rate, root_rate : float
        ω of the critically damped feedback on joints and root [1/s].
    force_bound, moment_bound : float
        Largest residual force as a share of body weight, and moment as a share of body weight × stature.
    reference_reach, contact_reach : float
        Height above the floor from which a contact point of the reference, or of the figure itself, bears no load [m].
    """

    joint_rate: float = 40.0
    root_rate: float = 40.0
    force_bound: float = 1.0
    moment_bound: float = 0.2
    reference_reach: float = 0.03
    contact_reach: float = 0.001
    flight_height: float = 0.02
    lift_time: float = 0.02
    linear_limit: float = 40.0
    angular_limit: float = 500.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value >= 0.0) or ("bound" not in name and value == 0.0):
                raise SimError(f"FigureGains.{name} is {value}; expected a finite number > 0 (a bound may be 0)")


@dataclass(frozen=True)
class Figure:
    """The physical figure of a world (see the module's equations): the arrays that `figure_torque` works on.

    Parameters
    ----------
    model, data
        The compiled world and its state; kept alive here, since the kernel holds their addresses.
    twin
        The figure alone, of the same stature and mass (`figure_model`).
    prefix : str
        Of the figure's names in the world.
    gains : FigureGains
        Feedback and bounds.

    Raises
    ------
    SimError
        If the world holds no such figure.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    twin: mujoco.MjModel
    prefix: str = ""
    gains: FigureGains = FigureGains()
    twin_data: mujoco.MjData = field(init=False, repr=False)
    state: FigureState = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "twin_data", mujoco.MjData(self.twin))
        object.__setattr__(self, "state", self._state())

    def _state(self) -> FigureState:
        m, d, gains = self.model, self.data, self.gains
        try:
            root = m.joint(self.prefix + "root")
            first_body = m.body(self.prefix + BODIES[0]).id
            first_motor = m.actuator(self.prefix + "abdomen_x").id
            geoms = [m.geom(self.prefix + name).id for name in CONTACTS]
        except KeyError as error:
            raise SimError(f"the world has no figure with the prefix {self.prefix!r}: {error}") from None
        qpos, dof = int(root.qposadr[0]), int(root.dofadr[0])
        weight = float(m.body_subtreemass[first_body]) * float(np.linalg.norm(m.opt.gravity))
        stature = 1.0
        M = np.zeros((m.nv, m.nv))
        bodies = slice(first_body, first_body + len(BODIES))
        dofs = slice(dof, dof + N_TANGENT)
        n = len(CONTACTS)
        return FigureState(
            model=m._address, data=d._address, twin_model=self.twin._address, twin_data=self.twin_data._address,
            qpos=d.qpos[qpos : qpos + N_POSE], qvel=d.qvel[dofs], bias=d.qfrc_bias[dofs], passive=d.qfrc_passive[dofs],
            xpos=d.xpos[bodies], xmat=d.xmat[bodies], contact_pos=d.geom_xpos,
            ctrl=d.ctrl[first_motor : first_motor + N_TANGENT - 6], applied=d.qfrc_applied[dof : dof + 6],
            world_M=M, M=M[dofs, dofs], twin_qpos=self.twin_data.qpos, twin_contact_pos=self.twin_data.geom_xpos,
            contact=np.array(geoms), twin_contact=np.array([self.twin.geom(name).id for name in CONTACTS]),
            contact_body=np.array([int(m.geom_bodyid[g]) - first_body for g in geoms]),
            parent=np.array([segment.parent for segment in SEGMENTS]),
            torque_limit=m.actuator_ctrlrange[first_motor : first_motor + N_TANGENT - 6, 1].copy(),
            weight=weight, radius=float(m.geom_size[geoms[0], 0]), friction=0.9 * float(m.geom_friction[geoms[0], 0]),
            joint_rate=gains.joint_rate, root_rate=gains.root_rate, force_bound=gains.force_bound * weight,
            moment_bound=gains.moment_bound * weight * 1.75, reference_reach=gains.reference_reach,
            contact_reach=gains.contact_reach, flight_height=gains.flight_height, lift_time=gains.lift_time, linear_limit=gains.linear_limit, angular_limit=gains.angular_limit, acceleration=np.zeros(N_TANGENT), rotation=np.zeros((2, 3)),
            share=np.zeros(n), lost=np.zeros(N_TANGENT - 6), edges=np.zeros((N_EDGES * n, 6)), edge_share=np.zeros(N_EDGES * n),
            edge_force=np.zeros(N_EDGES * n), force=np.zeros((n, 3)), scaled=np.zeros(6), residual=np.zeros(6),
            demand=np.zeros(6), given=np.zeros(N_TANGENT), wrench=np.zeros(6), root_M=np.zeros((6, 6)),
            root_bias=np.zeros(6), wanted_root=np.zeros(6), points=np.zeros((n, 3)),
            legs=np.array([[BODIES.index(f"{side}_{b}") for b in ("thigh", "shank", "foot")] for side in ("left", "right")]),
            offset=np.zeros(9), response=np.zeros((2, 9, 6)), report=np.zeros(8),
        )  # fmt: skip
