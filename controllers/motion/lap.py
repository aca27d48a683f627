r"""The frame of the lap: moves the figure over the ground at the seam of the lap, and compensates changes of the drift.

In the frame A ∈ SE(2) of the lap the root is at exp(s ξ), with s the elapsed fraction of the lap and ξ the drift per
lap. ξ changes when the hand changes the blend of clips that travel differently. The distance covered so far must not
change with it: otherwise a hand that moves sideways late in a lap would carry the figure over the floor by metres. So A
compensates it,

.. math:: A \leftarrow A\,\exp(\bar s\,\xi_{before})\,\exp(-\bar s\,\xi_{now}), \qquad
          \bar s = \tfrac12 (s_{before} + s_{now}),

and the figure moves by ∫ ξ ds along the hand's path (by the trapezoid rule, to second order in the step).
"""

import numpy as np
from numba import njit

from geometry.arrays import Array

LAP_X, LAP_Y, LAP_HEADING, LAST_ANGLE, LAPS, LAST_DRIFT = range(6)
MEMORY = LAST_DRIFT + 3


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
def _move_frame(memory: Array, s: float, drift: Array) -> None:
    """A ← A·exp(s ξ), for a drift ξ, shape (3,)."""
    q_s, q_c, _, _ = sine_quotients(s * drift[2])
    x, y = s * (q_s * drift[0] - q_c * drift[1]), s * (q_c * drift[0] + q_s * drift[1])
    cosine, sine = np.cos(memory[LAP_HEADING]), np.sin(memory[LAP_HEADING])
    memory[LAP_X] += cosine * x - sine * y
    memory[LAP_Y] += sine * x + cosine * y
    memory[LAP_HEADING] += s * drift[2]


@njit
def update_lap(memory: Array, angle: float, drift: Array) -> None:
    """Carry the frame of the lap over the seam, A·exp(ξ) forwards and A·exp(−ξ) backwards, and over changes of ξ."""
    before, last = memory[LAST_ANGLE], memory[LAST_DRIFT : LAST_DRIFT + 3]
    memory[LAST_ANGLE] = angle
    # The comparison is false for the NaN of the first tick.
    if abs(angle - before) > np.pi:
        direction = 1.0 if angle < before else -1.0
        _move_frame(memory, direction, last)
        before -= direction * 2.0 * np.pi
        memory[LAPS] += direction
    if before == before and (drift[0] != last[0] or drift[1] != last[1] or drift[2] != last[2]):
        s = (before + angle) / (4.0 * np.pi)
        _move_frame(memory, s, last)
        _move_frame(memory, -s, drift)
    for k in range(3):
        last[k] = drift[k]


@njit
def drift_motion(drift: Array, s: float, pace: float, local: Array, turn: Array) -> tuple[float, float]:
    """Translation of exp(s ξ) [m]; writes the derivatives of translation and angle.

    Parameters
    ----------
    drift : Array, shape (4, 3)
        ξ = (v_x, v_y, ω), and its derivatives by θ and two other parameters.
    s : float
        Share of the lap.
    pace : float
        2π ds/dθ.
    local : Array, shape (2, 3)
        Written: derivatives of the translation by the three parameters.
    turn : Array, shape (3,)
        Written: derivatives of the angle s ω by the three parameters.
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
    # The derivative by θ also has a part from s(θ).
    turn[0] += rate * drift[0, 2]
    local[0, 0] += rate * (cosine * drift[0, 0] - sine * drift[0, 1])
    local[1, 0] += rate * (sine * drift[0, 0] + cosine * drift[0, 1])
    return s * (q_s * drift[0, 0] - q_c * drift[0, 1]), s * (q_c * drift[0, 0] + q_s * drift[0, 1])
