"""A hand that glides from one river to the next at given moments."""

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.fields.algebra.instructions import TRACE_PHASE, TRACE_RIVER, TRACE_SIZE
from controllers.state import stylus_path

GLIDE = 0.3  # [s], half of it before the moment


def gliding_hand(
    curves: list[Trajectory], lap: float, rivers: tuple[tuple[float, int], ...], t: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Stylus poses and trace rows at moments t [s]; it begins in river 0 and changes at each (moment, river)."""
    river, share = np.zeros(len(t)), np.zeros((len(curves), len(t)))
    share[0] = 1.0
    for moment, number in rivers:
        river[t >= moment] = number
        s = np.clip((t - moment) / GLIDE + 0.5, 0.0, 1.0)
        s = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
        share *= 1.0 - s
        share[number] += s
    points = sum(w[:, None] * curve.point(t % lap) for w, curve in zip(share, curves, strict=True))
    traces = np.zeros((len(t), TRACE_SIZE))
    traces[:, TRACE_RIVER], traces[:, TRACE_PHASE] = river, t % lap
    return stylus_path(points), traces
