"""Balance of a cyclic motion: its zero-moment point, and the sway of the pelvis that brings it under the feet.

The zero-moment point (Vukobratović & Borovac 2004) is the centre of pressure that the motion needs: with mass m, centre
of mass c, angular momentum L about it and F = m (c̈ + g e_z),

    p_x = c_x − (c_z F_x + L̇_y) / F_z,    p_y = c_y − (c_z F_y − L̇_x) / F_z.

Feet can only give it inside the support polygon, the convex hull of their contacts.
"""

from typing import NamedTuple

import mujoco
import numpy as np
from scipy.spatial import ConvexHull, QhullError

from models.arrays import Array
from models.gravity import GRAVITY
from models.humanoid.skeleton import CONTACT_RADIUS, FOOT_CONTACTS, figure_model
from models.mocap.authoring.authoring import Choreography, poses_at
from models.mocap.motion.clip import Clip

# Height below which a contact sphere is support [m], at any speed, unlike in `contacts`: authored soles are exact.
_SUPPORT_HEIGHT = 0.006
_CUTOFF, _ROUNDS = 8.0, 12  # highest frequency of the sway [Hz], and iterations of its correction
_WITHIN = 0.7  # the zero-moment point is to lie within the support polygon scaled by this about its middle


class Dynamics(NamedTuple):
    """Ground reaction force that a motion needs, frame by frame.

    Attributes
    ----------
    com : array, shape (n, 3)
        Centre of mass [m].
    force : array, shape (n, 3)
        Ground reaction force [N].
    torque : array, shape (n, 3)
        Rate of angular momentum about the centre of mass [N m]: the moment of the ground reaction about it.
    zmp : array, shape (n, 2)
        Zero-moment point on the floor [m].
    contacts : array, shape (n, 8, 3)
        Centres of the feet's contact spheres [m], in the order of `FOOT_CONTACTS`.
    """

    com: Array
    force: Array
    torque: Array
    zmp: Array
    contacts: Array


def dynamics(clip: Clip) -> Dynamics:
    """Centre of mass, ground reaction and zero-moment point of a clip that closes in place, by finite differences.

    Parameters
    ----------
    clip : Clip
        A cyclic clip whose last frame is its first, without displacement.

    Returns
    -------
    Dynamics
        One row for each frame but the last.
    """
    model = figure_model()
    data = mujoco.MjData(model)
    pelvis = model.body("pelvis").id
    feet = [model.geom(name).id for name in FOOT_CONTACTS]
    velocities = clip.velocities()
    n = len(clip.poses) - 1
    com, spin, contacts = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, len(feet), 3))
    for k in range(n):
        data.qpos, data.qvel = clip.poses[k], velocities[k]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_subtreeVel(model, data)
        com[k], spin[k], contacts[k] = data.subtree_com[pelvis], data.subtree_angmom[pelvis], data.geom_xpos[feet]
    acceleration = (np.roll(com, -1, axis=0) - 2 * com + np.roll(com, 1, axis=0)) * clip.fps**2
    force = model.body_subtreemass[pelvis] * (acceleration + np.array([0.0, 0.0, GRAVITY]))
    torque = (np.roll(spin, -1, axis=0) - np.roll(spin, 1, axis=0)) * clip.fps / 2
    lever = np.stack([com[:, 2] * force[:, 0] + torque[:, 1], com[:, 2] * force[:, 1] - torque[:, 0]], axis=1)
    return Dynamics(com, force, torque, com[:, :2] - lever / force[:, 2:], contacts)


def supported(point: Array, contacts: Array, share: float = 1.0) -> Array:
    """The point of the support polygon nearest to a point on the floor.

    Parameters
    ----------
    point : array, shape (2,)
        The point [m].
    contacts : array, shape (k, 3)
        Centres of the contact spheres [m]; those that touch the floor span the polygon.
    share : float
        Factor by which the polygon is scaled about its middle.

    Returns
    -------
    array, shape (2,)
        The point itself when it lies inside or when nothing touches the floor.
    """
    touching = contacts[contacts[:, 2] < CONTACT_RADIUS + _SUPPORT_HEIGHT, :2]
    if len(touching) == 0:
        return point
    middle = touching.mean(axis=0)
    corners = middle + share * (touching - middle)
    if len(corners) > 2:
        try:
            hull = ConvexHull(corners)
        except QhullError:  # the corners lie on a line
            corners = corners[np.argsort(corners @ np.ptp(corners, axis=0))]
        else:
            if np.all(hull.equations[:, :2] @ point + hull.equations[:, 2] <= 0):
                return point
            corners = corners[hull.vertices]
    along = np.roll(corners, -1, axis=0) - corners
    length = np.maximum(np.sum(along * along, axis=1), 1e-12)
    where = np.clip(np.sum((point - corners) * along, axis=1) / length, 0.0, 1.0)
    nearest = corners + where[:, None] * along
    return nearest[np.argmin(np.linalg.norm(nearest - point, axis=1))]


def balanced_clip(choreography: Choreography, fps: float) -> Clip:
    """Sample a cyclic in-place choreography with a sway of the pelvis that keeps the zero-moment point under the feet.

    A sway δ of the pelvis moves the zero-moment point by about δ − (h/g) δ̈ (cart-table model, Kajita et al. 2003). For
    a periodic error e this is solved harmonic by harmonic, δ̂ = ê / (1 + h ω²/g), and iterated with the exact dynamics.

    Parameters
    ----------
    choreography : Choreography
        The motion; its sway is added to the x and y of its keys.
    fps : float
        Frame rate [1/s].

    Returns
    -------
    Clip
        One lap, its last frame closing on the first.
    """
    n = round(choreography.duration * fps)
    t = np.linspace(0.0, choreography.duration, n + 1)
    sway = np.zeros((n + 1, 2))
    frequency = np.arange(n // 2 + 1) / choreography.duration
    for _ in range(_ROUNDS):
        motion = dynamics(Clip(poses_at(choreography, t, sway), fps, choreography.name))
        wanted = [
            supported(point, contacts, _WITHIN) for point, contacts in zip(motion.zmp, motion.contacts, strict=True)
        ]
        # A sway adds a moment, which moves the zero-moment point further where the vertical force is smaller.
        load = np.maximum(motion.force[:, 2:] / motion.force[:, 2].mean(), 0.0)
        error = np.fft.rfft(load * (np.array(wanted) - motion.zmp), axis=0)
        error[frequency > _CUTOFF] = 0.0
        error /= (1 + motion.com[:, 2].mean() / GRAVITY * (2 * np.pi * frequency) ** 2)[:, None]
        change = np.fft.irfft(error, n, axis=0)
        sway += np.vstack([change, change[:1]])
    return Clip(poses_at(choreography, t, sway), fps, choreography.name)
