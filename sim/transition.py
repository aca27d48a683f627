"""Changes from one motion of the figure to another: what was shown goes on, what it is ahead by decays, feet step."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from controllers.haptic_map.footsteps import STEP, limb_end, plan_steps, put_limb, step_end
from controllers.haptic_map.inertialization import add_offset, offset_left
from sim.native import mj_differentiate_pos

Array = npt.NDArray[np.float64]


class Transition(NamedTuple):
    """State of the inertialisation (see `inertialization` and `footsteps` in `controllers.haptic_map`).

    Attributes
    ----------
    seconds : float
        Blend time T [s]; 0: the figure jumps.
    since : Array
        Time since the last change [s], infinite before the first, shape (1,).
    change : Array
        Offset of what was shown over what is asked for, with its rates, at the change, shape (3, 57).
    limbs, steps : Array
        Legs, shape (n, 36), and how they step, shape (n, 27).
    ends : Array
        Scratch: where the feet of the new motion are, shape (n, 7).
    shown : Array
        Scratch: what was shown, and one period before and after, shape (3, 75).
    offset, before, after : Array
        Scratch, shape (57,).
    """

    seconds: float
    since: Array
    change: Array
    limbs: Array
    steps: Array
    ends: Array
    shown: Array
    offset: Array
    before: Array
    after: Array


def make_transition(nq: int, nv: int, seconds: float, limbs: Array) -> Transition:
    """A transition before the first change, of poses of nq and tangents of nv numbers, with legs (n, 36) that step."""
    n = len(limbs)
    return Transition(
        seconds=seconds, since=np.full(1, np.inf), change=np.zeros((3, nv)), limbs=limbs, steps=np.zeros((n, STEP)),
        ends=np.zeros((n, 7)), shown=np.zeros((3, nq)), offset=np.zeros(nv), before=np.zeros(nv), after=np.zeros(nv),
    )  # fmt: skip


@njit
def carry_on(transition: Transition, s: float, pose: Array) -> None:
    """Move a pose of the new motion, s seconds from now, to what is shown: the offset that is left, and the steps."""
    since, limbs, ends = transition.since[0], transition.limbs, transition.ends
    if since >= transition.seconds:
        return
    at = min(since + s, transition.seconds)
    for n in range(limbs.shape[0]):
        limb_end(limbs[n], pose, ends[n])
        step_end(transition.steps[n], at, transition.seconds, ends[n])
    offset_left(transition.change, transition.seconds, at, transition.offset)
    add_offset(pose, transition.offset)
    for n in range(limbs.shape[0]):
        put_limb(limbs[n], pose, ends[n])


@njit
def note_change(
    transition: Transition, figure_model: int, period: float, pose: Array, before: Array, after: Array
) -> None:
    """Offset of what was shown over poses that are asked for now, a period earlier and a period later; its rates too.

    `transition.shown` holds the first, in that order; `transition.change` is set: o, ȯ, ö by central differences; and
    the steps are planned.
    """
    now, then, next_ = transition.offset, transition.before, transition.after
    mj_differentiate_pos(figure_model, now.ctypes, 1.0, pose.ctypes, transition.shown[0].ctypes)
    mj_differentiate_pos(figure_model, then.ctypes, 1.0, before.ctypes, transition.shown[1].ctypes)
    mj_differentiate_pos(figure_model, next_.ctypes, 1.0, after.ctypes, transition.shown[2].ctypes)
    for i in range(now.shape[0]):
        transition.change[0, i] = now[i]
        transition.change[1, i] = 0.5 * (next_[i] - then[i]) / period
        transition.change[2, i] = (next_[i] - 2.0 * now[i] + then[i]) / period**2
    if transition.seconds > 0.0:
        plan_steps(transition.limbs, transition.steps, transition.shown, pose, period, transition.seconds)
