"""Changes from one motion of the figure to another: what was shown is kept, and what it is ahead by decays."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from controllers.haptic_map.inertialization import add_offset, offset_left
from sim.native import mj_differentiate_pos

Array = npt.NDArray[np.float64]


class Transition(NamedTuple):
    """State of the inertialisation (see `controllers.haptic_map.inertialization`).

    Attributes
    ----------
    seconds : float
        Blend time T [s]; 0: the figure jumps.
    since : Array
        Time since the last change [s], infinite before the first, shape (1,).
    change : Array
        Offset of what was shown over what is asked for, with its rates, at the change, shape (3, 57).
    shown : Array
        Scratch: what was shown, and one period before and after, shape (3, 75).
    offset, before, after : Array
        Scratch, shape (57,).
    """

    seconds: float
    since: Array
    change: Array
    shown: Array
    offset: Array
    before: Array
    after: Array


def make_transition(nq: int, nv: int, seconds: float) -> Transition:
    """A transition before the first change, of poses of nq and tangents of nv numbers."""
    return Transition(
        seconds, np.full(1, np.inf), np.zeros((3, nv)), np.zeros((3, nq)), np.zeros(nv), np.zeros(nv), np.zeros(nv)
    )


@njit
def carry_offset(transition: Transition, s: float, pose: Array) -> None:
    """Add to a pose, s seconds from now, what is left of the offset."""
    since = transition.since[0]
    if since < transition.seconds:
        offset_left(transition.change, transition.seconds, min(since + s, transition.seconds), transition.offset)
        add_offset(pose, transition.offset)


@njit
def note_change(
    transition: Transition, figure_model: int, period: float, pose: Array, before: Array, after: Array
) -> None:
    """Offset of what was shown over poses that are asked for now, a period earlier and a period later; its rates too.

    `transition.shown` holds the first, in that order; `transition.change` is set: o, ȯ, ö by central differences.
    """
    now, then, next_ = transition.offset, transition.before, transition.after
    mj_differentiate_pos(figure_model, now.ctypes, 1.0, pose.ctypes, transition.shown[0].ctypes)
    mj_differentiate_pos(figure_model, then.ctypes, 1.0, before.ctypes, transition.shown[1].ctypes)
    mj_differentiate_pos(figure_model, next_.ctypes, 1.0, after.ctypes, transition.shown[2].ctypes)
    for i in range(now.shape[0]):
        transition.change[0, i] = now[i]
        transition.change[1, i] = 0.5 * (next_[i] - then[i]) / period
        transition.change[2, i] = (next_[i] - 2.0 * now[i] + then[i]) / period**2
