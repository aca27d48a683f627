r"""Linearisation of an executed program of laws by finite differences, for laws that do not evaluate on symbols.

The torques τ(θ, ω) = J(θ)ᵀ F(p(θ), J(θ) ω) come from the compiled program itself; their derivatives are central
differences at a state of the hand, with memory and phase fixed. They replace the symbolic derivatives in `LinearLoop`.
Where a force jumps or has a kink, forward and backward differences, or those of two step sizes, disagree: there is no
derivative. This method can refute stability but not prove it, since only the given states are examined.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from controllers.certificates.loop.hand import HandImpedance
from controllers.certificates.loop.hand_samples import States, states_about
from controllers.certificates.loop.linear_loop import LinearLoop
from controllers.certificates.loop.sampled_loop import SampledLoop
from controllers.certificates.loop.stability import CertifiedRiver
from controllers.fields.algebra.instructions import Join
from controllers.fields.algebra.law import Program
from controllers.fields.algebra.program import evaluate
from controllers.state import HandState
from geometry.arrays import Array, Mask

_STEP = 1e-6  # [rad], [rad/s] step of the differences
# Forward and backward steps of two sizes; all give the same slope where the force has a derivative. The slope of a
# Gaussian of 1 mm width changes by 0.01 % within a step. At a jump one slope is ten times another; at a kink the two
# sides differ.
_STEPS = (_STEP, -_STEP, 0.1 * _STEP, -0.1 * _STEP)
_SLOPE_TOLERANCE = 0.01  # largest difference between the slopes, as a fraction of the largest derivative
_MIN_SLOPE = 1e-6  # [N m/rad], [N m s/rad] smaller than any relevant derivative, larger than rounding divided by a step
_LIMIT_FRACTION = 0.999  # fraction of the limit from which a force counts as limited
_MIN_OSCILLATION_ANGLE = 1e-2  # [rad per period] an eigenvalue with a smaller angle is a drift, not an oscillation
_DIRECTIONS = 4  # transverse directions in which states off the curve are examined


class WorstState(NamedTuple):
    """The worst of the examined states.

    Attributes
    ----------
    radius : float
        Spectral radius of a period in that state, over the oscillating modes.
    phase : float
        Phase of the curve [s].
    p, v : Array
        Position [m] and velocity [m/s] of the hand.
    hand : HandImpedance
        Hand on the stylus.
    states : int
        Number of examined states.
    strongest : float
        Largest force of the program in any of these states [N].
    abrupt : tuple of Array
        Positions [m] of the states in which the force jumps, has a kink or is not finite. It has no derivative there,
        so these states are not judged.
    """

    radius: float
    phase: float
    p: Array
    v: Array
    hand: HandImpedance
    states: int
    strongest: float
    abrupt: tuple[Array, ...] = ()


class ProgramLinearisation(NamedTuple):
    """A linear loop with the derivatives of a program, and whether they exist in each of its n states, shape (n,)."""

    loop: LinearLoop
    smooth: Mask


def force_at(program: Program, memory: Array, p: Array, v: Array, t: float) -> Array:
    """F_H [N] of a program at a hand p [m], v [m/s] at time t [s], evaluated with a copy of the memory."""
    hand, wrench, own = HandState.at(p, v, t), np.empty(6), memory.copy()
    program.feed(own, hand)
    evaluate(*program.compiled(), own, hand.vector(), wrench)
    return wrench[:3].copy()


def linearise_program(
    linear: LinearLoop, program: Program, river: CertifiedRiver, states: States
) -> ProgramLinearisation:
    """The linear loop of `river` with the program's derivatives at n hands; use it with k_r = 1, b_d = 0.

    `linear` has the plant at the same phases, possibly of a slowed-down curve; hands need not be on the curve. Their
    time is their phase, as in the first lap. Where the force has no derivative, zero is used.
    """
    by_theta, by_omega = np.zeros((2, *linear.weight_theta.shape)), np.zeros((2, *linear.weight_theta.shape))
    smooth = np.ones(len(states.p), dtype=np.bool_)
    numbers = river.device.numbers
    for i, (place, velocity, phase) in enumerate(zip(states.p, states.v, states.phases, strict=True)):
        theta = np.array(river.device.angles(place))
        memory = program.fresh_memory()
        # One evaluation, so that the memory contains the phase.
        hand, wrench = HandState.at(place, velocity, float(phase)), np.empty(6)
        program.feed(memory, hand)
        evaluate(*program.compiled(), memory, hand.vector(), wrench)
        omega = np.linalg.solve(numbers(theta)[1], velocity)

        def torque(theta: Array, omega: Array, memory: Array = memory, phase: float = float(phase)) -> Array:
            at, jacobian = numbers(theta)
            return jacobian.T @ force_at(program, memory, at, jacobian @ omega, phase)

        here, unit = torque(theta, omega), np.eye(3)
        found = (
            _derivative([torque(theta + step * axis, omega) - here for axis in unit for step in _STEPS]),
            _derivative([torque(theta, omega + step * axis) - here for axis in unit for step in _STEPS]),
        )
        smooth[i] = all(slope is not None for slope in found)
        for slopes, slope in zip((by_theta, by_omega), found, strict=True):
            slopes[0, i] = 0.0 if slope is None or not smooth[i] else slope
    return ProgramLinearisation(replace(linear, unit_theta=by_theta, unit_omega=by_omega), smooth)


def _derivative(changes: Sequence[Array]) -> Array | None:
    """Derivative (3, 3) of torques from their changes for `_STEPS` along each axis; None if it does not exist."""
    slopes = np.array(changes).reshape(3, len(_STEPS), 3) / np.array(_STEPS)[:, None]
    # Central difference of the larger step, with an error of second order.
    central = 0.5 * (slopes[:, 0] + slopes[:, 1])
    spread = np.abs(slopes - central[:, None]).max()
    # In this form the comparison is false for NaN, which is no derivative.
    return central.T if spread <= _SLOPE_TOLERANCE * np.abs(central).max() + _MIN_SLOPE else None


def examine_curve(
    program: Program,
    river: CertifiedRiver,
    reach: float,
    hands: Sequence[HandImpedance],
    pace: float = 1.0,
    n: int = 16,
) -> WorstState:
    """The worst of states on the curve, at rest and at `pace` times its speed, and of states `reach` [m] off it."""
    phases = river.phases(n)
    points, velocity = river.curve.point(phases), river.curve.velocity(phases)
    tangent = velocity / np.linalg.norm(velocity, axis=1, keepdims=True)
    plane = np.linalg.svd(tangent[:, None, :])[2][:, 1:, :]
    angles = 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    away = [reach * (np.cos(a) * plane[:, 0] + np.sin(a) * plane[:, 1]) for a in angles]
    offs, paces = (0.0 * points, 0.0 * points, *away), (0.0, *[pace] * (1 + _DIRECTIONS))
    states = [States(phases, points + off, share * velocity) for off, share in zip(offs, paces, strict=True)]
    return _worst_state(program, river, states, hands)


def examine_random_states(program: Program, river: CertifiedRiver, hands: Sequence[HandImpedance]) -> WorstState:
    """The worst of the random states about the curve (`states_about`), which a user-defined law cannot anticipate."""
    return _worst_state(program, river, [states_about(river.curve)], hands)


def _worst_state(
    program: Program, river: CertifiedRiver, states: Sequence[States], hands: Sequence[HandImpedance]
) -> WorstState:
    """The worst of several sets of states near the same phases, with every hand.

    States out of reach are omitted, and so are those in which the limit of the whole program reduces its force: a
    certificate assumes that it does not.
    """
    plants = [(hand, river.still_at(states[0].phases, hand)) for hand in hands]
    worst = WorstState(0.0, float(states[0].phases[0]), states[0].p[0], states[0].v[0], hands[0], 0, 0.0)
    strongest, abrupt = 0.0, list[Array]()
    *_, (last, numbers) = program.composition()
    limit = numbers[0] if last is Join.LIMIT else np.inf  # of the whole field; an earlier one is of a part
    for phases, wanted, v in states:
        reachable = np.array([_is_reachable(river, place) for place in wanted])
        p = np.where(reachable[:, None], wanted, river.curve.point(phases))
        law, smooth = linearise_program(plants[0][1], program, river, States(phases, p, v))
        fresh = program.fresh_memory()
        sizes = np.linalg.norm(
            [force_at(program, fresh, *state) for state in zip(p, v, phases.tolist(), strict=True)], axis=1
        )
        strongest = max(strongest, float(sizes[reachable].max(initial=0.0)))
        reachable &= np.logical_not(sizes >= _LIMIT_FRACTION * limit)
        abrupt += list(p[reachable & ~smooth])
        worst = worst._replace(states=worst.states + int(reachable.sum()))
        for hand, plant in plants:
            loop = SampledLoop(replace(plant, unit_theta=law.unit_theta, unit_omega=law.unit_omega), river.sampling)
            values = np.linalg.eigvals(loop.frozen(1.0, 0.0))
            radius = np.where(np.abs(np.angle(values)) > _MIN_OSCILLATION_ANGLE, np.abs(values), 0.0).max(axis=1)
            radius = np.where(reachable & smooth, radius, 0.0)
            at = int(radius.argmax())
            if radius[at] > worst.radius:
                worst = worst._replace(radius=float(radius[at]), phase=float(phases[at]), p=p[at], v=v[at], hand=hand)
    return worst._replace(strongest=strongest, abrupt=tuple(abrupt))


def _is_reachable(river: CertifiedRiver, place: Array) -> bool:
    """Whether the device reaches a position [m]."""
    try:
        river.device.angles(place)
    except ValueError:  # base class of the errors of devices
        return False
    return True
