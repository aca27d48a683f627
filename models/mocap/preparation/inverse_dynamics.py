"""Inverse dynamics of many states, with derivatives of wrench, torques and places in the tangent of `Clip` poses."""

import mujoco
import numpy as np
import numpy.typing as npt

from geometry.arrays import Array
from geometry.quaternions import cross_matrix
from models.humanoid.skeleton import CONTACT_RADIUS, N_TANGENT, figure_model
from models.mocap.dynamics.floor_forces import RequiredWrench, carriers
from models.mocap.dynamics.force_derivatives import SegmentPlaces, force_derivatives
from models.mocap.preparation.change import State


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
        places = SegmentPlaces.empty(count)
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
            for values, of_bodies in zip(places, (d.xpos, d.xipos, d.xmat, d.ximat), strict=True):
                values[k] = of_bodies[1:].reshape(values[k].shape)
        force += model.dof_damping * state.v + model.dof_armature * state.a  # which mj_rne leaves out
        arm = com - state.q[:, :3]
        moment = np.einsum("mij,mj->mi", root, force[:, 3:6]) - np.cross(arm, force[:, :3])
        wrench = np.concatenate((force[:, :3], moment), axis=1)
        self.demand = RequiredWrench(spheres, com, wrench, force[:, 6:], anchors, frames.reshape(m, c, 3, 3))
        if with_jacobian:
            partials = force_derivatives(model, places, state.v, state.a)
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
