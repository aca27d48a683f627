"""Transitions from one motion of the figure to another, by inertialisation with foot steps.

Only the new motion is evaluated. The offset of the shown motion from it at the change, with its rates, is added and
decays within T; meanwhile the feet step to their new places one after the other, without sliding, and the root is
lowered where a leg would be too short.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from controllers.legs.footsteps import MAX_CONTINUED_ACCELERATION, STEP, limb_end, pivot, plan_steps, step_end
from controllers.legs.stepping_limbs import required_root_lowering, solve_stepping_limb
from controllers.motion.inertialization import add_offset, decaying_offset
from geometry.arrays import Array
from geometry.easing import smooth_step
from sim.compilation.native import mj_differentiate_pos

DWELL_TIME = 0.04  # [s] dwell time of a river before its clip plays: unfiltered noise changes the river every 23 ms
_N_ROOT = 6  # components of a tangent for the root
# [m/s²] largest vertical acceleration of the root due to the offset: a leg in single support bears little more. With
# half the value the worst of 40 changes of walk, run and squat dance slides 3.6 cm instead of 2.9; with twice, joint
# speeds jump by up to 13 rad/s in 8 ms instead of 25.
_MAX_VERTICAL_ACCELERATION = 6.0
# [m/s²] the same horizontally, where the root also travels. With twice the value the feet of the worst change rise
# 4 mm higher.
_MAX_HORIZONTAL_ACCELERATION = 5.0
_ACCELERATION_FACTOR = 5.77  # largest |ö| T² of a unit offset that decays from rest: 10/√3
# Largest factor on the shortest blend time by which a horizontal offset prolongs a change. With 1 the feet of the worst
# of 40 changes are 7 mm higher and slide 4 mm less; with twice the value those of the median are 2 mm lower.
_MAX_PROLONGATION = 1.9
# [s] in which the correction of the legs is faded in, and out again. In 40 changes joint speeds jump by 3.4 rad/s in
# 8 ms in the median and 25 at most; with half the value by 9.0 and 25, with twice by 2.7 and 64.
_LEG_FADE_TIME = 0.1
# [m/s²] largest depth/T². The arc 64 x³ (1 − x)³ accelerates downwards by up to 19.2 depth/T²: here 1.14 g.
_MAX_DEPTH_ACCELERATION = 0.58
# [m] two steps: a change is prolonged at most to the time of this travel, or both feet would be left behind.
_MAX_TRAVEL = 1.2
# [rad] largest overshoot of a joint's offset: half or twice the value leaves feet and joint speeds of 40 changes as
# they are.
_MAX_JOINT_OVERSHOOT = 0.3


class Transition(NamedTuple):
    """State of the inertialisation (see `controllers.motion.inertialization`, `controllers.legs.footsteps`).

    Attributes
    ----------
    seconds : float
        Shortest blend time [s]; 0: the figure jumps.
    duration : Array
        Duration T of the last change [s], longer where the root has far to go, shape (1,).
    since : Array
        Time since the last change [s], infinite before the first, shape (1,).
    depth : Array
        Depth by which the root is lowered during the change [m], shape (1,).
    change : Array
        Offset of the shown motion from the new one at the change, and its two derivatives, shape (3, 57).
    limbs, steps : Array
        Legs (`packed_steppers`), and their steps (`controllers.legs.footsteps`), shape (n, 28).
    ends : Array
        Scratch: poses of the new motion's feet, shape (n, 7).
    candidate_river : Array
        The river that would take over, and for how long it has been active [s], shape (2,).
    shown : Array
        Scratch: the shown pose now, and one period before and after, shape (3, 75).
    ahead : Array
        Scratch: poses of the new motion at the end of the first step and of the second, shape (2, 75).
    stance : Array
        Scratch: 1 for legs on which the new motion stands, shape (n,).
    offset, before, after : Array
        Scratch, shape (57,).
    """

    seconds: float
    duration: Array
    since: Array
    depth: Array
    change: Array
    limbs: Array
    steps: Array
    ends: Array
    candidate_river: Array
    shown: Array
    ahead: Array
    stance: Array
    offset: Array
    before: Array
    after: Array


def make_transition(nq: int, nv: int, seconds: float, limbs: Array) -> Transition:
    """A transition before its first change, for poses of nq and tangents of nv numbers; limbs are `packed_steppers`."""
    n = len(limbs)
    return Transition(
        seconds=seconds, duration=np.full(1, seconds), since=np.full(1, np.inf), depth=np.zeros(1),
        change=np.zeros((3, nv)), limbs=limbs, steps=np.zeros((n, STEP)), ends=np.zeros((n, 7)),
        candidate_river=np.array([-1.0, 0.0]), shown=np.zeros((3, nq)),
        ahead=np.zeros((2, nq)), stance=np.zeros(n), offset=np.zeros(nv), before=np.zeros(nv), after=np.zeros(nv),
    )  # fmt: skip


@njit
def dwell_complete(transition: Transition, river: float, period: float) -> bool:
    """Whether the river that would take over (−1: none) has been active for the dwell time; call it every period."""
    candidate = transition.candidate_river
    candidate[1] = candidate[1] + period if river == candidate[0] else 0.0
    candidate[0] = river
    return river >= 0.0 and candidate[1] >= DWELL_TIME


@njit
def pivot_of(transition: Transition) -> tuple[int, int]:
    """The leg in stance both before and after a change (−1: none), and the row of `ahead`; see `footsteps.pivot`."""
    return pivot(transition.limbs, transition.shown[0], transition.ahead, transition.stance)


@njit
def set_duration(transition: Transition, aside: float, period: float) -> None:
    """Set the duration of a change from the root's offset: vertical, as `note_change` found it, and `aside` [m]."""
    transition.duration[0] = transition.seconds
    if transition.seconds > 0.0:
        vertical_time = np.sqrt(_ACCELERATION_FACTOR * abs(transition.change[0, 2]) / _MAX_VERTICAL_ACCELERATION)
        # Bounded, since a figure in flight would keep flying, and a running one would leave both feet behind.
        previous, next_ = transition.shown[1], transition.shown[2]
        pace = 0.5 * np.hypot(next_[0] - previous[0], next_[1] - previous[1]) / period
        horizontal_time = min(
            np.sqrt(_ACCELERATION_FACTOR * aside / _MAX_HORIZONTAL_ACCELERATION),
            _MAX_PROLONGATION * transition.seconds,
            _MAX_TRAVEL / max(pace, 1e-9),
        )
        transition.duration[0] = max(transition.seconds, vertical_time, horizontal_time)


@njit
def _apply_offset(transition: Transition, at: float, pose: Array) -> None:
    """Write the limbs' ends `at` seconds into the change to `ends`, and add the remaining offset to the pose."""
    lasts, ends = transition.duration[0], transition.ends
    for n in range(transition.limbs.shape[0]):
        limb_end(transition.limbs[n], pose, ends[n])
        step_end(transition.limbs[n], transition.steps[n], at, lasts, ends[n])
    decaying_offset(transition.change[:, :_N_ROOT], lasts, at, transition.offset[:_N_ROOT])
    decaying_offset(transition.change[:, _N_ROOT:], lasts, at, transition.offset[_N_ROOT:], _MAX_JOINT_OVERSHOOT)
    add_offset(pose, transition.offset)


@njit
def apply_transition_to_pose(transition: Transition, s: float, pose: Array) -> None:
    """Turn a pose of the new motion, s seconds from now, into the shown pose: add offset, root depth and steps."""
    since, lasts, limbs, ends = transition.since[0], transition.duration[0], transition.limbs, transition.ends
    if since >= lasts:
        return
    at = min(since + s, lasts)
    _apply_offset(transition, at, pose)
    x = min(max(at / lasts, 0.0), 1.0)
    pose[2] -= 64.0 * (x * (1.0 - x)) ** 3 * transition.depth[0]
    share = smooth_step(min(at, lasts - at) / _LEG_FADE_TIME) ** 2
    for n in range(limbs.shape[0]):
        solve_stepping_limb(limbs[n], pose, ends[n], share)


@njit
def plan_depth(transition: Transition) -> None:
    """Set the root's depth to the length that the legs lack at mid-change, between the two steps.

    `ahead[0]` holds the new motion's pose at that time. The root accelerates downwards by 1.14 g at most.
    """
    limbs, ends, lasts, pose = transition.limbs, transition.ends, transition.duration[0], transition.ahead[0]
    transition.depth[0] = 0.0
    if transition.seconds == 0.0:
        return
    depth = 0.0
    _apply_offset(transition, 0.5 * lasts, pose)
    for n in range(limbs.shape[0]):
        depth = max(depth, required_root_lowering(limbs[n], transition.steps[n], pose, ends[n]))
    transition.depth[0] = min(depth, _MAX_DEPTH_ACCELERATION * lasts**2)


@njit
def note_change(
    transition: Transition, figure_model: int, period: float, pose: Array, before: Array, after: Array, second: int
) -> None:
    """Store the offset of the shown motion from the new one with its derivatives, and plan the steps.

    `pose`, `before` and `after` are poses of the new motion now, one period before and one period after;
    `transition.shown` holds those of the shown motion in the same order. `transition.change` is set to o, ȯ, ö by
    central differences. `second` is the leg that must step second (−1: any).
    """
    current, previous, next_ = transition.offset, transition.before, transition.after
    mj_differentiate_pos(figure_model, current.ctypes, 1.0, pose.ctypes, transition.shown[0].ctypes)
    mj_differentiate_pos(figure_model, previous.ctypes, 1.0, before.ctypes, transition.shown[1].ctypes)
    mj_differentiate_pos(figure_model, next_.ctypes, 1.0, after.ctypes, transition.shown[2].ctypes)
    for i in range(current.shape[0]):
        transition.change[0, i] = current[i]
        transition.change[1, i] = 0.5 * (next_[i] - previous[i]) / period
        transition.change[2, i] = (next_[i] - 2.0 * current[i] + previous[i]) / period**2
    for i in range(3):
        transition.change[2, i] = min(
            max(transition.change[2, i], -MAX_CONTINUED_ACCELERATION), MAX_CONTINUED_ACCELERATION
        )
    if transition.seconds > 0.0:
        plan_steps(
            transition.limbs, transition.steps, transition.shown, pose, period, transition.duration[0], second,
            transition.stance,
        )  # fmt: skip
