r"""Balanced blends: the root of a map's in-betweens sways so that the zero-moment point lies within the support.

A mean of balanced motions is not balanced: its centre of mass and its feet are at the means of the clips', but the
stance foot need not be under the zero-moment point. For every mixture of the clips the zero-moment point p of a lap is
compared with the nearest supported point p* of the floor (`models.mocap.authoring.balance`), and the root is moved by
the sway δ of the cart-table model (Kajita et al. 2003), solved for a periodic lap harmonic by harmonic:

.. math:: \hat\delta = \widehat{(p^* - p)} / (1 + h \omega^2 / g)

The clips' own imbalance, interpolated by the weights of the mixture, is not corrected: a clip alone does not sway.
"""

from typing import NamedTuple

import mujoco
import numpy as np

from controllers.haptic_map.cylindrical import Cylindrical
from controllers.legs.sole_heights import SWINGS
from controllers.state import Array
from experiments.files.array_cache import kept_array
from models.gravity import GRAVITY
from models.humanoid.skeleton import CONTACT_RADIUS, FOOT_CONTACTS
from sim.compilation.sources import kept_folder
from sim.reference.reference import map_poses

_ROWS = 96  # samples of a lap
_ROUNDS = 3
_CUTOFF = 6.0  # highest frequency of the sway [Hz]
SHARE = 0.6  # the zero-moment point is to lie within the support scaled by this factor about its middle
_FARTHEST = 0.2  # largest sway [m]


class Laps(NamedTuple):
    """Dynamics of laps of k motions.

    Attributes
    ----------
    zmp : Array, shape (k, n, 2)
        Zero-moment points on the floor [m].
    load : Array, shape (k, n)
        Vertical force in body weights.
    contacts : Array, shape (k, n, 8, 3)
        Lowest points of the feet's contact spheres [m].
    height : float
        Mean height of the centre of mass [m].
    """

    zmp: Array
    load: Array
    contacts: Array
    height: float


def balanced(haptic_map: Cylindrical, figure: mujoco.MjModel, lap: float) -> Cylindrical:
    """The same map with a root that sways between the clips; the result is cached beside the compiled code.

    Parameters
    ----------
    haptic_map : Cylindrical
        Map with limbs.
    figure : mujoco.MjModel
        Model of the figure alone.
    lap : float
        Duration of a lap [s].
    """
    shape = (_ROWS, len(haptic_map.mixtures), 2)
    model = np.empty(mujoco.mj_sizeModel(figure), dtype=np.uint8)
    mujoco.mj_saveModel(figure, None, model)
    made_of = (haptic_map.compiled().params, haptic_map.mixtures, haptic_map.drifts, model, np.array([lap]))
    return haptic_map.with_sway(
        kept_array(kept_folder(__name__), "sway", made_of, shape, lambda: _sway(haptic_map, figure, lap))
    )


def _sway(haptic_map: Cylindrical, figure: mujoco.MjModel, lap: float) -> Array:
    weights = haptic_map.mixtures
    corners = weights.argmax(axis=0)
    # The poses begin one row before the seam, so the rows measured lie in the map's second lap.
    turn = -np.outer(weights @ haptic_map.drifts[:, 2], 1.0 + np.arange(_ROWS) / _ROWS)
    sway = np.zeros((_ROWS, len(weights), 2))
    for k in range(_ROUNDS):
        laps = _laps(haptic_map.with_sway(sway) if k > 0 else haptic_map, figure, lap)
        outside = laps.load[..., None] * (nearest_supported(laps.zmp, laps.contacts, SHARE) - laps.zmp)
        own = outside[corners]
        outside -= np.einsum("km,mnx->knx", weights, own)
        c, s = np.cos(turn), np.sin(turn)
        x, y = outside[..., 0], outside[..., 1]
        error = np.stack([c * x - s * y, s * x + c * y], axis=-1).transpose(1, 0, 2)
        sway += sway_of(error, laps.height, lap)
        size = np.linalg.norm(sway, axis=-1, keepdims=True)
        sway *= np.minimum(1.0, _FARTHEST / np.maximum(size, 1e-12))
    return sway


def nearest_supported(point: Array, contacts: Array, share: float) -> Array:
    """Points of the support polygon nearest to points on the floor.

    Parameters
    ----------
    point : Array, shape (..., 2)
        Points on the floor [m].
    contacts : Array, shape (..., c, 3)
        Lowest points of the contact spheres [m]; those near the floor span the support polygon.
    share : float
        Factor by which the polygon is scaled about its middle.

    Returns
    -------
    Array, shape (..., 2)
        The point itself where it lies inside, or where nothing touches the floor.
    """
    touching = contacts[..., 2] < SWINGS
    count = touching.sum(axis=-1)[..., None]
    middle = (contacts[..., :2] * touching[..., None]).sum(axis=-2) / np.maximum(count, 1)
    # Points that do not touch are put at the middle, so that every polygon has the same number of corners.
    corners = np.where(touching[..., None], share * (contacts[..., :2] - middle[..., None, :]), 0.0)
    corners += middle[..., None, :] - point[..., None, :]
    angles = np.sort(np.arctan2(corners[..., 1], corners[..., 0]), axis=-1)
    gaps = np.diff(angles, axis=-1, append=angles[..., :1] + 2.0 * np.pi)
    free = (gaps.max(axis=-1) < np.pi) | (count[..., 0] == 0)
    # From outside a convex hull, the nearest of all segments between two of its points is an edge.
    first, second = np.triu_indices(contacts.shape[-2], 1)
    start, along = corners[..., first, :], corners[..., second, :] - corners[..., first, :]
    length = np.maximum((along**2).sum(axis=-1), 1e-12)
    at = start + np.clip(-(start * along).sum(axis=-1) / length, 0.0, 1.0)[..., None] * along
    best = np.argmin((at**2).sum(axis=-1), axis=-1)[..., None, None]
    return point + np.where(free[..., None], 0.0, np.take_along_axis(at, best, axis=-2)[..., 0, :])


def _laps(haptic_map: Cylindrical, figure: mujoco.MjModel, lap: float) -> Laps:
    places = haptic_map.places(2.0 * np.pi * np.arange(-1, _ROWS + 1) / _ROWS)
    poses = np.stack([map_poses(haptic_map, stylus) for stylus in places])
    return measured_laps(poses, lap / _ROWS, figure)


def measured_laps(poses: Array, step: float, figure: mujoco.MjModel) -> Laps:
    """Dynamics of laps of poses (k, n + 2, 75) a time `step` [s] apart, with one pose before and one after each lap."""
    data = mujoco.MjData(figure)
    feet = [figure.geom(name).id for name in FOOT_CONTACTS]
    k, n = poses.shape[:2]
    com, spin, contacts = np.empty((k, n, 3)), np.empty((k, n, 3)), np.empty((k, n, len(feet), 3))
    velocity = np.empty(figure.nv)
    for node in range(k):
        for i in range(n):
            mujoco.mj_differentiatePos(figure, velocity, step, poses[node, max(i - 1, 0)], poses[node, i])
            data.qpos, data.qvel = poses[node, i], velocity
            mujoco.mj_kinematics(figure, data)
            mujoco.mj_comPos(figure, data)
            mujoco.mj_comVel(figure, data)
            mujoco.mj_subtreeVel(figure, data)
            com[node, i], spin[node, i] = data.subtree_com[1], data.subtree_angmom[1]
            contacts[node, i] = data.geom_xpos[feet]
    acceleration = (com[:, 2:] - 2.0 * com[:, 1:-1] + com[:, :-2]) / step**2
    force = acceleration + np.array([0.0, 0.0, GRAVITY])
    torque = (spin[:, 2:] - spin[:, 1:-1]) / (step * figure.body_subtreemass[1])
    com = com[:, 1:-1]
    lever = np.stack(
        [com[..., 2] * force[..., 0] + torque[..., 1], com[..., 2] * force[..., 1] - torque[..., 0]], axis=-1
    )
    up = np.maximum(force[..., 2], 0.1 * GRAVITY)
    contacts[..., 2] -= CONTACT_RADIUS
    zmp = com[..., :2] - lever / up[..., None]
    return Laps(zmp, up / GRAVITY, contacts[:, 1:-1], float(com[..., 2].mean()))


def sway_of(error: Array, height: float, lap: float) -> Array:
    """Sway (n, …) that moves the zero-moment point of a lap by `error` (n, …): cart-table model of `height` [m]."""
    frequency = np.arange(len(error) // 2 + 1) / lap
    spectrum = np.fft.rfft(error, axis=0)
    spectrum[frequency > _CUTOFF] = 0.0
    resistance = 1.0 + height / GRAVITY * (2.0 * np.pi * frequency) ** 2
    return np.fft.irfft(spectrum / resistance.reshape(-1, *[1] * (error.ndim - 1)), len(error), axis=0)
