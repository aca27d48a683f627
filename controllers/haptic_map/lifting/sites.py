"""Sites of curves in the half plane (r, z), at equal steps of the angle round the z axis of H."""

import numpy as np

from controllers.curves.splines import control_points, periodic_interpolation
from controllers.errors import ParameterError
from geometry.arrays import Array

_MIN_ROWS = 8
_MIN_RADIUS = 2e-3  # [m] least distance of the clamped stylus from the axis
_MIN_DISTANCE = 2e-4  # [m] least distance of two curves


def box(sites: Array) -> tuple[Array, Array]:
    """Least and largest (r, z) of the sites' control points, a box that no curve leaves, also between rows."""
    control = control_points(sites, np.ones(sites.shape[1:]))
    return control.min(axis=(0, 1)), control.max(axis=(0, 1))


def checked_sites(sites: Array, names: tuple[str, ...], margin: float) -> Array:
    """Validated sites of the named clips [m].

    Parameters
    ----------
    sites : Array, shape (rows, m, 2)
        (r, z) at equal steps of a lap.
    names : tuple of str
        Names of the m clips.
    margin : float
        Distance by which the clamped stylus may leave the box of the sites [m].

    Raises
    ------
    ParameterError
        If shape or numbers are wrong, a curve is too near to the axis, or two curves are too near to each other.
    """
    array = np.array(sites, dtype=np.float64)
    if array.ndim != 3 or len(array) < _MIN_ROWS or array.shape[1:] != (len(names), 2):
        raise ParameterError(
            f"sites must have shape (rows ≥ {_MIN_ROWS}, {len(names)} clips, 2: r and z), got {array.shape}"
        )
    if not np.isfinite(array).all():
        raise ParameterError(f"sites must be finite; at row {int(np.argwhere(~np.isfinite(array))[0][0])} one is not")
    least = float(box(array)[0][0])
    if least < _MIN_RADIUS + margin:
        raise ParameterError(
            f"a curve comes to {1e3 * least:.2f} mm from the axis, where the phase is not defined; expected "
            f"{1e3 * (_MIN_RADIUS + margin):.2f} mm or more"
        )
    places = periodic_interpolation(array, np.linspace(0.0, 2.0 * np.pi, 4 * len(array), endpoint=False))
    for i in range(len(names) - 1):
        distance = np.linalg.norm(places[:, i + 1 :] - places[:, i : i + 1], axis=2)
        if distance.min() < _MIN_DISTANCE:
            row, j = np.unravel_index(int(distance.argmin()), distance.shape)
            raise ParameterError(
                f"the curves of clips {names[i]} and {names[i + 1 + int(j)]} come to {1e3 * distance.min():.3f} mm of "
                f"each other at {2.0 * np.pi * float(row) / len(places):.2f} rad; "
                f"expected {1e3 * _MIN_DISTANCE} mm or more"
            )
    return array
