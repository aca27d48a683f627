r"""A region about the curve from which the loop that runs comes near to it: its Lyapunov certificate.

`lyapunov` finds V and checks its decrease, `tube_bounds` says what the device can do in a tube, `remainder` what the
frozen axes leave out. With these, on {√V ≤ ℓ},

.. math:: \|x^+\| \le \bigl(1 - T\,(r - r_0 - r_1 \ell)\bigr)\,\|x\| + T\,\delta,

so the set is never left if (r − r_0 − r_1 ℓ) ℓ > δ, and is left for the ball of the least ℓ for which that holds.
"""

from typing import NamedTuple

import numpy as np

from controllers.certificates.hand import HandRange
from controllers.certificates.laws import FOLLOW_LAW, HOLD_LAW, SEEK_LAW
from controllers.certificates.lyapunov import Axis, Cell, Checked, Form, Limits, check_form, find_form
from controllers.certificates.remainder import Course, Remainder, remainder
from controllers.certificates.report import CertificateError, Verdict
from controllers.certificates.stability import River
from controllers.certificates.tube_bounds import TubeBounds, tube_bounds
from controllers.fields.window import window
from controllers.state import Array

RADII = (0.006, 0.009)  # [m] of the tubes that are tried
SHARES = (0.45, 0.82)  # of the slowest axis' own rate that a form is asked for
LEVELS = 40  # of √V between 0 and 1
PARTS = (160, 8, 4, 1)  # of a cell of hands along μ, b_h, k_h, w
BACKED_OFF = (0.97, 0.93, 0.85)  # of the rate that was asked for, where the check of the cells needs room


class Found(NamedTuple):
    """A form that was checked, its level ℓ, the level of the ball that is reached, and the remainder at ℓ."""

    form: Form
    checked: Checked
    cell: Cell
    radius: float
    level: float
    ball: float
    rest: Remainder

    def offsets(self, axis: Axis) -> tuple[float, float]:
        """Largest offset at the curve's pace [m] and largest wrong speed on the curve [m/s] that are surely inside."""
        blocks = np.array([np.diag(self.form.numbers(z)) for z in self.cell.corners(2)]).max(axis=0)
        inside = max(0.0, self.level - self.rest.shift)
        both = np.array([self.form.numbers(z)[1:3, 1:3].sum() for z in self.cell.corners(2)]).max()
        return float(inside * axis.scale[0] / np.sqrt(blocks[0])), float(inside * axis.scale[1] / np.sqrt(both))


def _levels(axis: Axis, form: Form, cell: Cell, tube: TubeBounds, course: Course, share: float) -> tuple[float, float]:
    """Largest ℓ that is not left, and the level of the ball; zeros if there is none."""
    grid = np.arange(1, LEVELS + 1) / LEVELS
    rests = [remainder(axis, form, cell, tube, course, share, float(level)) for level in grid]
    spare = np.array(
        [
            (form.rate - rest.rate - rest.rate_by_level * level) * level - rest.drift
            for rest, level in zip(rests, grid, strict=True)
        ]
    )
    held = np.flatnonzero(spare > 0.0)
    if len(held) == 0:
        return 0.0, 0.0
    top = int(held[-1])
    below = [i for i in range(top) if spare[i] <= 0.0]
    return float(grid[top]), float(grid[below[-1] + 1] if below else grid[0])


def _checked(axis: Axis, form: Form, cell: Cell) -> tuple[Form, Checked] | None:
    """The form with the largest of a few rates at which every part of the cell passes."""
    for share in BACKED_OFF:
        slower = form._replace(rate=share * form.rate)
        result = check_form(axis, slower, cell, PARTS)
        if result.least > 0.0:
            return slower, result
    return None


class Search(NamedTuple):
    """What was tried: the best form whose set is not left, and the largest whose frozen axes decrease."""

    found: Found | None
    frozen: Found | None


def search(river: River, axis: Axis, hands: HandRange, ceiling: float) -> Search:
    """Forms for all hands of some intervals at once.

    Parameters
    ----------
    river, axis
        The loop.
    hands : HandRange
        Their masses come on top of the device's own.
    ceiling : float
        The limiter's [N].

    Raises
    ------
    CertificateError
        If the tube comes too near to a singular configuration.
    """
    found: Found | None = None
    frozen: Found | None = None
    carries = river.law.carries
    course = Course.of(river.curve, carries)
    room = min(0.4 * river.curve.reach, 0.8 * river.width)
    for radius in sorted({min(radius, room) for radius in RADII}):
        tube = tube_bounds(river.device, river.curve, radius)
        share = float(window((radius / river.width) ** 2)) if carries else 1.0
        low = np.array([tube.mass_low + hands.mass[0], hands.damping[0], hands.stiffness[0], share])
        high = np.array([tube.mass_high + hands.mass[1], hands.damping[1], hands.stiffness[1], 1.0])
        cell = Cell(low, high)
        own = min(float(np.abs(np.linalg.eigvals(axis.numbers(z))).max()) for z in cell.corners())
        slowest = max(float(np.abs(np.linalg.eigvals(axis.numbers(z))).max()) for z in cell.corners())
        if slowest >= 1.0 or own <= 0.0:
            continue
        steady = axis.damping * course.pace * hands.damping[1] / (axis.damping + hands.damping[1])
        limits = Limits(min(ceiling, tube.motor_force) - steady, radius, 0.5)
        for part in SHARES:
            form = find_form(axis, cell, limits, -part * np.log(slowest) / axis.period)
            passed = None if form is None else _checked(axis, form, cell)
            if passed is None:
                continue
            level, ball = _levels(axis, passed[0], cell, tube, course, share)
            rest = remainder(axis, passed[0], cell, tube, course, share, level or 1.0)
            whole = Found(*passed, cell, radius, 1.0, 0.0, rest)
            if frozen is None or whole.offsets(axis) > frozen.offsets(axis):
                frozen = whole
            certain = whole._replace(level=level, ball=ball)
            if level > 0.0 and (found is None or certain.offsets(axis) > found.offsets(axis)):
                found = certain
    return Search(found, frozen)


def region(river: River, hands: HandRange, ceiling: float, linear: Verdict) -> Verdict:
    """Verdict on a region about the curve that is attracted to a ball about it, for every hand of some intervals.

    Certified: V decreases on all of it in spite of the remainder; the margin is the offset [m] from which a hand that
    moves at the curve's own pace surely comes near. Refuted where the loop is not even stable along the curve.

    Parameters
    ----------
    river : River
        What is certified.
    hands : HandRange
        Intervals of mass, damping, and stiffness about the nearest point.
    ceiling : float
        The limiter's [N].
    linear : Verdict
        On its stability.
    """
    if linear.verdict == "refuted":
        reason = "no region: the loop is unstable on the curve itself"
        return Verdict("refuted", reason, -1.0, (), linear.counterexample)
    if river.law not in (FOLLOW_LAW, SEEK_LAW, HOLD_LAW):
        return Verdict("unknown", "a region is sought only about curves whose nearest point attracts, and points")
    if river.sampling.rest_delay > 0.0 or river.k_r <= 0.0 or river.b_d <= 0.0:
        return Verdict("unknown", "a region needs a stiffness, a damping, and a delay of whole periods")
    sampling = river.sampling
    axis = Axis(river.k_r, river.b_d, sampling.period, sampling.keep, sampling.whole_delay, river.law.slides)
    try:
        tried = search(river, axis, hands, ceiling)
    except CertificateError as error:
        return Verdict("unknown", str(error))
    if tried.frozen is None:
        return Verdict("unknown", "no Lyapunov function was found that suits all these hands; narrow their intervals")
    frozen, speed = tried.frozen.offsets(axis)
    told = f"with the inertia frozen V decreases from {1e3 * frozen:.3g} mm and {speed:.3g} m/s"
    if tried.found is None:
        rest = tried.frozen.rest
        reason = (
            f"{told} at {tried.frozen.form.rate:.3g}/s, but what that leaves out may take "
            f"{rest.rate + rest.rate_by_level:.3g}/s and push by {rest.drift:.3g}/s: too much to be certain"
        )
        return Verdict("unknown", reason, None, ASSUMPTIONS, {}, _figures(axis, tried.frozen, tried.frozen))
    offset, wrong = tried.found.offsets(axis)
    reason = (
        f"from {1e3 * offset:.3g} mm off the curve, or {wrong:.3g} m/s from its pace, the hand comes within "
        f"{1e3 * tried.found.rest.distance * tried.found.ball:.3g} mm and stays there; {told}"
    )
    return Verdict("certified", reason, offset, ASSUMPTIONS, {}, _figures(axis, tried.found, tried.frozen))


ASSUMPTIONS = (
    "the linkage as modelled, with Coulomb friction, rounding encoders and its own nonlinearity in the whole tube",
    "a hand of constant mass, damping and stiffness about the curve's nearest point, anywhere in the intervals",
    "a limiter that lets the region's forces through: motors not yet warm, no jump from rest above its rate",
    "pace, curvature and window of the curve are taken from a fine grid; terms of second order in the period by 5 %",
)


def _figures(axis: Axis, found: Found, frozen: Found) -> dict[str, object]:
    offset, speed = found.offsets(axis)
    wide, fast = frozen.offsets(axis)
    return {
        "distance": offset,
        "speed": speed,
        "ball": found.rest.distance * found.ball,
        "largest_distance": found.rest.distance * found.level,
        "largest_force": found.rest.force * found.level,
        "frozen_distance": wide,
        "frozen_speed": fast,
        "rate": found.form.rate,
        "remainder_rate": found.rest.rate + found.rest.rate_by_level * found.level,
        "remainder_drift": found.rest.drift,
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


def _ellipses(axis: Axis, found: Found) -> Array:
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
