r"""Precomputed transitions from one river's clip to another's, as an offset added to the second clip.

.. math:: h = \rho_j(\varphi)\,\exp o(\varphi - g), \qquad o(s) = 0 \text{ for } s \ge T

The transition begins at the gate g, a phase of the lap, and lasts T. At the gate o is the difference of the first clip
from the second, so that the pose does not jump. The root is moved in its own frame, and every rotation is turned in its
own frame. o is a uniform cubic B-spline, C².
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit

from controllers.borrowed import without_refcount
from controllers.curves.splines import control_points, interpolate
from controllers.state import Pose
from controllers.work_array import work_array
from geometry.arrays import Array
from geometry.rotations import angular_velocity, exponential, multiply, rotate

FPS = 120.0  # rows of o per second of the phase
LEAD_IN = 0.1  # [s] before the gate at which the rows begin
# Number of rows of zeros, and then of copies of the first row, that close the periodic spline after the last row. They
# are never read, and their influence decays by 0.27 per row, to 7e-10.
_PADDING = 16
# Columns of the directory: first and second river, offset and number of rows, offset and number of gates.
_FIRST, _SECOND, _FIRST_ROW, _ROW_COUNT, _FIRST_GATE, _GATE_COUNT, _ENTRY_SIZE = range(7)


class ClipChange(NamedTuple):
    """A precomputed transition from one river's clip to another's.

    Attributes
    ----------
    first, second : int
        Numbers of the rivers.
    gates : Array, shape (m,)
        Phases at which the change may begin, after the start of the lap [s].
    offsets : Array, shape (n, nv)
        Rows of o from `LEAD_IN` before the gate on, `FPS` per second; zero at the end.
    """

    first: int
    second: int
    gates: Array
    offsets: Array

    @property
    def seconds(self) -> float:
        """T, duration from the gate to the end [s]."""
        return (len(self.offsets) - 1) / FPS - LEAD_IN


def packed_changes(changes: Sequence[ClipChange]) -> Array:
    """Changes packed for the kernels: their number, a directory, then their rows and gates."""
    at, rows, data = 1 + _ENTRY_SIZE * len(changes), [], []
    for change in changes:
        blank = np.zeros((_PADDING, change.offsets.shape[1]))
        samples = np.concatenate([change.offsets, blank, blank + change.offsets[0]])
        control = control_points(samples, np.ones(1)).ravel()
        gates = np.asarray(change.gates, dtype=np.float64)
        rows.append([change.first, change.second, at, len(change.offsets), at + len(control), len(gates)])
        data += [control, gates]
        at += len(control) + len(gates)
    return np.concatenate([[len(changes)], *rows, *data])


@njit
def known_between(changes: Array, first: float, second: float) -> bool:
    """Whether there is a precomputed change from one river to another."""
    for k in range(int(changes[0])):
        entry = changes[1 + k * _ENTRY_SIZE :]
        if entry[_FIRST] == first and entry[_SECOND] == second:
            return True
    return False


@njit
def passed_gate(
    changes: Array, first: float, second: float, before: float, now: float, lap: float
) -> tuple[int, float]:
    """Number and gate [s] of a change between two rivers whose gate lies between the phases `before` and `now`.

    Phases count from the start of the lap [s]. The number is −1 if no gate was passed.
    """
    step = now - before
    step -= lap * np.round(step / lap)
    for k in range(int(changes[0])):
        entry = changes[1 + k * _ENTRY_SIZE :]
        if entry[_FIRST] == first and entry[_SECOND] == second:
            gates = int(entry[_FIRST_GATE])
            for i in range(gates, gates + int(entry[_GATE_COUNT])):
                behind = now - changes[i]
                behind -= lap * np.floor(behind / lap)
                if behind < step:
                    return k, float(changes[i])
    return -1, 0.0


@njit
def transition_duration(changes: Array, k: int) -> float:
    """T, duration of a change [s]."""
    return (changes[1 + k * _ENTRY_SIZE + _ROW_COUNT] - 1.0) / FPS - LEAD_IN


@njit
def add_change(changes: Array, k: int, s: float, along: Array, pose: Pose, jacobian: Array) -> None:
    """Add a change to a pose s seconds of the phase after its gate, and to its derivative unless that has no rows.

    Parameters
    ----------
    changes : Array
        `packed_changes`.
    k, s
        Number of the change, and the phase after its gate [s], clamped to the rows of o.
    along : Array, shape (6,)
        Derivatives of s.
    pose : Pose
        Updated.
    jacobian : Array, shape (nv, 6) or (0, 6)
        Updated.
    """
    entry = changes[1 + k * _ENTRY_SIZE :]
    size, last = 6 + 3 * ((pose.shape[0] - 7) // 4), int(entry[_ROW_COUNT]) - 1
    u = min(max((s + LEAD_IN) * FPS, 0.0), float(last))
    row = min(int(u), last - 1)
    offset, rate = work_array(size), work_array(size)
    interpolate(without_refcount(changes[int(entry[_FIRST_ROW]) + row * size :]), size, u - row, FPS, offset, rate)
    w, a, b, c = pose[3], pose[4], pose[5], pose[6]
    x, y, z = rotate(w, a, b, c, offset[0], offset[1], offset[2])
    pose[0], pose[1], pose[2] = pose[0] + x, pose[1] + y, pose[2] + z
    if jacobian.shape[0] > 0:
        x, y, z = rotate(w, a, b, c, rate[0], rate[1], rate[2])
        for column in range(6):
            p, q, r = jacobian[3, column], jacobian[4, column], jacobian[5, column]
            o, t, v = offset[0], offset[1], offset[2]
            m, n, l = rotate(w, a, b, c, q * v - r * t, r * o - p * v, p * t - q * o)
            jacobian[0, column] += m + x * along[column]
            jacobian[1, column] += n + y * along[column]
            jacobian[2, column] += l + z * along[column]
    for at in range(3, size, 3):
        o, t, v = offset[at], offset[at + 1], offset[at + 2]
        w, a, b, c = exponential(o, t, v)
        if jacobian.shape[0] > 0:
            x, y, z = angular_velocity(o, t, v, rate[at], rate[at + 1], rate[at + 2])
            for column in range(6):
                p, q, r = jacobian[at, column], jacobian[at + 1, column], jacobian[at + 2, column]
                m, n, l = rotate(w, -a, -b, -c, p, q, r)
                jacobian[at, column] = m + x * along[column]
                jacobian[at + 1, column] = n + y * along[column]
                jacobian[at + 2, column] = l + z * along[column]
        joint = 3 + 4 * ((at - 3) // 3)
        pose[joint], pose[joint + 1], pose[joint + 2], pose[joint + 3] = multiply(
            pose[joint], pose[joint + 1], pose[joint + 2], pose[joint + 3], w, a, b, c
        )
