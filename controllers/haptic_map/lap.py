"""The frame of the lap: how a steady drift over the ground moves the figure, and carries it over the seam."""

import numpy as np
from numba import njit

from controllers.state import Array

LAP_X, LAP_Y, LAP_HEADING, LAST_ANGLE, LAPS, MEMORY = range(6)


@njit
def sine_quotients(angle: float) -> tuple[float, float, float, float]:
    """S = sin α/α, C = (1 − cos α)/α, and their derivatives: the planar exponential moves by [S −C; C S] v."""
    if abs(angle) < 1e-2:
        a2 = angle * angle
        return (
            1.0 - a2 / 6.0 + a2 * a2 / 120.0,
            angle * (0.5 - a2 / 24.0 + a2 * a2 / 720.0),
            angle * (-1.0 / 3.0 + a2 / 30.0),
            0.5 - a2 / 8.0 + a2 * a2 / 144.0,
        )
    sine, cosine = np.sin(angle), np.cos(angle)
    s, c = sine / angle, (1.0 - cosine) / angle
    return s, c, (cosine - s) / angle, (sine - c) / angle


@njit
def update_lap(memory: Array, angle: float, drift: Array) -> None:
    """Carry the lap's frame A over the seam: A·exp(ξ) forwards, A·exp(−ξ) backwards."""
    change = angle - memory[LAST_ANGLE]
    memory[LAST_ANGLE] = angle
    # False for NaN, the first tick.
    if abs(change) > np.pi:
        way = 1.0 if change < 0.0 else -1.0
        s, c, _, _ = sine_quotients(way * drift[2])
        x, y = way * (s * drift[0] - c * drift[1]), way * (c * drift[0] + s * drift[1])
        cosine, sine = np.cos(memory[LAP_HEADING]), np.sin(memory[LAP_HEADING])
        memory[LAP_X] += cosine * x - sine * y
        memory[LAP_Y] += sine * x + cosine * y
        memory[LAP_HEADING] += way * drift[2]
        memory[LAPS] += way


@njit
def drift_motion(drift: Array, s: float, pace: float, local: Array, turn: Array) -> tuple[float, float]:
    """Translation of exp(s ξ), and the rates of it and of its angle.

    Parameters
    ----------
    drift : Array, shape (4, 3)
        ξ = (v_x, v_y, ω), and its derivatives by θ and two other parameters.
    s : float
        Share of the lap.
    pace : float
        2π ds/dθ.
    local : Array, shape (2, 3)
        Written: derivatives of the translation by the three.
    turn : Array, shape (3,)
        Written: derivatives of the angle s ω by the same.
    """
    angle = s * drift[0, 2]
    q_s, q_c, d_s, d_c = sine_quotients(angle)
    cosine, sine, rate = np.cos(angle), np.sin(angle), pace / (2.0 * np.pi)
    for k in range(3):
        turn[k] = s * drift[1 + k, 2]
        e_s, e_c = d_s * turn[k], d_c * turn[k]
        v_x, v_y = drift[1 + k, 0], drift[1 + k, 1]
        local[0, k] = s * (q_s * v_x - q_c * v_y + e_s * drift[0, 0] - e_c * drift[0, 1])
        local[1, k] = s * (q_c * v_x + q_s * v_y + e_c * drift[0, 0] + e_s * drift[0, 1])
    # By θ there is also the way along the drift.
    turn[0] += rate * drift[0, 2]
    local[0, 0] += rate * (cosine * drift[0, 0] - sine * drift[0, 1])
    local[1, 0] += rate * (sine * drift[0, 0] + cosine * drift[0, 1])
    return s * (q_s * drift[0, 0] - q_c * drift[0, 1]), s * (q_c * drift[0, 0] + q_s * drift[0, 1])
