r"""Path of a walking figure, extended at its front and stored in a ring buffer: uniform cubic B-splines.

.. math:: A(s) = \sum_j B(s/\Delta - j)\,(x_j, y_j, \theta_j, \varphi_j)

s is the arc length [m], (x, y) the position on the floor [m], θ the heading [rad] and φ the lean of the figure to the
left [rad]. A is C², and its arc length is s to second order in κΔ. The difference of rows j and j + 1 turns the heading
only for s from (j − 1) Δ to (j + 2) Δ. A row also stores the commanded curvature before it, |κ| [1/m], and the
centripetal acceleration to the left that it needs [m/s²].

The ring contains the last `ROWS` rows, 61 m, so that an endless walk needs no more memory; older rows are overwritten.
A packed path is ``[front, rows (ROWS × 6)]``; row j is at ``j mod ROWS``, front is the last j.
"""

import numpy as np
from numba import njit

from controllers.curves.splines import basis
from geometry.arrays import Array
from geometry.physics import GRAVITY

STEP = 0.03  # Δ [m]
ROWS = 2048  # rows of the ring buffer: the last 61 m of the path are kept
PATH_X, PATH_Y, PATH_HEADING, PATH_LEAN, PATH_BEND, PATH_SIDEWARDS, ROW = range(7)
PACKED_PATH = 1 + ROW * ROWS


def straight_path(x: float, y: float, heading: float, ahead: float) -> Array:
    """Packed straight path through (x, y) [m] at s = 0, laid up to s = `ahead` [m], and backwards to fill the ring."""
    last = int(np.ceil(ahead / STEP)) + 1
    rows = np.arange(last - ROWS + 1, last + 1)
    path = np.zeros((ROWS, ROW))
    path[rows % ROWS, PATH_X], path[rows % ROWS, PATH_Y] = (
        x + rows * STEP * np.cos(heading),
        y + rows * STEP * np.sin(heading),
    )
    path[:, PATH_HEADING] = heading
    return np.concatenate([[last], path.ravel()])


@njit
def path_front(path: Array) -> float:
    """Largest s [m] at which the path is defined."""
    return (path[0] - 1.0) * STEP


@njit
def path_back(path: Array) -> float:
    """Smallest s [m] at which the path is still stored."""
    return (path[0] - ROWS + 3.0) * STEP


@njit
def path_value(path: Array, s: float, channel: int) -> tuple[float, float]:
    """A channel of A(s) and its derivative by s; s is clamped to the stored path."""
    place = min(max(s, path_back(path)), path_front(path)) / STEP
    row = min(np.floor(place), path[0] - 2.0)
    u = place - row
    j, at = int(row), 1 + channel
    p0, p1 = path[at + ROW * ((j - 1) % ROWS)], path[at + ROW * (j % ROWS)]
    p2, p3 = path[at + ROW * ((j + 1) % ROWS)], path[at + ROW * ((j + 2) % ROWS)]
    b0, b1, _, b3 = basis(u)
    # By differences, so that a straight path has exactly the same heading everywhere.
    a, b, c = p1 - p0, p2 - p1, p3 - p2
    value = p1 - b0 * a + (1.0 - b0 - b1) * b + b3 * c
    slope = 0.5 * (1.0 - u) * (1.0 - u) * a + (0.5 + u * (1.0 - u)) * b + 0.5 * u * u * c
    return value, slope / STEP


@njit
def lay_row(path: Array, turn: float, bend: float, sidewards: float) -> None:
    """Append a row at the front, its heading turned by `turn` [rad] from the last; the oldest row is overwritten."""
    front = int(path[0])
    last, new = 1 + ROW * (front % ROWS), 1 + ROW * ((front + 1) % ROWS)
    middle = path[last + PATH_HEADING] + 0.5 * turn
    path[new + PATH_X] = path[last + PATH_X] + STEP * np.cos(middle)
    path[new + PATH_Y] = path[last + PATH_Y] + STEP * np.sin(middle)
    path[new + PATH_HEADING] = path[last + PATH_HEADING] + turn
    path[new + PATH_LEAN], path[new + PATH_BEND], path[new + PATH_SIDEWARDS] = 0.0, bend, sidewards
    path[0] = front + 1.0


@njit
def lean_row(path: Array, back: int, decay: float, past: float) -> float:
    r"""Write the lean of the row `back` rows behind the front, from the lateral accelerations before and after it.

    .. math:: \tan\varphi_m = \frac{1}{g N}\sum_j r^{|j - m|}\,a_j

    It is the lean of a linear inverted pendulum with its foot on the path, which leans before, in and after a bend.

    Parameters
    ----------
    path : Array
        Packed path; the lean of the row is written.
    back : int
        Number of rows in front of the row, all of which count.
    decay : float
        r, factor from row to row.
    past : float
        Σ r^(m − 1 − j) a_j over the rows j < m behind the row.

    Returns
    -------
    float
        The same sum for the next row.
    """
    front = int(path[0])
    row = front - back
    past = decay * past + path[1 + ROW * (row % ROWS) + PATH_SIDEWARDS]
    total, share, norm = past, 1.0, 1.0 / (1.0 - decay)
    for j in range(row + 1, front + 1):
        share *= decay
        total += share * path[1 + ROW * (j % ROWS) + PATH_SIDEWARDS]
        norm += share
    path[1 + ROW * (row % ROWS) + PATH_LEAN] = np.arctan(total / (norm * GRAVITY))
    return past
