r"""Absolute stability of a law along a curve with a governor: a sector-bounded damper along the curve.

A governor's force is −β(s) along the tangent, where s is the measured speed along it. The slope of β is between 0
(within the admissible speeds) and b (beyond them). The rest of the loop is linear, with transfer function G(z) from a
force along the tangent to s. By the circle criterion (Zames 1966; in discrete time Tsypkin 1962) the loop is stable for
every such β, even time-varying, if it is stable without the governor and

.. math:: \mathrm{Re}\,\bigl(1 + b\,G(e^{i\omega})\bigr) > 0 \qquad \text{for all } \omega .

Stability is refuted if the loop with the full b is unstable; between the two conditions the result is unknown.
"""

from collections.abc import Sequence
from dataclasses import replace

import casadi
import numpy as np
import numpy.typing as npt

from controllers.certificates.loop.device import Symbol, vector
from controllers.certificates.loop.hand import NO_HAND, HandImpedance
from controllers.certificates.loop.laws import SymbolicLaw, nearest_phase
from controllers.certificates.loop.sampled_loop import SampledLoop
from controllers.certificates.loop.stability import CertifiedRiver, counterexample, stability
from controllers.certificates.report import Verdict
from controllers.curves.trajectory import piece_velocity

# Number of frequencies of G, from 1e-4 of the Nyquist frequency up to it; eight times as many lower the largest drag
# by 0.02 %.
N_FREQUENCIES = 400


def with_damper(base: SymbolicLaw, drag: float, k_r: float, b_d: float) -> SymbolicLaw:
    """A law plus a damper −drag t (t·v) along the curve, scaled with the law's gain k_r (or b_d if k_r is 0)."""

    def force(p: Symbol, v: Symbol, piece: Symbol, u: Symbol, k: Symbol, b: Symbol, width: Symbol) -> Symbol:
        along = vector(piece_velocity.py_func(piece, 0, nearest_phase(p, piece, u)))
        # In this order no square of a velocity underflows on a curve that is slowed down to rest.
        tangent = along / casadi.norm_2(along)
        share = k / k_r if k_r > 0.0 else b / b_d
        return base.force(p, v, piece, u, k, b, width) - share * drag * tangent * casadi.dot(tangent, v)

    return base._replace(force=force)


def response_along(loop: SampledLoop, k_r: float, b_d: float) -> npt.NDArray[np.complex128]:
    """G(e^{iω}) [m/(N s)] from a force along the curve to the measured speed, complex, shape (n, `N_FREQUENCIES`)."""
    linear, (basis, projection) = loop.linear, loop.across
    tangent = linear.velocity / np.linalg.norm(linear.velocity, axis=1, keepdims=True)
    force = projection @ loop.fresh @ (linear.jacobian.transpose(0, 2, 1) @ tangent[:, :, None])
    speed = tangent[:, None, :] @ loop.measured_velocity @ basis
    # In diagonal form, one eigenvalue problem per phase serves all frequencies.
    values, vectors = np.linalg.eig(loop.frozen(k_r, b_d))
    residues = (speed @ vectors)[:, 0, :] * np.linalg.solve(vectors, force.astype(complex))[:, :, 0]
    z = np.exp(1j * np.geomspace(1e-4 * np.pi, np.pi, N_FREQUENCIES))
    return np.sum(residues[:, None, :] / (z[None, :, None] - values[:, None, :]), axis=2)


def max_drag(loop: SampledLoop, k_r: float, b_d: float) -> float:
    """Largest b [N s/m] for which the circle criterion holds at every phase; 0 if the loop is unstable at b = 0."""
    if loop.radius(k_r, b_d).max() >= 1.0:
        return 0.0
    least = float(response_along(loop, k_r, b_d).real.min())
    return -1.0 / least if least < 0.0 else float("inf")


def governed_stability(river: CertifiedRiver, drag: float, hands: Sequence[HandImpedance]) -> Verdict:
    """Verdict on a river's stability with a governor of a given drag [N s/m], for each of several hands.

    Certified if the river alone is certified and the circle criterion holds; refuted if the loop is unstable while the
    governor acts. The margin is the smaller of the river's and (largest drag by the circle criterion)/drag − 1.
    """
    alone = stability(river, hands)
    if drag == 0.0 or alone.verdict == "refuted":
        return alone
    if river.k_r == 0.0 and river.b_d == 0.0:
        return replace(alone, verdict="unknown", reason="a governor alone is not certified; give the field a gain")
    river_with_damper = river._replace(law=with_damper(river.law, drag, river.k_r, river.b_d))
    worst, largest, worst_case = -1.0, float("inf"), (NO_HAND, 0)
    for hand in hands:
        radius = river_with_damper.loop(hand).radius(river.k_r, river.b_d)
        if radius.max() > worst:
            worst, worst_case = float(radius.max()), (hand, int(radius.argmax()))
        largest = min(largest, max_drag(river.loop(hand), river.k_r, river.b_d))
    summary = f"governor of {drag:g} N s/m, certain up to {largest:.3g}"
    figures = {**alone.figures, "governor_drag": drag, "governor_certain": largest, "governor_radius": worst}
    assumptions = (
        *alone.assumptions,
        "the governor's admissible speeds are held as they are at a phase; it acts or rests at any tick",
    )
    if worst >= 1.0:
        example = counterexample(river_with_damper, *worst_case)
        refutation = f"unstable while the governor acts, by a factor of {worst:.4g} a period: {summary}; {alone.reason}"
        return Verdict("refuted", refutation, largest / drag - 1.0, assumptions, example, figures)
    margin = min(alone.margin or 0.0, largest / drag - 1.0)
    if alone.verdict == "certified" and largest <= drag:
        reason = f"stable while the governor acts and while it rests, but not certified as it switches: {summary}"
        return Verdict("unknown", f"{reason}; {alone.reason}", margin, assumptions, {}, figures)
    return Verdict(alone.verdict, f"{alone.reason}; {summary}", margin, assumptions, {}, figures)
