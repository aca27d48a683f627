r"""Certified region of attraction about the curve, for the executed loop, by a Lyapunov function.

`lyapunov` finds V, `decrease_check` checks its decrease, `tube_bounds` bounds the device's kinematics and dynamics in a
tube, and `remainder` bounds what the decoupled axes with frozen inertia neglect. With these, on {√V ≤ ℓ},

.. math:: \|x^+\| \le f_\ell(\|x\|), \qquad
          f_\ell(v) = \sqrt{e^{-2rT} v^2 + T \textstyle\sum_c s_c w_c^2(\ell)} + T\,(r_0(\ell)\,v + \delta(\ell)),

so the set is invariant if f_ℓ(ℓ) < ℓ. From ℓ, √V falls to a level ℓ' if f(v) < v at v = ℓ_i, with the remainder of
ℓ_{i+1}, for all neighbours ℓ_i < ℓ_{i+1} of a grid down to ℓ', since v − f(v) increases with v.
"""

from itertools import product
from typing import NamedTuple

import numpy as np

from controllers.certificates.loop.hand import HandRange
from controllers.certificates.loop.laws import HOLD_LAW, SEEK_LAW, FollowForce
from controllers.certificates.loop.stability import CertifiedRiver
from controllers.certificates.region.decrease_check import Checked, check_form
from controllers.certificates.region.lyapunov import Axis, Cell, Form, Limits, find_form
from controllers.certificates.region.remainder import Course, Remainder, remainder
from controllers.certificates.region.tube_bounds import TubeBounds, tube_bounds
from controllers.certificates.report import CertificateError, Verdict
from controllers.fields.algebra.weights import window
from geometry.arrays import Array

# [m], [m/s] limits of a region, beyond which the bounds on the remainder grow too fast. The demo's region reaches
# 5.0 mm and 0.125 m/s. With twice the first, or half the second, no form suits all its hands; with half the first it
# reaches 2.7 mm.
MAX_RADIUS, MAX_SPEED = 0.006, 0.25
# Required rates of a form, as fractions of the slowest axis' own rate. With 0.7 alone the demo's region reaches 5.3 mm,
# but the hand comes only within 2.2 mm, instead of 1.8.
RATE_FRACTIONS = (0.82, 0.6)
# Fraction of the hands' intervals that is the firm part: the largest mass and damping, the smallest stiffness. It is
# examined where no form suits all hands.
STIFF_HAND_FRACTION = 0.2
N_LEVELS = 40  # grid of √V between 0 and 1; with 80 the demo's hand comes within 1.65 mm instead of 1.8
REPORT_LEVEL = 0.5  # level at which the remainder is reported if there is no region
CELL_COUNTS = (160, 8, 4, 1)  # parts of a cell of hands along μ, b_h, k_h, w
# Fractions of the required rate that are tried, since the check needs a margin; the demo's region needs only the first.
REDUCED_RATES = (0.97, 0.93, 0.85)


class CertifiedRegion(NamedTuple):
    """A checked form, its level ℓ, the level of the ball reached, and the remainder at ℓ."""

    form: Form
    checked: Checked
    cell: Cell
    level: float
    ball: float
    rest: Remainder

    @property
    def held_up(self) -> float:
        """Level of √V that the neglected forces alone would sustain."""
        return float(np.sqrt(_force_term(self.form, self.rest) / (2.0 * self.form.rate)))

    def offsets(self, axis: Axis) -> tuple[float, float]:
        """Largest offset at the curve's pace [m] and speed error on the curve [m/s] that are surely in the region."""
        blocks = np.array([np.diag(self.form.numbers(z)) for z in self.cell.corners(2)]).max(axis=0)
        inside = max(0.0, self.level - self.rest.shift)
        both = np.array([self.form.numbers(z)[1:3, 1:3].sum() for z in self.cell.corners(2)]).max()
        return float(inside * axis.scale[0] / np.sqrt(blocks[0])), float(inside * axis.scale[1] / np.sqrt(both))


def _force_term(form: Form, rest: Remainder) -> float:
    """Σ s_c w_c² [1/s]."""
    pushes = (rest.newtons, rest.metric)
    return sum(s * (w / unit) ** 2 for s, w, unit in zip(form.gains, pushes, form.units, strict=True))


def _find_levels(
    axis: Axis, form: Form, cell: Cell, tube: TubeBounds, course: Course, share: float, limits: Limits
) -> tuple[float, float]:
    """Largest invariant level ℓ, and the level of the ball reached; zeros if there is none."""
    grid = np.arange(N_LEVELS + 1) / N_LEVELS
    invariant, decreases = [False], [False]
    for i in range(1, N_LEVELS + 1):
        rest = remainder(axis, form, cell, tube, course, share, float(grid[i]))
        inside = grid[i] * rest.distance <= limits.distance and grid[i] * rest.force <= limits.force
        force_term = _force_term(form, rest)

        def after(v: float, rest: Remainder = rest, force_term: float = force_term) -> float:
            decayed = np.sqrt(np.exp(-2.0 * form.rate * axis.period) * v * v + axis.period * force_term)
            return float(decayed + axis.period * (rest.rate * v + rest.drift))

        invariant.append(inside and np.isfinite(force_term) and after(float(grid[i])) < grid[i])
        decreases.append(invariant[i] and after(float(grid[i - 1])) < grid[i - 1])
    if not any(invariant):
        return 0.0, 0.0
    top = max(i for i in range(N_LEVELS + 1) if invariant[i])
    ball = top
    while decreases[ball]:
        ball -= 1
    return float(grid[top]), float(grid[ball])


def _check_reduced_rates(axis: Axis, form: Form, cell: Cell) -> tuple[Form, Checked] | None:
    """The form with the largest of several reduced rates (and raised gains s_c) at which all parts of the cell pass."""
    for share in REDUCED_RATES:
        gains = tuple(gain / share for gain in form.gains)
        slower = form._replace(rate=share * form.rate, gains=gains)
        result = check_form(axis, slower, cell, CELL_COUNTS)
        if result.least > 0.0:
            return slower, result
    return None


class Search(NamedTuple):
    """Result: a form with an invariant set, and one that decreases for frozen inertia; None if there is none."""

    found: CertifiedRegion | None
    frozen: CertifiedRegion | None


def search(river: CertifiedRiver, axis: Axis, tube: TubeBounds, hands: HandRange, ceiling: float) -> Search:
    """Search for one form for all hands in given intervals.

    Parameters
    ----------
    river, axis
        The river, and one axis of its loop.
    tube : TubeBounds
        Bounds of the device within `MAX_RADIUS`.
    hands : HandRange
        Intervals of the hands; their masses add to the device's own.
    ceiling : float
        Ceiling of the limiter [N].
    """
    frozen: CertifiedRegion | None = None
    carries = river.law.carries
    course = Course.of(river.curve, river.law)
    share = float(window((MAX_RADIUS / river.width) ** 2)) if carries else 1.0
    low = np.array([tube.mass_low + hands.mass[0], hands.damping[0], hands.stiffness[0], share])
    high = np.array([tube.mass_high + hands.mass[1], hands.damping[1], hands.stiffness[1], 1.0])
    cell = Cell(low, high, tube.mass_high, tube.mass_low)
    slowest = max(_spectral_radius(axis, z) for z in cell.corners())
    if slowest >= 1.0:
        return Search(None, None)
    steady = axis.damping * course.pace * hands.damping[1] / (axis.damping + hands.damping[1])
    limits = Limits(
        min(ceiling, tube.motor_force) - steady, MAX_RADIUS, MAX_SPEED, _expected_forces(axis, cell, tube, course)
    )
    for part in RATE_FRACTIONS:
        form = find_form(axis, cell, limits, -part * np.log(slowest) / axis.period)
        passed = None if form is None else _check_reduced_rates(axis, form, cell)
        if passed is None:
            continue
        level, ball = _find_levels(axis, passed[0], cell, tube, course, share, limits)
        rest = remainder(axis, passed[0], cell, tube, course, share, level or REPORT_LEVEL)
        if level > 0.0:
            return Search(
                CertifiedRegion(*passed, cell, level, ball, rest), CertifiedRegion(*passed, cell, 1.0, 0.0, rest)
            )
        frozen = frozen or CertifiedRegion(*passed, cell, 1.0, 0.0, rest)
    return Search(None, frozen)


def _spectral_radius(axis: Axis, z: Array) -> float:
    """Spectral radius of an axis."""
    return float(np.abs(np.linalg.eigvals(axis.numbers(z))).max())


def _expected_forces(axis: Axis, cell: Cell, tube: TubeBounds, course: Course) -> tuple[float, float]:
    """Estimates of the neglected forces near the curve [N], [N/√kg]."""
    shift = axis.damping / cell.low[0] * tube.rounding
    friction = tube.coulomb + (axis.damping + cell.high[1]) * shift + axis.stiffness * tube.rounding
    pace = axis.damping / (axis.damping + cell.low[1]) * course.pace
    momentum = np.sqrt(tube.mass_high) * (pace + 0.5 * MAX_SPEED)
    return friction, float(momentum * (tube.coriolis * pace + tube.drag))


def _loosest_hand(axis: Axis, tube: TubeBounds, hands: HandRange) -> HandRange:
    """The corner of the intervals whose hand returns to the curve most slowly."""

    def radius(hand: tuple[float, float, float]) -> float:
        masses = (hand[0] + tube.mass_low, hand[0] + tube.mass_high)
        return max(_spectral_radius(axis, np.array([mass, *hand[1:], 1.0])) for mass in masses)

    m, b, k = max(product(hands.mass, hands.damping, hands.stiffness), key=radius)
    return HandRange((m, m), (b, b), (k, k))


def _firm_part(hands: HandRange) -> HandRange:
    """The part of the intervals with the largest mass and damping and the smallest stiffness."""

    def upper(low: float, high: float) -> tuple[float, float]:
        return high - STIFF_HAND_FRACTION * (high - low), high

    low, high = hands.stiffness
    return HandRange(upper(*hands.mass), upper(*hands.damping), (low, low + STIFF_HAND_FRACTION * (high - low)))


def region(river: CertifiedRiver, hands: HandRange, ceiling: float, linear: Verdict) -> Verdict:
    """Verdict on a region about the curve that is attracted to a smaller ball about it, for every hand in intervals.

    Certified if V decreases on the whole region in spite of the remainder; the margin is the offset [m] from which a
    hand at the curve's pace is certain to converge to the ball. Refuted if the loop is not even stable along the curve.
    If the result is unknown because of the loosest hand, the firm part of the intervals is tried and reported.

    Parameters
    ----------
    river : CertifiedRiver
        System to be certified.
    hands : HandRange
        Intervals of mass, damping, and stiffness about the nearest point.
    ceiling : float
        Ceiling of the limiter [N].
    linear : Verdict
        Verdict on its linear stability.
    """
    if linear.verdict == "refuted":
        reason = "no region: the loop is unstable on the curve itself"
        return Verdict("refuted", reason, -1.0, (), linear.counterexample)
    if not isinstance(river.law.force, FollowForce) and river.law not in (SEEK_LAW, HOLD_LAW):
        return Verdict("unknown", "a region is sought only about curves whose nearest point attracts, and points")
    if river.sampling.rest_delay > 0.0 or river.k_r <= 0.0 or river.b_d <= 0.0:
        return Verdict("unknown", "a region needs a stiffness, a damping, and a delay of whole periods")
    if min(0.4 * river.curve.reach, 0.8 * river.width) < MAX_RADIUS:
        return Verdict(
            "unknown", f"a region needs {1e3 * MAX_RADIUS:g} mm about the curve, too much for its bends or tube"
        )
    sampling = river.sampling
    axis = Axis(river.k_r, river.b_d, sampling.period, sampling.keep, sampling.whole_delay, river.law.slides)
    try:
        tube = tube_bounds(river.device, river.curve, MAX_RADIUS)
    except CertificateError as error:
        return Verdict("unknown", str(error))
    loosest = _loosest_hand(axis, tube, hands)
    alone = search(river, axis, tube, loosest, ceiling)
    tried = alone if alone.found is None or hands == loosest else search(river, axis, tube, hands, ceiling)
    if tried.found is not None:
        figures = _figures(axis, tried.found)
        return Verdict(
            "certified", _description(axis, tried.found), tried.found.offsets(axis)[0], ASSUMPTIONS, {}, figures
        )
    reason = _reason(alone.frozen, loosest) if alone.found is None else "no one Lyapunov function suits all these hands"
    firm = _firm_part(hands)
    part = Search(None, None) if hands == loosest else search(river, axis, tube, firm, ceiling)
    if part.found is None:
        return Verdict("unknown", f"{reason}; narrow their intervals", None, ASSUMPTIONS)
    figures = _figures(axis, part.found) | {"firm_hands": firm}
    reason = f"{reason}. Certain for {_hands_text(firm)}: {_description(axis, part.found)}"
    return Verdict("unknown", reason, None, ASSUMPTIONS, {}, figures)


def _description(axis: Axis, found: CertifiedRegion) -> str:
    offset, speed = found.offsets(axis)
    return (
        f"from {1e3 * offset:.3g} mm off the curve, or {speed:.3g} m/s off its speed, the hand comes within "
        f"{1e3 * found.rest.distance * found.ball:.3g} mm and stays there"
    )


def _hands_text(hands: HandRange) -> str:
    """Text for intervals; one number where an interval is a point."""
    intervals = ((hands.mass, "kg"), (hands.damping, "N s/m"), (hands.stiffness, "N/m"))
    return "hands of " + ", ".join(
        f"{low:.3g}{f' to {high:.3g}' if high > low else ''} {unit}" for (low, high), unit in intervals
    )


def _reason(frozen: CertifiedRegion | None, hands: HandRange) -> str:
    """Reason why the loosest hand alone has no certified region."""
    if frozen is None:
        return f"no Lyapunov function was found for {_hands_text(hands)} alone"
    return (
        f"with {_hands_text(hands)} alone V decays at {frozen.form.rate:.3g}/s with frozen inertia, but half way in "
        f"the neglected terms may reduce that by {frozen.rest.rate:.3g}/s and add {frozen.rest.drift:.3g}/s, and "
        f"{frozen.rest.newtons:.2g} N hold it at {frozen.held_up:.2g} of its edge: no region is certified"
    )


ASSUMPTIONS = (
    "the linkage as modelled, with Coulomb friction, rounding encoders and its own nonlinearity in the whole tube",
    "a hand of constant mass, damping and stiffness about the curve's nearest point, anywhere in the intervals",
    "a limiter that lets the region's forces through: motors not yet warm, no jump from rest above its rate",
    "pace, curvature and window of the curve are taken from a fine grid; terms of second order in the period by 5 %",
    "rounding errors of what is not interval arithmetic, eigenvalues among it, are not bounded",
)


def _figures(axis: Axis, found: CertifiedRegion) -> dict[str, object]:
    offset, speed = found.offsets(axis)
    return {
        "distance": offset,
        "speed": speed,
        "ball": found.rest.distance * found.ball,
        "largest_distance": found.rest.distance * found.level,
        "largest_force": found.rest.force * found.level,
        "rate": float(found.form.rate),
        "remainder_rate": found.rest.rate,
        "remainder_drift": found.rest.drift,
        "remainder_force": found.rest.newtons,
        "held_up": found.held_up,
        "level": found.level,
        "ball_level": found.ball,
        "shift": found.rest.shift,
        "cells": float(found.checked.cells),
        "cell_slack": found.checked.slack,
        "cell_least": found.checked.least,
        "scale": axis.scale,
        "alpha": found.form.alpha,
        "beta": found.form.beta,
        "hand": found.form.hand,
        "masses": np.array([found.cell.low[0], found.cell.high[0]]),
        "ellipse": _ellipses(axis, found),
    }


def _ellipses(axis: Axis, found: CertifiedRegion) -> Array:
    """Edges of region and ball over (e [m], ν = y [m/s]), for the lightest and the heaviest mass, (2, 2, n, 2)."""
    angle = np.linspace(0.0, 2.0 * np.pi, 97)
    circle = np.stack([np.cos(angle), np.sin(angle)])
    spread = np.zeros((axis.size, 2))
    spread[0, 0] = spread[1, 1] = spread[2, 1] = 1.0
    edges: list[list[Array]] = []
    for z in (found.cell.low, found.cell.high):
        lower = np.linalg.cholesky(spread.T @ found.form.numbers(z) @ spread)
        edge = np.linalg.solve(lower.T, circle) * axis.scale[:2, None]
        edges.append([(level * edge).T for level in (max(0.0, found.level - found.rest.shift), found.ball)])
    return np.array(edges)
