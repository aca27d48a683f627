r"""Balance over the feet: zero-moment point, support polygon, and the sway that moves the former into the latter.

The zero-moment point (Vukobratović & Borovac 2004) is the centre of pressure that a motion needs: with mass m, centre
of mass c, angular momentum L about it and F = m (c̈ + g e_z),

.. math:: p_x = c_x - (c_z F_x + \dot L_y) / F_z, \qquad p_y = c_y - (c_z F_y - \dot L_x) / F_z.

Feet can only give it inside the support polygon, the convex hull of their contacts.
"""

import numpy as np

from geometry.arrays import Array, Mask
from geometry.physics import GRAVITY


def zero_moment_point(com: Array, force: Array, torque: Array) -> Array:
    """Zero-moment points on the floor [m], shape (…, 2).

    Parameters
    ----------
    com : array, shape (…, 3)
        Centre of mass c [m].
    force, torque : array, shape (…, 3)
        F [N] and the rate of angular momentum L̇ [N m], or both per mass.
    """
    z = com[..., 2]
    lever = np.stack([z * force[..., 0] + torque[..., 1], z * force[..., 1] - torque[..., 0]], axis=-1)
    return com[..., :2] - lever / force[..., 2:]


def nearest_supported(point: Array, contacts: Array, touching: Mask, share: float) -> Array:
    """Points of the support polygon nearest to points on the floor.

    Parameters
    ----------
    point : array, shape (…, 2)
        Points on the floor [m].
    contacts : array, shape (…, c, 2)
        Contact points over the floor [m].
    touching : array, shape (…, c)
        Which of them touch the floor: these span the support polygon.
    share : float
        Factor by which the polygon is scaled about its middle.

    Returns
    -------
    array, shape (…, 2)
        The point itself where it lies inside, or where nothing touches the floor.
    """
    count = touching.sum(axis=-1)[..., None]
    middle = (contacts * touching[..., None]).sum(axis=-2) / np.maximum(count, 1)
    # Points that do not touch are put at the middle, so that every polygon has the same number of corners.
    corners = np.where(touching[..., None], share * (contacts - middle[..., None, :]), 0.0)
    corners += middle[..., None, :] - point[..., None, :]
    angles = np.sort(np.arctan2(corners[..., 1], corners[..., 0]), axis=-1)
    gaps = np.diff(angles, axis=-1, append=angles[..., :1] + 2.0 * np.pi)
    free = (gaps.max(axis=-1) < np.pi) | (count[..., 0] == 0)
    # From outside a convex hull, the nearest of all segments between two of its points is an edge.
    first, second = np.triu_indices(contacts.shape[-2], 1)
    start, along = corners[..., first, :], corners[..., second, :] - corners[..., first, :]
    length = np.maximum((along**2).sum(axis=-1), 1e-12)
    candidates = start + np.clip(-(start * along).sum(axis=-1) / length, 0.0, 1.0)[..., None] * along
    best = np.argmin((candidates**2).sum(axis=-1), axis=-1)[..., None, None]
    return point + np.where(free[..., None], 0.0, np.take_along_axis(candidates, best, axis=-2)[..., 0, :])


def sway_of(error: Array, height: float, lap: float, cutoff: float) -> Array:
    r"""Sway δ of the pelvis that moves the zero-moment point of a lap by an error e.

    By the cart-table model (Kajita et al. 2003) it moves by δ − (h/g) δ̈; solved harmonic by harmonic of the lap:

    .. math:: \hat\delta = \hat e / (1 + h \omega^2 / g)

    Parameters
    ----------
    error : array, shape (n, …)
        At equal steps of the lap [m].
    height : float
        Height h of the centre of mass [m].
    lap : float
        Duration of the lap [s].
    cutoff : float
        Highest frequency of the sway [Hz].
    """
    frequency = np.arange(len(error) // 2 + 1) / lap
    spectrum = np.fft.rfft(error, axis=0)
    spectrum[frequency > cutoff] = 0.0
    resistance = 1.0 + height / GRAVITY * (2.0 * np.pi * frequency) ** 2
    return np.fft.irfft(spectrum / resistance.reshape(-1, *[1] * (error.ndim - 1)), len(error), axis=0)
