"""Changes from one motion of the figure to another: what was shown goes on, what it is ahead by decays, feet step."""

from typing import NamedTuple

import numpy as np
from numba import njit

from controllers.easing import smooth_step
from controllers.legs.footsteps import STEP, limb_end, pivot, plan_steps, step_end
from controllers.legs.stepping_limbs import put_limb, shortfall
from controllers.motion.inertialization import add_offset, offset_left
from controllers.state import Array
from sim.compilation.native import mj_differentiate_pos

DWELL = 0.04  # [s] for which a river must have the hand before its clip plays: noise gives a hand away for less
_ROOT = 6  # components of a tangent that are the root's
_PULL = 6.0  # [m/s²] with which a change moves the root at most: legs that stand on one foot bear little more
_ASIDE = 5.0  # [m/s²] and over the ground, where it goes on besides
_THROW = 20.0  # [m/s²] of the root that a change goes on with at most: a hand that is thrown off races its clip
_BEND = 5.77  # greatest |ö| T² of an offset of 1 that decays from rest
_LONGER = 1.9  # times the least blend time that a way aside makes a change last at most
_GIVING = 0.1  # [s] in which legs begin to give way, and cease to
_FALLS = 0.58  # [m/s²] of depth over T² at which the root, going down by the arc, falls with g
_STRIDES = 1.2  # [m] two steps, for which a way aside may make a change last
_SWING = 0.3  # [rad] by which a joint swings on at most


class Transition(NamedTuple):
    """State of the inertialisation (see `controllers.motion.inertialization`, `controllers.legs.footsteps`).

    Attributes
    ----------
    seconds : float
        Least blend time [s]; 0: the figure jumps.
    lasts : Array
        T of the last change [s], longer where the root has far to go, shape (1,).
    since : Array
        Time since the last change [s], infinite before the first, shape (1,).
    depth : Array
        By which the root goes down meanwhile [m], shape (1,).
    change : Array
        Offset of what was shown over what is asked for, with its rates, at the change, shape (3, 57).
    limbs, steps : Array
        Legs (`packed_steppers`), and how they step, shape (n, 28).
    ends : Array
        Scratch: where the feet of the new motion are, shape (n, 7).
    rival : Array
        The river that would take over, and for how long it has had the hand [s], shape (2,).
    shown : Array
        Scratch: what was shown, and one period before and after, shape (3, 75).
    ahead : Array
        Scratch: poses of the new motion when the first step ends, and when the second does, shape (2, 75).
    stands : Array
        Scratch: on which legs the new motion stands, shape (n,).
    offset, before, after : Array
        Scratch, shape (57,).
    """

    seconds: float
    lasts: Array
    since: Array
    depth: Array
    change: Array
    limbs: Array
    steps: Array
    ends: Array
    rival: Array
    shown: Array
    ahead: Array
    stands: Array
    offset: Array
    before: Array
    after: Array


def make_transition(nq: int, nv: int, seconds: float, limbs: Array) -> Transition:
    """A transition before the first change, of poses of nq and tangents of nv numbers, with `packed_steppers`."""
    n = len(limbs)
    return Transition(
        seconds=seconds, lasts=np.full(1, seconds), since=np.full(1, np.inf), depth=np.zeros(1),
        change=np.zeros((3, nv)), limbs=limbs, steps=np.zeros((n, STEP)), ends=np.zeros((n, 7)),
        rival=np.array([-1.0, 0.0]), shown=np.zeros((3, nq)),
        ahead=np.zeros((2, nq)), stands=np.zeros(n), offset=np.zeros(nv), before=np.zeros(nv), after=np.zeros(nv),
    )  # fmt: skip


@njit(forceinline=False)
def dwells(transition: Transition, river: float, period: float) -> bool:
    """Whether a river that would take over, −1 for none, has had the hand for long enough; called every period."""
    rival = transition.rival
    rival[1] = rival[1] + period if river == rival[0] else 0.0
    rival[0] = river
    return river >= 0.0 and rival[1] >= DWELL


@njit
def pivot_of(transition: Transition) -> tuple[int, int]:
    """The leg on which the figure stands before and after a change, −1 for none, and when; see `footsteps.pivot`."""
    return pivot(transition.limbs, transition.shown[0], transition.ahead, transition.stands)


@njit
def set_duration(transition: Transition, aside: float, period: float) -> None:
    """Let a change last long enough for the root's way: up or down, as `note_change` found it, and aside [m]."""
    transition.lasts[0] = transition.seconds
    if transition.seconds > 0.0:
        up = np.sqrt(_BEND * abs(transition.change[0, 2]) / _PULL)
        # Not longer: a figure in flight would fly on, and one that runs would leave both feet behind.
        then, next_ = transition.shown[1], transition.shown[2]
        pace = 0.5 * np.hypot(next_[0] - then[0], next_[1] - then[1]) / period
        over = min(np.sqrt(_BEND * aside / _ASIDE), _LONGER * transition.seconds, _STRIDES / max(pace, 1e-9))
        transition.lasts[0] = max(transition.seconds, up, over)


@njit
def _carry(transition: Transition, at: float, pose: Array) -> None:
    """Where the ends of the limbs are `at` seconds into it, to `ends`; and the offset that is left, onto the pose."""
    lasts, ends = transition.lasts[0], transition.ends
    for n in range(transition.limbs.shape[0]):
        limb_end(transition.limbs[n], pose, ends[n])
        step_end(transition.limbs[n], transition.steps[n], at, lasts, ends[n])
    offset_left(transition.change[:, :_ROOT], lasts, at, transition.offset[:_ROOT])
    offset_left(transition.change[:, _ROOT:], lasts, at, transition.offset[_ROOT:], _SWING)
    add_offset(pose, transition.offset)


@njit(forceinline=False)
def carry_on(transition: Transition, s: float, pose: Array) -> None:
    """Move a pose of the new motion, s seconds from now, to what is shown: the offset that is left, and the steps."""
    since, lasts, limbs, ends = transition.since[0], transition.lasts[0], transition.limbs, transition.ends
    if since >= lasts:
        return
    at = min(since + s, lasts)
    _carry(transition, at, pose)
    x = min(max(at / lasts, 0.0), 1.0)
    pose[2] -= 64.0 * (x * (1.0 - x)) ** 3 * transition.depth[0]
    share = smooth_step(min(at, lasts - at) / _GIVING) ** 2
    for n in range(limbs.shape[0]):
        put_limb(limbs[n], transition.steps[n], pose, ends[n], share)


@njit
def plan_depth(transition: Transition) -> None:
    """Let the root go down by what legs are too short when one has stepped and the other is about to; `ahead` is then.

    Deeper than it would fall by its own weight it does not go.
    """
    limbs, ends, lasts, pose = transition.limbs, transition.ends, transition.lasts[0], transition.ahead[0]
    transition.depth[0] = 0.0
    if transition.seconds == 0.0:
        return
    depth = 0.0
    _carry(transition, 0.5 * lasts, pose)
    for n in range(limbs.shape[0]):
        depth = max(depth, shortfall(limbs[n], transition.steps[n], pose, ends[n]))
    transition.depth[0] = min(depth, _FALLS * lasts**2)


@njit
def note_change(
    transition: Transition, figure_model: int, period: float, pose: Array, before: Array, after: Array, second: int
) -> None:
    """Offset of what was shown over poses that are asked for now, a period earlier and a period later; its rates too.

    `transition.shown` holds the first, in that order; `transition.change` is set: o, ȯ, ö by central differences; and
    the steps are planned, with the leg that steps second (−1 for any).
    """
    now, then, next_ = transition.offset, transition.before, transition.after
    mj_differentiate_pos(figure_model, now.ctypes, 1.0, pose.ctypes, transition.shown[0].ctypes)
    mj_differentiate_pos(figure_model, then.ctypes, 1.0, before.ctypes, transition.shown[1].ctypes)
    mj_differentiate_pos(figure_model, next_.ctypes, 1.0, after.ctypes, transition.shown[2].ctypes)
    for i in range(now.shape[0]):
        transition.change[0, i] = now[i]
        transition.change[1, i] = 0.5 * (next_[i] - then[i]) / period
        transition.change[2, i] = (next_[i] - 2.0 * now[i] + then[i]) / period**2
    for i in range(3):
        transition.change[2, i] = min(max(transition.change[2, i], -_THROW), _THROW)
    if transition.seconds > 0.0:
        plan_steps(
            transition.limbs, transition.steps, transition.shown, pose, period, transition.lasts[0], second,
            transition.stands,
        )  # fmt: skip
