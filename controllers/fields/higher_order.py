"""Higher-order fields: the hand's velocity decides which river acts on it (Donald & Henle 2000, sections 7.1, 7.2)."""

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numba import njit

from controllers.checks import check_field_types, checked
from controllers.curves.branches import BRANCHES, SAME_BRANCH, branches
from controllers.curves.closest_point import closest_phase
from controllers.curves.trajectory import (
    END,
    PERIODIC,
    START,
    Trajectory,
    curve_acceleration,
    curve_point,
    curve_velocity,
)
from controllers.errors import ParameterError
from controllers.fields.admissible import admissible_speeds
from controllers.fields.algebra.instructions import TRACE_RIVER, write_trace
from controllers.fields.algebra.law import Law, Program
from controllers.fields.algebra.weights import window
from controllers.fields.bundle import RiverBundle
from controllers.fields.follow import follow_force
from controllers.state import HAND_POSITION, HAND_TIME, HAND_VELOCITY
from controllers.work_array import work_array
from geometry.arrays import Array
from geometry.easing import smooth_step


class Crossing(NamedTuple):
    """Parameters of `higher_order_wrench`, followed by the offsets of the rivers' blocks (from here) and the blocks.

    Flag for the discrete form, 1/2σ² [s²/m²], r and r + h [m/s], number of rivers, time constant of the low-pass [s],
    and T_e [s].
    """

    discrete: float
    sharpness: float
    admission: float
    release: float
    rivers: float
    look: float
    ease: float


class RiverGains(NamedTuple):
    """Header of a river's block; the pairs of admissible speeds and the packed curve follow it.

    k_r [N/m], b_d [N s/m], 1/ε² [1/m²], ε [m], τ [s], and the number of pairs of speeds.
    """

    k_r: float
    b_d: float
    inverse_square: float
    epsilon: float
    tau: float
    speeds: float


_HEADER_SIZE, _GAINS_SIZE = len(Crossing._fields), len(RiverGains._fields)
# Columns of the table of candidate branches.
_RIVER, _PHASE, _DISTANCE, _SCORE, _WINDOW, _CANDIDATE_SIZE = range(6)

# Memory: [active river, its phase [s], time of the last evaluation [s], low-passed velocity (3) [m/s], time [s] at
# which the active river took the hand, and the hand's pace there].
_ACTIVE, _ACTIVE_PHASE, _LAST_TIME, _FILTERED_VELOCITY, _TAKEN_TIME, _TAKEN_PACE = 0, 1, 2, 3, 6, 7
# A hand that is taken this near to a river's speed has its pace, by a share or [m/s]: encoders make 10 mm/s of noise,
# and curves are gone along at 60 to 150. Captured jogs that began 5 and 15 % too fast for that reason fell at 1.3 s.
_PACE_SHARE, _SPEED_NOISE = 0.1, 0.015
_NO_MEMORY = (-1.0, 0.0, np.nan, 0.0, 0.0, 0.0, 0.0, 1.0)


@njit
def _read_crossing(params: Array, at: int) -> Crossing:
    return Crossing(
        params[at], params[at + 1], params[at + 2], params[at + 3], params[at + 4], params[at + 5], params[at + 6]
    )


@njit
def _read_river(params: Array, at: int, number: float) -> tuple[RiverGains, int, int]:
    """Gains of a river, and the offsets of its speeds and of its packed curve."""
    block = at + int(params[at + _HEADER_SIZE + int(number)])
    gains = RiverGains(
        params[block], params[block + 1], params[block + 2], params[block + 3], params[block + 4], params[block + 5]
    )  # fmt: skip
    return gains, block + _GAINS_SIZE, block + _GAINS_SIZE + 2 * int(gains.speeds)


@njit
def mismatch(square: float, towards: float, draw: float, pace: float) -> float:
    r"""Distance m [m/s] of a hand's velocity from a river's, m² = |e|² − (e·Y)²/(|Y|² + |φ̇|²).

    e is the velocity minus the nearest admissible one, and Y = (φ(t*) − p)/τ the current towards the curve. The part of
    e along Y is discounted, the more so the larger |Y| is relative to |φ̇|. Otherwise a hand that springs back to its
    river would be released because of the speed that this river gave it.

    Parameters
    ----------
    square, towards : float
        |e|² and e·Y [m²/s²].
    draw, pace : float
        |Y|² and |φ̇|² [m²/s²]; not both zero.
    """
    return np.sqrt(np.maximum(0.0, square - towards * towards / (draw + pace)))


@njit
def _nearest_admissible(
    params: Array, river: RiverGains, speeds: int, curve: int, phase: float, v: Array
) -> tuple[float, float]:
    """Speed along a branch [m/s] that a river admits and that is nearest to the hand's, and |φ̇| [m/s]."""
    tangent, along, square = curve_velocity(params, curve, phase), 0.0, 0.0
    for i in range(3):
        along += v[i] * tangent[i]
        square += tangent[i] ** 2
    speed = max(math.sqrt(square), 1e-12)
    rows = int(river.speeds)
    if rows == 0:
        return speed, speed
    share = (phase - params[curve + START]) / (params[curve + END] - params[curve + START])
    least, greatest = admissible_speeds(params, speeds, rows, share)
    return min(max(along / speed, least), greatest), speed


@njit
def _branch_mismatch(
    params: Array, river: RiverGains, speeds: int, curve: int, phase: float, p: Array, v: Array
) -> float:
    point, tangent = curve_point(params, curve, phase), curve_velocity(params, curve, phase)
    s, speed = _nearest_admissible(params, river, speeds, curve, phase, v)
    square = towards = draw = pace = 0.0
    for i in range(3):
        e, y = v[i] - s / speed * tangent[i], (point[i] - p[i]) / river.tau
        square += e * e
        towards += e * y
        draw += y * y
        pace += tangent[i] ** 2
    return mismatch(square, towards, draw, pace + 1e-24)


@njit
def _candidates(params: Array, at: int, p: Array, v: Array, table: Array) -> int:
    """Write the branches of all rivers whose tube contains p as rows of the table; returns their number."""
    count, crossing = 0, _read_crossing(params, at)
    found = work_array((BRANCHES, 2))
    for number in range(int(crossing.rivers)):
        river, speeds, curve = _read_river(params, at, number)
        for k in range(branches(params, curve, p[0], p[1], p[2], river.epsilon, found)):
            row = table[count]
            row[_RIVER], row[_PHASE], row[_DISTANCE] = number, found[k, 0], found[k, 1]
            w = window(found[k, 1] * found[k, 1] * river.inverse_square)
            if w > 0.0:
                m = _branch_mismatch(params, river, speeds, curve, found[k, 0], p, v)
                row[_WINDOW], row[_SCORE] = w, m * m - math.log(w) / crossing.sharpness
                count += 1
    return count


@njit
def _filter_velocity(look: float, memory: Array, slot: int, t: float, v: Array) -> Array:
    """Low-passed hand velocity [m/s] that selects the river; unfiltered if no time has passed or the filter is off."""
    filtered = memory[slot + _FILTERED_VELOCITY : slot + _TAKEN_TIME]
    elapsed = t - memory[slot + _LAST_TIME]
    # The comparison is false for the NaN of the first evaluation.
    share = 1.0 - math.exp(-elapsed / look) if look > 0.0 and elapsed > 0.0 else 1.0
    memory[slot + _LAST_TIME] = t
    for i in range(3):
        filtered[i] += share * (v[i] - filtered[i])
    return filtered


@njit
def _add_force(
    params: Array, at: int, row: Array, share: float, pace: float, p: Array, v: Array, wrench: Array
) -> None:
    river, _, curve = _read_river(params, at, row[_RIVER])
    p_curve, v_curve = curve_point(params, curve, row[_PHASE]), curve_velocity(params, curve, row[_PHASE])
    for i in range(3):
        force = follow_force(p[i], v[i], p_curve[i], pace * v_curve[i], river.k_r, river.b_d)
        wrench[i] += share * row[_WINDOW] * force


@njit
def _add_smooth_forces(params: Array, at: int, table: Array, count: int, p: Array, v: Array, wrench: Array) -> int:
    """Add the weighted forces; returns the row of greatest weight, −1 if the null weight is greatest."""
    crossing = _read_crossing(params, at)
    sharpness, null = crossing.sharpness, crossing.admission**2
    least = null
    for k in range(count):
        least = min(least, table[k, _SCORE])
    total = math.exp(-sharpness * (null - least))
    strongest, selected = total, -1
    for k in range(count):
        a = math.exp(-sharpness * (table[k, _SCORE] - least))
        total += a
        if a > strongest:
            strongest, selected = a, k
    for k in range(count):
        _add_force(params, at, table[k], math.exp(-sharpness * (table[k, _SCORE] - least)) / total, 1.0, p, v, wrench)
    return selected


@njit
def _select_river(params: Array, at: int, table: Array, count: int, memory: Array, slot: int) -> int:
    """Row of the active river, selected with hysteresis, −1 for none; stored in the memory as [river, phase]."""
    crossing = _read_crossing(params, at)
    admission, release = crossing.admission, crossing.release
    current, nearest = -1, math.inf
    best = -1
    for k in range(count):
        if table[k, _RIVER] == memory[slot + _ACTIVE]:
            _, _, curve = _read_river(params, at, table[k, _RIVER])
            duration = params[curve + END] - params[curve + START]
            phase_distance = abs(table[k, _PHASE] - memory[slot + _ACTIVE_PHASE])
            if params[curve + PERIODIC] > 0.0:
                phase_distance = min(phase_distance, duration - phase_distance)
            if phase_distance < min(nearest, SAME_BRANCH * duration):
                current, nearest = k, phase_distance
        if best < 0 or table[k, _SCORE] < table[best, _SCORE]:
            best = k
    best_score = math.inf if best < 0 else math.sqrt(table[best, _SCORE])
    current_score = math.inf if current < 0 else math.sqrt(table[current, _SCORE])
    if current_score >= release or best_score + (release - admission) < current_score:
        current = best if best_score < admission else -1
    memory[slot + _ACTIVE] = -1.0 if current < 0 else table[current, _RIVER]
    memory[slot + _ACTIVE_PHASE] = 0.0 if current < 0 else table[current, _PHASE]
    return current


@njit
def _phase_share(params: Array, curve: int, phase: float, p: Array) -> float:
    """Rate dt*/dt of the nearest point over that of a hand with the same velocity on the curve."""
    point, tangent = curve_point(params, curve, phase), curve_velocity(params, curve, phase)
    bend, square, slope = curve_acceleration(params, curve, phase), 0.0, 0.0
    for i in range(3):
        square += tangent[i] ** 2
        slope += (point[i] - p[i]) * bend[i]
    # Nearer to the centre of curvature than half its distance the phase is no measure of pace.
    return square / max(square + slope, 0.5 * square, 1e-24)


@njit
def _eased_pace(params: Array, at: int, row: Array, taken: bool, memory: Array, slot: int, t: float, p: Array) -> float:
    """Pace s of the active river's current along its curve; `taken` if the hand has just come into this river."""
    ease = _read_crossing(params, at).ease
    if ease <= 0.0:
        return 1.0
    if taken:
        river, speeds, curve = _read_river(params, at, row[_RIVER])
        share, v = _phase_share(params, curve, row[_PHASE], p), work_array(3)
        for i in range(3):
            v[i] = share * memory[slot + _FILTERED_VELOCITY + i]
        s, speed = _nearest_admissible(params, river, speeds, curve, row[_PHASE], v)
        own = abs(s - speed) < max(_PACE_SHARE * speed, _SPEED_NOISE)
        memory[slot + _TAKEN_TIME], memory[slot + _TAKEN_PACE] = t, 1.0 if own else s / speed
    share = smooth_step((t - memory[slot + _TAKEN_TIME]) / ease)
    return share + (1.0 - share) * memory[slot + _TAKEN_PACE]


@njit
def higher_order_wrench(
    params: Array, at: int, curve: int, memory: Array, slot: int, hand: Array, wrench: Array
) -> None:
    """Kernel of `HigherOrder`: parameters see `Crossing`, memory see above `_ACTIVE`; `curve` is not used."""
    p, v = hand[HAND_POSITION : HAND_POSITION + 3], hand[HAND_VELOCITY : HAND_VELOCITY + 3]
    if not np.isfinite(p[0] + p[1] + p[2] + v[0] + v[1] + v[2]):
        wrench[:] = np.nan
        return
    wrench[:] = 0.0
    crossing = _read_crossing(params, at)
    table = work_array((int(crossing.rivers) * BRANCHES + 1, _CANDIDATE_SIZE))
    count = _candidates(params, at, p, _filter_velocity(crossing.look, memory, slot, hand[HAND_TIME], v), table)
    if crossing.discrete > 0.0:
        before = memory[slot + _ACTIVE]
        selected = _select_river(params, at, table, count, memory, slot)
        if selected >= 0:
            taken = before != memory[slot + _ACTIVE]
            pace = _eased_pace(params, at, table[selected], taken, memory, slot, hand[HAND_TIME], p)
            _add_force(params, at, table[selected], 1.0, pace, p, v, wrench)
    else:
        selected = _add_smooth_forces(params, at, table, count, p, v, wrench)
    _write_trace(params, at, table, count, selected, memory, p)


@njit
def _write_trace(params: Array, at: int, table: Array, count: int, selected: int, memory: Array, p: Array) -> None:
    """Write the trace for the active river, or for the nearest one if none is active."""
    shown = selected
    if selected < 0 and count > 0:
        shown = 0
        for k in range(1, count):
            if table[k, _DISTANCE] < table[shown, _DISTANCE]:
                shown = k
    first, last = 0, int(_read_crossing(params, at).rivers)
    if shown >= 0:
        first, last = int(table[shown, _RIVER]), int(table[shown, _RIVER]) + 1
    memory[TRACE_RIVER] = -1.0 if selected < 0 else table[selected, _RIVER]
    for river in range(first, last):
        _, _, curve = _read_river(params, at, river)
        if shown >= 0:
            phase, distance = table[shown, _PHASE], table[shown, _DISTANCE]
        else:
            phase, distance = closest_phase(params, curve, p[0], p[1], p[2], np.nan)
        write_trace(params, curve, memory, phase, distance, phase)


@dataclass(frozen=True, eq=False)
class HigherOrder(Law):
    r"""Field of a bundle of rivers that depends on the hand's velocity: it feels the river that it moves with.

    Let m_i (`mismatch`) be the distance of the hand's velocity from the admissible velocities of river i, which are
    s φ̇_i/|φ̇_i| at t*_i with s in the interval of `River.speeds`; w_i its window; and r the admission, which gives a
    null weight to a hand that moves with no river. Then

    .. math:: F = \sum_i \lambda_i F_i, \qquad \lambda_i = \frac{e^{-s_i^2/2\sigma^2}}
              {e^{-r^2/2\sigma^2} + \sum_j e^{-s_j^2/2\sigma^2}}, \qquad s_i^2 = m_i^2 - 2\sigma^2\ln w_i

    is the smooth form. In the discrete form one river acts alone: that of smallest s_i, if s_i < r. With hysteresis h
    it stays active while s_i < r + h, unless s_j + h < s_i for another river j; the force jumps at a change. As σ → 0
    both forms select the river of smallest m_i, if m_i < r.

    A river may bring a hand of another pace to its own gradually: in the discrete form its current along the curve is
    s φ̇_i, and s goes from the pace of the hand when it was taken, within T_e, to 1. The pace is that of the nearest
    point, so a hand beside a bend keeps its angular speed, clamped to the admissible speeds over |φ̇_i|, and 1 if the
    hand is within 10 % or 15 mm/s of the river's speed:

    .. math:: s_0 = \frac{v \cdot \dot\varphi_i}{|\dot\varphi_i|^2 + (\varphi_i - p) \cdot \ddot\varphi_i}

    Each branch of a river (`controllers.curves.branches`) takes part separately, so a river that crosses itself is
    treated like two rivers that cross.

    Parameters
    ----------
    bundle : RiverBundle
        The rivers; continuity needs ε_i below the radius of curvature of φ_i.
    admission : float
        r [m/s].
    sigma : float
        σ [m/s]: width of the selection between rivers; in both forms it also weights the penalty −2σ² ln w_i near a
        tube's edge.
    hysteresis : float
        h [m/s], of the discrete form.
    form : {"smooth", "discrete"}
        How rivers share the hand.
    look : float
        Time constant of a low-pass on the velocity that selects the river [s], against measurement noise; 0 for no
        filter. The forces use the unfiltered velocity.
    ease : float
        T_e [s], of the discrete form; 0 for a current that is always the river's own.

    Raises
    ------
    ParameterError
        If r or σ is below 1e-6 m/s, h or a time negative, one of them not finite, or the form unknown; or if the smooth
        form is given T_e.
    """

    bundle: RiverBundle
    admission: float
    sigma: float
    hysteresis: float = 0.0
    form: Literal["smooth", "discrete"] = "smooth"
    look: float = 0.0
    ease: float = 0.0

    def __post_init__(self) -> None:
        check_field_types(self)
        checked("look", self.look, "s")
        checked("ease", self.ease, "s")
        if self.form == "smooth" and self.ease > 0.0:
            raise ParameterError("the smooth form has no single river to ease a hand into; leave out ease")
        checked("admission", self.admission, "m/s", least=1e-6)
        checked("sigma", self.sigma, "m/s", least=1e-6)
        checked("hysteresis", self.hysteresis, "m/s")

    @property
    def curves(self) -> tuple[Trajectory, ...]:
        """Curves of the rivers."""
        return self.bundle.curves

    def _compose(self) -> Program:
        blocks: list[Array] = []
        for river in self.bundle.rivers:
            speeds = np.zeros(0) if river.speeds is None else np.ravel(river.speeds)
            gains = RiverGains(
                river.drag / river.tau, river.drag, river.epsilon**-2, river.epsilon, river.tau, len(speeds) / 2
            )  # fmt: skip
            blocks.append(np.concatenate([gains, speeds, river.curve.packed()]))
        release = self.admission + self.hysteresis
        discrete = float(self.form == "discrete")
        header = Crossing(discrete, 0.5 * self.sigma**-2, self.admission, release, len(blocks), self.look, self.ease)
        offsets = np.cumsum([_HEADER_SIZE + len(blocks), *(len(block) for block in blocks[:-1])])
        return Program.of(self, higher_order_wrench, np.concatenate([header, offsets, *blocks]), _NO_MEMORY)
