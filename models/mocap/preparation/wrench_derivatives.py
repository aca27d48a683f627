"""Derivatives of the required wrench, of torques and of places, in the tangent of `Clip` poses."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from geometry.arrays import Array
from geometry.quaternions import cross_matrix
from models.humanoid.skeleton import CONTACT_RADIUS, N_TANGENT, figure_model
from models.mocap.dynamics.floor_forces import RequiredWrench, carriers
from models.mocap.dynamics.force_derivatives import force_derivatives, point_derivatives, turn_derivatives
from models.mocap.preparation.change import State


class WrenchDerivatives:
    """Derivatives of the inverse dynamics of m states by position, velocity and acceleration in the tangent.

    Parameters
    ----------
    state : State
        The states.
    demand : RequiredWrench
        Their inverse dynamics.
    segments : sequence of int
        The segments of the k contact spheres.

    Attributes
    ----------
    wrench : array, shape (m, 3, 6, 57)
        Derivatives of the wrench about the centre of mass by position, velocity, acceleration.
    torque : array, shape (m, 3, 51, 57)
        Derivatives of the joint torques without contact, likewise.
    spheres, com : arrays, shapes (m, k, 3, 57), (m, 3, 57)
        Derivatives by position of the contact spheres' centres and of the centre of mass.
    """

    def __init__(self, state: State, demand: RequiredWrench, segments: Sequence[int]) -> None:
        self._demand, model = demand, figure_model()
        self.spheres = point_derivatives(demand.places, demand.spheres, segments)
        centres = point_derivatives(demand.places, demand.places.centres, range(model.nbody - 1))
        self.com = np.tensordot(centres, model.body_mass[1:] / model.body_subtreemass[1], axes=(1, 0))
        partials = force_derivatives(demand.places, state.v, state.a)
        m = len(partials)
        velocity_cross = cross_matrix(state.v[:, 3:].reshape(m, 18, 3))
        acceleration_cross = cross_matrix(state.a[:, 3:].reshape(m, 18, 3))
        for j in range(18):
            # Tangents are in the segment's own frame, so a rotation of it also rotates its velocity and acceleration.
            c = slice(3 + 3 * j, 6 + 3 * j)
            partials[:, 0, :, c] += (
                partials[:, 1, :, c] @ velocity_cross[:, j] + partials[:, 2, :, c] @ acceleration_cross[:, j]
            )
            partials[:, 1, :, c] += partials[:, 2, :, c] @ velocity_cross[:, j]
        root, force, arm = demand.places.frames[:, 0], demand.force, demand.com - state.q[:, :3]
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
        leaning = np.zeros((len(states), 51, N_TANGENT))
        places = self._demand.places.of(states)
        soles = self._demand.spheres[states] - (0.0, 0.0, CONTACT_RADIUS)
        loaded = carriers(soles.shape[1])
        bodies = [carrier.body for carrier in loaded]
        anchors = point_derivatives(places, places.joints[:, bodies], bodies)
        turns = turn_derivatives(places, bodies)
        for joint, (body, loading) in enumerate(loaded):
            force = pushes[states, loading]
            moment = np.cross(soles[:, loading] - places.joints[:, body, None], force).sum(1)
            moved = self.spheres[states, loading] - anchors[:, joint, None]
            change = -(cross_matrix(force) @ moved).sum(1) + cross_matrix(moment) @ turns[:, joint]
            leaning[:, 3 * (body - 1) : 3 * body] = places.frames[:, body].transpose(0, 2, 1) @ change
        return leaning
