"""STRETCHY TUBES: a deformable guide; a curve is found, grasped and bent like rubber (Donald & Henle 2000, sec. 4)."""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numba import njit

from controllers.checks import check_field_types, checked
from controllers.curves import deformation
from controllers.curves.closest_point import closest_phase
from controllers.curves.deformation import begin_edit, commit, discard_edit, drag_to, redo, undo, work_curve
from controllers.curves.editing import curve_of, record_of
from controllers.curves.trajectory import Trajectory, curve_point
from controllers.errors import ParameterError
from controllers.fields.algebra.instructions import TRACE_SIZE, write_trace
from controllers.fields.algebra.law import Law, Program
from controllers.fields.follow import Follow, FollowGains, follow_wrench
from controllers.state import HAND_POSITION, HAND_SWITCH, HAND_TIME, HAND_VELOCITY
from geometry.arrays import Array
from geometry.easing import smooth_step

CLICK_DISTANCE = 1e-3  # [m] a press during which the stylus moves less than this is a click, not an edit
CLICK_TIME = 0.4  # [s] a shorter click undoes the last edit, a longer one redoes it

NEW, SEEKING, HOLDING, PROBING, PUSHING, IDLE = (float(mode) for mode in range(6))
# Memory: phase t*, mode, time and position (3) of the last press, largest distance of the stylus from there, normal (3)
# of a push, FOLLOW's gains (4), largest distance of a held point from the stylus, then the record of the curve.
_PHASE, _MODE, _PRESS_TIME, _PRESS_POINT, _TRAVEL, _NORMAL, _GAINS, _OFFSET, _RECORD = 0, 1, 2, 3, 6, 7, 10, 14, 15


class StretchyGains(NamedTuple):
    """Parameters of `stretchy_wrench`: k_f and k_s [N/m], b [N s/m], ε [m], `until` and `ease` [s], flag of `hold`."""

    seek: float
    stretch: float
    damping: float
    radius: float
    until: float
    ease: float
    at_stylus: float


@njit
def stretch_force(p: float, v: float, target: float, stiffness: float, damping: float) -> float:
    """F = k (target − p) − b v, one component of each in H, or whole vectors."""
    return stiffness * (target - p) - damping * v


@njit
def eased_share(t: float, seconds: float) -> float:
    """Weight σ = S(t/T) (`smooth_step`) of FOLLOW at t [s] in a transition of T [s], which may be 0; C²."""
    if t >= seconds:
        return 1.0
    return smooth_step(t / seconds)


@njit
def _handle_press(radius: float, memory: Array, slot: int, hand: Array, distance: float) -> None:
    """Switch pressed: hold the tube if the stylus is inside it, otherwise use the stylus as a probe that pushes it."""
    memory[slot + _PRESS_TIME], memory[slot + _TRAVEL] = hand[HAND_TIME], 0.0
    for i in range(3):
        memory[slot + _PRESS_POINT + i] = hand[HAND_POSITION + i]
    if distance > radius:
        memory[slot + _MODE] = PROBING
    elif begin_edit(memory, slot + _RECORD, memory[slot + _PHASE]):
        memory[slot + _MODE] = HOLDING
    else:
        memory[slot + _MODE] = IDLE


@njit
def _handle_release(memory: Array, slot: int, time: float) -> None:
    """Switch released: commit the edit, or, after a click on the curve, undo or redo one."""
    record, mode = slot + _RECORD, memory[slot + _MODE]
    if mode == PUSHING or (mode == HOLDING and memory[slot + _TRAVEL] >= CLICK_DISTANCE):
        commit(memory, record)
    elif mode != PROBING:
        discard_edit(memory, record)
        if memory[slot + _TRAVEL] < CLICK_DISTANCE:
            if time - memory[slot + _PRESS_TIME] < CLICK_TIME:
                undo(memory, record)
            else:
                redo(memory, record)
    memory[slot + _MODE] = SEEKING


@njit
def _start_push(radius: float, memory: Array, slot: int, p: Array, distance: float) -> None:
    """A probe that enters the tube begins to push it, along the normal of the first contact."""
    record = slot + _RECORD
    if distance < radius and begin_edit(memory, record, memory[slot + _PHASE]):
        memory[slot + _MODE] = PUSHING
        for i in range(3):
            memory[slot + _NORMAL + i] = (p[i] - memory[record + deformation.ANCHOR + i]) / max(distance, 1e-9)


@njit
def _push_curve(radius: float, memory: Array, slot: int, p: Array) -> float:
    """Bend the curve so that the probe stays on the tube's surface; returns its depth [m], 0 if contact is lost."""
    record = slot + _RECORD
    depth = radius
    for i in range(3):
        depth -= (p[i] - memory[record + deformation.ANCHOR + i]) * memory[slot + _NORMAL + i]
    if depth > 0.0:
        a, n = record + deformation.ANCHOR, slot + _NORMAL
        drag_to(
            memory, record, memory[a] - depth * memory[n], memory[a + 1] - depth * memory[n + 1],
            memory[a + 2] - depth * memory[n + 2],
        )  # fmt: skip
        return depth
    discard_edit(memory, record)
    memory[slot + _MODE] = PROBING
    return 0.0


@njit
def _write_performance(gains: StretchyGains, curve: int, memory: Array, slot: int, hand: Array, wrench: Array) -> None:
    """FOLLOW of the bent curve, eased in from the search spring."""
    follow_wrench(memory, slot + _GAINS, curve, memory, slot + _PHASE, hand, wrench)
    share = eased_share(hand[HAND_TIME] - gains.until, gains.ease)
    target = curve_point(memory, curve, memory[slot + _PHASE])
    for i in range(3):
        seek = stretch_force(hand[HAND_POSITION + i], hand[HAND_VELOCITY + i], target[i], gains.seek, gains.damping)
        wrench[i] = share * wrench[i] + (1.0 - share) * seek


@njit
def _distance(p: Array, x: float, y: float, z: float) -> float:
    return np.sqrt((p[0] - x) ** 2 + (p[1] - y) ** 2 + (p[2] - z) ** 2)


@njit
def stretchy_wrench(params: Array, at: int, curve: int, memory: Array, slot: int, hand: Array, wrench: Array) -> None:  # noqa: C901 - a state machine, a state a branch
    """Kernel of `StretchyTubes`: parameters `StretchyGains`, memory see above `_PHASE`; it contains the curve."""
    gains = StretchyGains(
        params[at], params[at + 1], params[at + 2], params[at + 3], params[at + 4], params[at + 5], params[at + 6]
    )  # fmt: skip
    p, v, record = hand[HAND_POSITION : HAND_POSITION + 3], hand[HAND_VELOCITY : HAND_VELOCITY + 3], slot + _RECORD
    wrench[:] = 0.0
    if not np.isfinite(p[0] + p[1] + p[2] + hand[HAND_TIME]):
        # Non-finite input must reach the limiter, which latches a fault, and must not corrupt the stored curve.
        wrench[:3] = np.nan
        return
    if memory[slot + _MODE] == NEW:
        discard_edit(memory, record)
        memory[slot + _MODE] = SEEKING
    curve, performing = work_curve(memory, record), hand[HAND_TIME] >= gains.until
    pressed = hand[HAND_SWITCH] > 0.5 and not performing
    if not pressed and memory[slot + _MODE] != SEEKING:
        _handle_release(memory, slot, hand[HAND_TIME])
    if performing:
        _write_performance(gains, curve, memory, slot, hand, wrench)
        return
    phase, distance = closest_phase(memory, curve, p[0], p[1], p[2], memory[slot + _PHASE])
    memory[slot + _PHASE] = phase
    if pressed and memory[slot + _MODE] == SEEKING:
        _handle_press(gains.radius, memory, slot, hand, distance)
    elif memory[slot + _MODE] == PROBING:
        _start_push(gains.radius, memory, slot, p, distance)
    press = slot + _PRESS_POINT
    carried = _distance(p, memory[press], memory[press + 1], memory[press + 2])
    memory[slot + _TRAVEL] = max(memory[slot + _TRAVEL], carried)
    mode, stiffness = memory[slot + _MODE], 0.0
    target = (p[0], p[1], p[2])
    if mode == HOLDING:
        drag_to(memory, record, p[0], p[1], p[2])
        stiffness = gains.stretch
        held = slot + _PRESS_POINT if gains.at_stylus > 0.0 else record + deformation.ANCHOR
        target = (memory[held], memory[held + 1], memory[held + 2])
        phase = memory[record + deformation.PHASE]
    elif mode == PUSHING:
        depth, n = _push_curve(gains.radius, memory, slot, p), slot + _NORMAL
        stiffness = gains.stretch
        target = (p[0] + depth * memory[n], p[1] + depth * memory[n + 1], p[2] + depth * memory[n + 2])
        phase = memory[record + deformation.PHASE]
    elif mode != PROBING:
        stiffness = gains.seek
        target = curve_point(memory, curve, phase)
    for i in range(3):
        wrench[i] = stretch_force(p[i], v[i], target[i], stiffness, gains.damping)
    if mode in (HOLDING, PUSHING):
        x, y, z = curve_point(memory, curve, phase)
        distance = _distance(p, x, y, z)
    if mode == HOLDING:
        memory[slot + _OFFSET] = max(memory[slot + _OFFSET], distance)
    write_trace(memory, curve, memory, phase, distance, phase)


@dataclass(frozen=True, eq=False)
class StretchyTubes(Law):
    r"""Field in which a curve is found, grasped and bent: the tube about it yields and resists like rubber.

    .. math::
        \text{switch open:}\quad & F = k_f\,(c(p) - p) - b\,v \\
        \text{held:}\quad        & F = k_s\,(p_0 - p) - b\,v, \qquad \varphi'(t_j) = p \\
        \text{pushed:}\quad      & F = k_s\,s\,n - b\,v, \qquad \varphi'(t_j) = p_0 - s\,n,\;
                                   s = \langle\varepsilon - n \cdot (p - p_0)\rangle

    c(p) = φ(t*) is the nearest point of the curve. A press of the switch within ε of it grasps φ(t_j), t_j = t*: from
    then on this point follows the stylus, and the curve is bent with it (see `controllers.curves.deformation`). p_0 is
    the grasped point φ(t_j) at the press. In the paper's form (`hold` "stylus") it is the stylus's position at the
    press: then the held tube does not pull at first, although the search spring did.

    A press farther off makes the stylus a probe: it feels only damping until it meets the tube of radius ε, then pushes
    it along the normal n of the contact, without friction. Releasing the switch commits the edit. A press on the curve
    during which the stylus moves less than 1 mm is a click: a short one (under 0.4 s) undoes the last edit, a longer
    one redoes it.

    F jumps at the switch (unless k_f = k_s) and nowhere else within the curve's reach, except at open ends.

    Parameters
    ----------
    curve : Trajectory
        φ before any edit, in the hand frame H.
    k_f : float
        Stiffness of the search spring (switch open) [N/m].
    k_s : float
        Stiffness of the rubber [N/m].
    b : float
        Damping [N s/m]; the paper has none.
    hold : {"curve", "stylus"}
        Whether p_0 of a held tube is φ(t_j), or the stylus's position, both at the press.
    epsilon : float
        ε, radius of the tube [m].
    width : float
        h, half the width of a bump [s]; see `controllers.curves.editing.record_of`.
    until : float
        Time at which stretching ends [s]; may be infinite. An edit in progress at that time is committed.
    then : Follow, optional
        Gains with which the bent curve is performed afterwards; required if `until` is finite. Its curve is not used.
    ease : float
        T, duration of the transition from search to performance [s]: F = (1 − σ) F_open + σ F_follow, with
        σ = x³ (10 − 15x + 6x²), x = t/T. A standing body cannot reach the speed of a walk at once.
    depth : int
        Number of edits that can be undone.

    Raises
    ------
    ParameterError
        If a gain is negative or not finite, ε below 1e-4 m or infinite, or `until` without `then`.
    CurveError
        If the width or the depth is out of its interval.
    """

    curve: Trajectory
    k_f: float
    k_s: float
    b: float = 2.0
    epsilon: float = 0.008
    width: float = 0.5
    until: float = np.inf
    then: Follow | None = None
    ease: float = 0.0
    depth: int = 64
    hold: Literal["curve", "stylus"] = "curve"

    def __post_init__(self) -> None:
        check_field_types(self)
        checked("k_f", self.k_f, "N/m")
        checked("k_s", self.k_s, "N/m")
        checked("b", self.b, "N s/m")
        checked("epsilon", self.epsilon, "m", least=1e-4)
        checked("until", self.until, "s", infinite=True)
        checked("ease", self.ease, "s")
        if np.isfinite(self.until) and self.then is None:
            raise ParameterError(f"stretching ends after {self.until} s; give `then`, how the curve is performed")

    def _compose(self) -> Program:
        """The memory contains the curve, which is deformed in place."""
        follow = self.then
        then = FollowGains(0.0, 0.0, 0.0, 0.0) if follow is None else follow.gains
        state = np.zeros(_RECORD)
        state[_PHASE], state[_GAINS:_OFFSET] = np.nan, then
        memory = np.concatenate([state, record_of(self.curve, self.width, self.depth)])
        gains = StretchyGains(
            self.k_f, self.k_s, self.b, self.epsilon, self.until, self.ease, float(self.hold == "stylus")
        )
        return Program.of(self, stretchy_wrench, gains, memory)

    @staticmethod
    def record_at(slot: int) -> int:
        """Offset of the curve's record in the memory of a run, behind the state of the law."""
        return slot + _RECORD

    def edited(self, memory: Array, slot: int = TRACE_SIZE) -> Trajectory:
        """The curve as it is bent in the memory of a run.

        Parameters
        ----------
        memory : Array
            Memory of the field's program, or of a program that contains this field.
        slot : int
            Offset of this field in it: the third number of its instruction.
        """
        return curve_of(memory, slot + _RECORD, self.curve)

    def edits(self, memory: Array, slot: int = TRACE_SIZE) -> Array:
        """Current edits in the memory of a run, each [t̂ [s], h [s], δ̂ (3) [m]]; shape (n, 5), n up to `depth`."""
        record = memory[slot + _RECORD :]
        table, count = int(record[deformation.TABLE]), int(record[deformation.COUNT])
        return record[table : table + deformation.EDIT * count].reshape(count, deformation.EDIT).copy()

    def held_off(self, memory: Array) -> float:
        """Largest distance [m] of a held point from the stylus in a run."""
        return float(memory[TRACE_SIZE + _OFFSET])
