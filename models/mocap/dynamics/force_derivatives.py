r"""Derivatives of inverse dynamics in closed form, for many states of the figure at once.

Spatial vectors (Featherstone 2008, Rigid Body Dynamics Algorithms; rotation and moment first) are about a point at rest
where the root is. With S_i the motions of the coordinates of joint i, V and A a segment's velocity and acceleration,
gravity subtracted, and F_i, I_i, B_i the sums over the segments that joint i carries of their force, inertia, and

    B u = I (u × V) + u ×* (I V) + V ×* (I u),

a coordinate with the motion W, of the joint between segments p and k, changes τ_i = S_iᵀ F_i by

    S_iᵀ (I_i a + B_i u)               if joint k carries joint i, or is it,
    S_iᵀ (I_k a + B_k u [+ W ×* F_k])  if joint i carries joint k,

with u = V_p × W, a = A_p × W + V_p × u and the term in brackets by position; u = W, a = (V_k + V_p) × W by velocity;
u = 0, a = W by acceleration (Carpentier & Mansard 2018, Robotics: Science and Systems XIV; for joints with several
coordinates Singh, Russell & Wensing 2022, IEEE Robot. Autom. Lett. 7).
"""

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from geometry.arrays import Array, Mask
from geometry.quaternions import cross_matrix
from models.humanoid.skeleton import N_TANGENT, figure_model
from models.mocap.dynamics.inverse_dynamics import SegmentPlaces


def force_derivatives(places: SegmentPlaces, v: Array, a: Array) -> Array:
    """Derivatives of the generalised forces of `inverse_dynamics` by position, velocity and acceleration.

    Parameters
    ----------
    places : SegmentPlaces
        Of m states.
    v, a : arrays, shape (m, 57)
        qvel and qacc. By position, their numbers are constant while the segments' frames, in which they are, rotate.

    Returns
    -------
    array, shape (m, 3, 57, 57)
        [:, o, i, k] of force i by position (o = 0; rotations are in the segments' frames), velocity, acceleration k.
    """
    model = figure_model()
    motions = _motions(places)
    segments, outer = _velocities(model, motions, v, a)
    inertia, cross = _inertias(model, places), _cross(segments.velocity)
    momentum, dual = inertia @ segments.velocity, -cross.swapaxes(-1, -2)
    force = inertia @ segments.acceleration + dual @ momentum
    bias = _force_cross(momentum) - inertia @ cross + dual @ inertia
    for body in range(model.nbody - 1, 0, -1):
        for total in (inertia, bias, force):
            total[:, model.body_parentid[body]] += total[:, body]

    outer_cross = _cross(outer.velocity)
    shift = outer_cross @ motions
    changes = (  # u and a by position, velocity, acceleration
        (shift, _cross(outer.acceleration) @ motions + outer_cross @ shift),
        (motions, (cross + outer_cross) @ motions),
        (np.zeros_like(motions), motions),
    )
    projections = motions.swapaxes(-1, -2)
    within = _rows(np.concatenate((projections @ inertia, projections @ bias), axis=-1))
    carried = np.repeat(_moving_coordinates(), 3, axis=0)
    carries = carried.T & ~carried
    derivatives = np.empty((len(v), 3, N_TANGENT, N_TANGENT))
    for order, (u, change) in enumerate(changes):
        total = inertia @ change + bias @ u
        if order == 0:
            total += _force_cross(force) @ motions
        of_order = np.matmul(within, _columns(np.concatenate((change, u), axis=-2)), out=derivatives[:, order])
        of_order *= carried
        of_order += carries * (_rows(projections) @ _columns(total))
    derivatives[:, 1] += np.diag(model.dof_damping)
    derivatives[:, 2] += np.diag(model.dof_armature)
    return derivatives


def point_derivatives(places: SegmentPlaces, points: Array, segments: Sequence[int]) -> Array:
    """Derivatives by position of points (m, k, 3) in W that are fixed to k segments, shape (m, k, 3, 57)."""
    columns = _columns(_motions(places))[:, None]
    arms = cross_matrix(points - places.joints[:, :1])
    return (columns[:, :, 3:] - arms @ columns[:, :, :3]) * _moving(segments)


def turn_derivatives(places: SegmentPlaces, segments: Sequence[int]) -> Array:
    """Derivatives by position of the rotations of k segments, as rotation vectors in W, shape (m, k, 3, 57)."""
    return _columns(_motions(places))[:, None, :3] * _moving(segments)


def _moving(segments: Sequence[int]) -> Mask:
    return _moving_coordinates()[1 + np.asarray(segments), None]


class _Velocities(NamedTuple):
    """Velocities, and accelerations with gravity subtracted, of the bodies or of their parents, (m, 19, 6, 1)."""

    velocity: Array
    acceleration: Array


def _velocities(model: mujoco.MjModel, motions: Array, v: Array, a: Array) -> tuple[_Velocities, _Velocities]:
    """Velocities of the bodies and of their parents; body 0 is the root before it is rotated, and has no mass."""
    bodies, parents = (_Velocities(*np.zeros((2, len(v), model.nbody, 6, 1))) for _ in range(2))
    parents.acceleration[:, 0, 3:, 0] = -model.opt.gravity
    for body, parent in enumerate(model.body_parentid):
        if body:
            parents.velocity[:, body] = bodies.velocity[:, parent]
            parents.acceleration[:, body] = bodies.acceleration[:, parent]
        rates = np.s_[:, 3 * body : 3 * body + 3, None]
        moved = motions[:, body] @ v[rates]
        bodies.velocity[:, body] = parents.velocity[:, body] + moved
        turned = _cross(bodies.velocity[:, body]) @ moved
        bodies.acceleration[:, body] = parents.acceleration[:, body] + motions[:, body] @ a[rates] + turned
    return bodies, parents


def _motions(places: SegmentPlaces) -> Array:
    """S of the bodies, shape (m, 19, 6, 3): displacements of the root, and rotations about the axes of the segments."""
    m, joints = len(places.joints), places.joints.shape[1]
    motions = np.zeros((m, 1 + joints, 6, 3))
    motions[:, 0, 3:] = np.eye(3)
    motions[:, 1:, :3] = places.frames
    motions[:, 1:, 3:] = cross_matrix(places.joints - places.joints[:, :1]) @ places.frames
    return motions


def _inertias(model: mujoco.MjModel, places: SegmentPlaces) -> Array:
    """Spatial inertias of the bodies, shape (m, 19, 6, 6)."""
    inertia = np.zeros((len(places.joints), model.nbody, 6, 6))
    mass = model.body_mass[1:, None, None]
    arm = cross_matrix(places.centres - places.joints[:, :1])
    own = (places.principal * model.body_inertia[1:, None]) @ places.principal.swapaxes(-1, -2)
    inertia[:, 1:, :3, :3] = own - mass * arm @ arm
    inertia[:, 1:, :3, 3:], inertia[:, 1:, 3:, :3] = mass * arm, -mass * arm
    inertia[:, 1:, 3:, 3:] = mass * np.eye(3)
    return inertia


def _cross(motion: Array) -> Array:
    """V × of motions (..., 6, 1) on motions, shape (..., 6, 6); −(V ×)ᵀ is V ×* on forces."""
    turning, moving = cross_matrix(motion[..., :3, 0]), cross_matrix(motion[..., 3:, 0])
    return np.block([[turning, np.zeros_like(turning)], [moving, turning]])


def _force_cross(force: Array) -> Array:
    """The matrix H of u ×* f = H u of forces (..., 6, 1), shape (..., 6, 6)."""
    moment, push = cross_matrix(force[..., :3, 0]), cross_matrix(force[..., 3:, 0])
    return -np.block([[moment, push], [push, np.zeros_like(push)]])


def _rows(of_bodies: Array) -> Array:
    """Rows of the bodies' coordinates (m, 19, 3, n) below each other, shape (m, 57, n)."""
    return of_bodies.reshape(len(of_bodies), N_TANGENT, -1)


def _columns(of_bodies: Array) -> Array:
    """Columns of the bodies' coordinates (m, 19, n, 3) beside each other, shape (m, n, 57)."""
    return _rows(of_bodies.swapaxes(-1, -2)).swapaxes(-1, -2)


def _moving_coordinates() -> Mask:
    """Which coordinates (57) move a body (19): those of its joint and of the joints that carry it."""
    parent = figure_model().body_parentid
    moves = np.eye(len(parent), dtype=bool)
    for body in range(1, len(parent)):
        moves[body] |= moves[parent[body]]
    return np.repeat(moves, 3, axis=1)
