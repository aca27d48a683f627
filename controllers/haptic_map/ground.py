r"""Blends stand on the ground: a correction of the height that makes up for bent and straight legs.

The mean of a squat and a stance has legs longer than the mean height of their roots allows: its feet sink. With the
soft minimum ℓ of the heights of the points that may touch the ground, the root of a blend is raised by

.. math:: c(\theta, a, b) = f(\textstyle\sum_i w_i \,\ell(h_i(\theta))) - f(\ell(\bar h(\theta, a, b)))

so the lowest point of the blend is as high as the clips' are on average; a clip alone is left as it is. f(x) = x
below the ground and H tanh(x/H) above: in flight there is nothing to correct. What points these are is the caller's
knowledge. c is smoothed over a sixty-fourth of the lap and tabulated: cubic B-splines round the lap, polynomials of
degree 4 in the weights a and b.
"""

from collections.abc import Callable

import numpy as np
from numba import njit

from controllers.errors import ParameterError
from controllers.haptic_map.splines import basis, basis_slope, control_points
from controllers.state import Array

Heights = Callable[[Array], Array]  # poses (n, nq) → heights above the ground of k points (n, k) [m]

_NODES = 5  # of each weight, 0, ¼, … 1
_SAMPLES = 128
_SOFTNESS = 0.02  # [m] of the minimum
_FLIGHT = 0.1  # [m] above which height no longer matters
_BLUR = 2.0  # [samples] so that a change of feet does not jerk the pelvis


# Coefficients of Lagrange's polynomials on the nodes: row k holds the powers 0…4 of the one that is 1 at node k.
_POWERS: Array = np.linspace(0.0, 1.0, _NODES)[:, None] ** np.arange(_NODES)
_LAGRANGE: Array = np.ascontiguousarray(np.linalg.inv(_POWERS).T, dtype=np.float64)


@njit
def ground_correction(params: Array, at: int, angle: float, a: float, b: float) -> tuple[float, float, float, float]:
    """Correction c and its derivatives by θ, a and b, from the table at ``params[at:]``."""
    s = angle * _SAMPLES / (2.0 * np.pi)
    row = min(int(s), _SAMPLES - 1)
    weights, slopes, rate = basis(s - row), basis_slope(s - row), _SAMPLES / (2.0 * np.pi)
    value = by_angle = by_a = by_b = 0.0
    for i in range(_NODES):
        p = _LAGRANGE[i]
        l_a = p[0] + a * (p[1] + a * (p[2] + a * (p[3] + a * p[4])))
        d_a = p[1] + a * (2.0 * p[2] + a * (3.0 * p[3] + 4.0 * a * p[4]))
        for j in range(_NODES):
            p = _LAGRANGE[j]
            l_b = p[0] + b * (p[1] + b * (p[2] + b * (p[3] + b * p[4])))
            d_b = p[1] + b * (2.0 * p[2] + b * (3.0 * p[3] + 4.0 * b * p[4]))
            height = turn = 0.0
            for k in range(4):
                c = params[at + ((row + k) * _NODES + i) * _NODES + j]
                height += weights[k] * c
                turn += slopes[k] * c
            value += l_a * l_b * height
            by_angle += l_a * l_b * turn * rate
            by_a += d_a * l_b * height
            by_b += l_a * d_b * height
    return value, by_angle, by_a, by_b


def blended(channels: Array, weights: Array) -> Array:
    """Blends (n, nq) of remainders (n, m, nq) with weights (m,): the same means as the kernel's, by eigenvectors."""
    n, m, nq = channels.shape
    quaternions = channels[:, :, 3:].reshape(n, m, -1, 4)
    moments = np.einsum("m,nmjx,nmjy->njxy", weights, quaternions, quaternions)
    means = np.linalg.eigh(moments).eigenvectors[..., -1]
    return np.concatenate([np.einsum("m,nmx->nx", weights, channels[:, :, :3]), means.reshape(n, nq - 3)], axis=1)


def _soft_minimum(heights: Array) -> Array:
    least = heights.min(axis=1)
    return least - _SOFTNESS * np.log(np.exp((least[:, None] - heights) / _SOFTNESS).sum(axis=1))


def _grounded(height: Array) -> Array:
    return np.where(height < 0.0, height, _FLIGHT * np.tanh(height / _FLIGHT))


def ground_table(channels: Array, heights: Heights) -> Array:
    """Table of c for four aligned loops, shape ((128 + 3) × 5 × 5,).

    Parameters
    ----------
    channels : Array, shape (n, 4, nq)
        Remainders at equal steps of the lap (see `alignment`).
    heights : Heights
        Heights of the points that may touch the ground.

    Raises
    ------
    ParameterError
        If the heights are not finite numbers, k a pose.
    """
    n = len(channels)
    channels = channels[np.round(np.arange(_SAMPLES) * n / _SAMPLES).astype(int) % n]
    nodes = np.linspace(0.0, 1.0, _NODES)
    low = np.empty((_SAMPLES, _NODES, _NODES))
    for i, a in enumerate(nodes):
        for j, b in enumerate(nodes):
            weights = np.array([(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b])
            found = np.asarray(heights(blended(channels, weights)), dtype=np.float64)
            if found.ndim != 2 or len(found) != _SAMPLES or not np.isfinite(found).all():
                raise ParameterError(
                    f"heights of {_SAMPLES} poses must be finite, of shape ({_SAMPLES}, k); got {found.shape}"
                )
            low[:, i, j] = _soft_minimum(found)
    ease = np.stack([1.0 - nodes, nodes])
    corners = low[:, :: _NODES - 1, :: _NODES - 1]
    mean = np.einsum("nij,ia,jb->nab", corners, ease, ease)
    correction = _grounded(mean) - _grounded(low)
    blur = np.exp(-0.5 * (2.0 * np.pi * _BLUR * np.fft.rfftfreq(_SAMPLES)) ** 2)
    spectrum = np.fft.rfft(correction, axis=0) * blur[:, None, None]
    return control_points(np.fft.irfft(spectrum, _SAMPLES, axis=0), np.ones(1)).ravel()
