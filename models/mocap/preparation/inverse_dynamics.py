"""Inverse dynamics of many states, with derivatives of wrench, torques and positions.

Derivatives by position and velocity are forward differences of the recursive Newton–Euler algorithm (MuJoCo's
`mj_rne`); the derivative by acceleration is the mass matrix. All are in the tangent of `Clip` poses.
"""

import mujoco
import numpy as np
import numpy.typing as npt

from geometry.arrays import Array
from geometry.quaternions import cross_matrix
from models.humanoid.skeleton import CONTACT_RADIUS, N_TANGENT, figure_model
from models.mocap.dynamics.floor_forces import RequiredWrench, carriers
from models.mocap.preparation.change import State

# Steps of the finite differences [rad], [rad/s]: half or twice either changes the derivatives by at most 6e-6 of them.
_ANGLE_STEP, _RATE_STEP = 1e-5, 1e-4


class InverseDynamics:
    """Inverse dynamics of m sampled states, and derivatives by position, velocity and acceleration in the tangent.

    Parameters
    ----------
    state : State
        The states.
    with_jacobian : bool
        Whether to compute derivatives.
    contacts : tuple of str
        The k contact spheres that may bear load: `FOOT_CONTACTS` or `ALL_CONTACTS`.

    Attributes
    ----------
    demand : RequiredWrench
        Wrench that contact forces must produce, and the geometry of the contacts.
    wrench : array, shape (m, 3, 6, 57)
        Derivatives of the wrench about the centre of mass by position, velocity, acceleration.
    torque : array, shape (m, 3, 51, 57)
        Derivatives of the joint torques without contact, likewise.
    spheres, com : arrays, shapes (m, k, 3, 57), (m, 3, 57)
        Derivatives by position of the contact spheres' centres and of the centre of mass.
    """

    def __init__(self, state: State, with_jacobian: bool, contacts: tuple[str, ...]) -> None:
        model = figure_model()
        d = mujoco.MjData(model)
        geoms = [int(model.geom(name).id) for name in contacts]
        bodies = [1 + carrier.body for carrier in carriers(len(contacts))]
        m, c = len(state.q), len(bodies)
        force, spheres, com = np.empty((m, N_TANGENT)), np.empty((m, len(geoms), 3)), np.empty((m, 3))
        anchors, frames, root = np.empty((m, c, 3)), np.empty((m, c, 9)), np.empty((m, 3, 3))
        count = m if with_jacobian else 0
        partials = np.zeros((count, 3, N_TANGENT, N_TANGENT))
        self.spheres, self.com = np.zeros((count, len(geoms), 3, N_TANGENT)), np.zeros((count, 3, N_TANGENT))
        self.anchors, self.turns = np.zeros((2, count, c, 3, N_TANGENT))
        for k in range(m):
            d.qpos[:], d.qvel[:], d.qacc[:] = state.q[k], state.v[k], state.a[k]
            mujoco.mj_kinematics(model, d)
            mujoco.mj_comPos(model, d)
            mujoco.mj_comVel(model, d)
            mujoco.mj_rne(model, d, 1, force[k])
            spheres[k], com[k] = d.geom_xpos[geoms], d.subtree_com[1]
            anchors[k], frames[k], root[k] = d.xpos[bodies], d.xmat[bodies], d.xmat[1].reshape(3, 3)
            if not with_jacobian:
                continue
            for i, geom in enumerate(geoms):
                mujoco.mj_jac(model, d, self.spheres[k, i], None, spheres[k, i], int(model.geom_bodyid[geom]))
            for i, body in enumerate(bodies):
                mujoco.mj_jac(model, d, self.anchors[k, i], self.turns[k, i], anchors[k, i], body)
            mujoco.mj_jacSubtreeCom(model, d, self.com[k], 1)
            _differentiate(model, d, force[k], partials[k])
        arm = com - state.q[:, :3]
        moment = np.einsum("mij,mj->mi", root, force[:, 3:6]) - np.cross(arm, force[:, :3])
        wrench = np.concatenate((force[:, :3], moment), axis=1)
        self.demand = RequiredWrench(spheres, com, wrench, force[:, 6:], anchors, frames.reshape(m, c, 3, 3))
        if with_jacobian:
            self._assemble_derivatives(state, partials, force, root, arm)

    def _assemble_derivatives(self, state: State, partials: Array, force: Array, root: Array, arm: Array) -> None:
        """Derivatives of the wrench about the centre of mass and of the joint torques."""
        m = len(arm)
        velocity_cross = cross_matrix(state.v[:, 3:].reshape(m, 18, 3))
        acceleration_cross = cross_matrix(state.a[:, 3:].reshape(m, 18, 3))
        for j in range(18):
            # Tangents are in the segment's own frame, so a rotation of it also rotates its velocity and acceleration.
            c = slice(3 + 3 * j, 6 + 3 * j)
            partials[:, 0, :, c] += (
                partials[:, 1, :, c] @ velocity_cross[:, j] + partials[:, 2, :, c] @ acceleration_cross[:, j]
            )
            partials[:, 1, :, c] += partials[:, 2, :, c] @ velocity_cross[:, j]
        self.wrench = np.empty((m, 3, 6, N_TANGENT))
        self.wrench[:, :, :3] = partials[:, :, :3]
        self.wrench[:, :, 3:] = root[:, None] @ partials[:, :, 3:6] - cross_matrix(arm)[:, None] @ partials[:, :, :3]
        self.wrench[:, 0, 3:, 3:6] -= root @ cross_matrix(force[:, 3:6])
        relative = self.com.copy()
        relative[:, :, :3] -= np.eye(3)
        self.wrench[:, 0, 3:] += cross_matrix(force[:, :3]) @ relative
        self.torque = partials[:, :, 6:]

    def torque_by_contact_force(self, pushes: Array, states: npt.NDArray[np.intp]) -> Array:
        """Derivative by position of the joint torques of constant contact forces, d(Jᵀ)/dx f: shape (n, 51, 57).

        Parameters
        ----------
        pushes : Array
            Contact forces, shape (m, k, 3) [N].
        states : array of int, shape (n,)
            Indices of the states.
        """
        demand, leaning = self.demand, np.zeros((len(states), 51, N_TANGENT))
        soles = demand.spheres[states] - (0.0, 0.0, CONTACT_RADIUS)
        for joint, (body, loading) in enumerate(carriers(soles.shape[1])):
            force, anchor = pushes[states, loading], demand.anchors[states, joint]
            moment = np.cross(soles[:, loading] - anchor[:, None], force).sum(1)
            moved = self.spheres[states, loading] - self.anchors[states, joint, None]
            change = -(cross_matrix(force) @ moved).sum(1) + cross_matrix(moment) @ self.turns[states, joint]
            leaning[:, 3 * (body - 1) : 3 * body] = demand.frames[states, joint].transpose(0, 2, 1) @ change
        return leaning


def _differentiate(model: mujoco.MjModel, d: mujoco.MjData, force: Array, partials: Array) -> None:
    """Write the derivatives of generalised forces (57,) by position, velocity and acceleration, shape (3, 57, 57)."""
    changed_force, full = np.zeros(N_TANGENT), np.empty((N_TANGENT, N_TANGENT))
    # Looked up once: these loops call them a hundred times for each of some hundred states in an iteration.
    kinematics = mujoco.mj_kinematics
    com_position = mujoco.mj_comPos
    com_velocity = mujoco.mj_comVel
    inverse = mujoco.mj_rne
    mujoco.mj_crb(model, d)
    _write_mass_matrix(model, d, full)
    partials[2] = full
    qvel, qpos = d.qvel, d.qpos
    pose, velocity, moved, step = qpos.copy(), qvel.copy(), np.zeros(model.nq), np.zeros(N_TANGENT)
    for i in range(3, N_TANGENT):
        qvel[i] += _RATE_STEP
        com_velocity(model, d)
        inverse(model, d, 1, changed_force)
        qvel[i] = velocity[i]
        partials[1, :, i] = (changed_force - force) / _RATE_STEP
    for i in range(3, N_TANGENT):
        step[i] = _ANGLE_STEP
        moved[:] = pose
        mujoco.mj_integratePos(model, moved, step, 1.0)
        step[i] = 0.0
        qpos[:] = moved
        kinematics(model, d)
        com_position(model, d)
        com_velocity(model, d)
        inverse(model, d, 1, changed_force)
        partials[0, :, i] = (changed_force - force) / _ANGLE_STEP


def _write_mass_matrix(model: mujoco.MjModel, data: mujoco.MjData, full: Array) -> None:
    """Write the mass matrix M to `full`; the signature of mj_fullM differs between versions of MuJoCo."""
    try:
        mujoco.mj_fullM(model, data, full)  # pyright: ignore[reportCallIssue, reportArgumentType]
    except TypeError:
        mujoco.mj_fullM(model, full, data.qM)  # pyright: ignore[reportCallIssue, reportArgumentType, reportAttributeAccessIssue]
