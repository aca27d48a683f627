"""Rivers: a tube around a curve with a current towards it and along it (Donald & Henle 2000, section 2.3)."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from controllers.checks import check_field_types, checked
from controllers.curves.trajectory import Trajectory
from controllers.errors import ControllerError
from controllers.fields.admissible import checked_speeds
from controllers.fields.algebra.law import Law, Program
from controllers.fields.follow import Follow, FollowGains, follow_at
from geometry.arrays import Array

Flow = Callable[[float, Array], Array]
"""A flow V(t, p): time [s] and p_H [m], shape (3,), to a velocity [m/s], shape (3,)."""
_MAX_STEP = 0.02  # of an integration [s]; a much longer step could miss a narrow river


@dataclass(frozen=True, eq=False)
class River(Law):
    r"""Tube of radius ε around a curve, with a current along the curve and towards it.

    .. math:: V(p) = w(d/\varepsilon)\,\bigl(\dot\varphi(t^*) + (\varphi(t^*) - p)/\tau\bigr)

    As a *flow*, V is a velocity (`flow`, integrated by `integrate`). As a *force* it is the drag of a viscous current
    on the hand, F = b (V − w v), which is FOLLOW with k_r = b/τ and b_d = b.

    Parameters
    ----------
    curve : Trajectory
        φ, in the hand frame H.
    epsilon : float
        ε [m], may be infinite. V is continuous if ε is below `Trajectory.reach`.
    tau : float
        τ, time constant of the current towards the curve [s].
    drag : float
        b, force per velocity between current and hand [N s/m].
    speeds : array_like, shape (m, 2), optional
        Smallest and largest hand speed that the river accepts [m/s], at m phases equally spaced from the curve's
        start to its end, linear between them; without them, the curve's own speed. Only higher-order fields
        (`HigherOrder`) use them.

    Raises
    ------
    ParameterError
        If τ is below 1e-4 s, ε below 1e-4 m, b negative, τ or b not finite, or the speeds are not pairs
        0 ≤ least ≤ greatest.
    """

    curve: Trajectory
    epsilon: float = 0.02
    tau: float = 0.02
    drag: float = 4.0
    speeds: npt.ArrayLike | None = None

    def __post_init__(self) -> None:
        check_field_types(self)
        checked("epsilon", self.epsilon, "m", least=1e-4, infinite=True)
        checked("tau", self.tau, "s", least=1e-4)
        checked("drag", self.drag, "N s/m")
        if self.speeds is not None:
            object.__setattr__(self, "speeds", checked_speeds("river", self.speeds))

    @cached_property
    def _packed_curve(self) -> Array:
        return self.curve.packed()

    @cached_property
    def force(self) -> Follow:
        """The river as a force: FOLLOW with k_r = b/τ and b_d = b."""
        return Follow(self.curve, self.drag / self.tau, self.drag, self.epsilon)

    def _compose(self) -> Program:
        return self.force.program()

    def flow(self, t: float, p: Array) -> Array:
        """V(p) [m/s], shape (3,); it does not depend on the time t. It is FOLLOW's on a hand at rest, by 1/τ and 1."""
        flow = np.empty(6)
        gains = FollowGains(1.0 / self.tau, 1.0, self.epsilon**-2, 0.0)
        follow_at(gains, self._packed_curve, 0, np.nan, p, np.zeros(3), flow)
        return flow[:3]


def integrate(flow: Flow, start: npt.ArrayLike, times: npt.ArrayLike) -> Array:
    """Points of an integral curve ṗ = V(t, p) of a flow, in H [m], (n, 3), by scipy's DOP853 with tolerance 1e-10.

    Parameters
    ----------
    flow : callable
        ``River.flow``, ``RiverBundle.flow`` or ``Edited.flow``.
    start : array_like, shape (3,)
        p at the first time, in H [m].
    times : array_like, shape (n,)
        Output times, increasing [s].

    Raises
    ------
    ControllerError
        If the integration fails.
    """
    from scipy.integrate import solve_ivp  # imported late: the servo imports this file and does not need it

    output_times = np.asarray(times, dtype=float)
    solution = solve_ivp(
        flow, (output_times[0], output_times[-1]), np.asarray(start, dtype=float), "DOP853", output_times,
        rtol=1e-10, atol=1e-12, max_step=_MAX_STEP,
    )  # fmt: skip
    if not solution.success:
        raise ControllerError(f"the flow could not be integrated from {start}: {solution.message}")
    return np.ascontiguousarray(solution.y.T)
