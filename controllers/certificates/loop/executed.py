r"""Linearisation of an executed program of laws by finite differences, for laws that do not evaluate on symbols.

The torques τ(θ, ω) = J(θ)ᵀ F(p(θ), J(θ) ω) come from the compiled program itself; their derivatives are central
differences at a state of the hand, with memory and phase fixed. They replace the symbolic derivatives in `LinearLoop`.
This can refute stability but not prove it, since only the given states are examined.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from controllers.certificates.loop.hand import HandImpedance
from controllers.certificates.loop.linear_loop import LinearLoop
from controllers.certificates.loop.sampled_loop import SampledLoop
from controllers.certificates.loop.stability import River
from controllers.fields.algebra.law import Program
from controllers.fields.algebra.program import evaluate
from controllers.state import Array, HandState

_STEP = 1e-6  # [rad], [rad/s] of the differences
_SWINGS = 1e-2  # [rad per period] an eigenvalue of smaller angle is a drift, not an oscillation
_DIRECTIONS = 4  # transverse directions in which states off the curve are examined


class Seen(NamedTuple):
    """The worst of the examined states.

    Attributes
    ----------
    radius : float
        Spectral radius of a period there, over the oscillating modes.
    phase : float
        Phase of the curve [s].
    p, v : Array
        Position [m] and velocity [m/s] of the hand.
    hand : HandImpedance
        Hand on the stylus.
    states : int
        Number of examined states.
    strongest : float
        Largest force of the program at any of them [N].
    """

    radius: float
    phase: float
    p: Array
    v: Array
    hand: HandImpedance
    states: int
    strongest: float


def force_at(program: Program, memory: Array, p: Array, v: Array, t: float) -> Array:
    """F_H [N] of a program at a hand p [m], v [m/s] at time t [s], evaluated with a copy of the memory."""
    hand, wrench, own = HandState.at(p, v, t), np.empty(6), memory.copy()
    program.feed(own, hand)
    evaluate(*program.compiled(), own, hand.vector(), wrench)
    return wrench[:3].copy()


def differenced(linear: LinearLoop, program: Program, river: River, p: Array, v: Array) -> LinearLoop:
    """The linear loop of `river` with the program's derivatives at hands p, v (n, 3); use it with k_r = 1, b_d = 0.

    `linear` has the plant at the same phases; p and v need not be on the curve.
    """
    by_theta, by_omega = np.zeros((2, *linear.weight_theta.shape)), np.zeros((2, *linear.weight_theta.shape))
    numbers = river.device.numbers
    for i, (place, velocity, phase) in enumerate(zip(p, v, linear.phases, strict=True)):
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

        for k, step in enumerate(_STEP * np.eye(3)):
            by_theta[0, i, :, k] = (torque(theta + step, omega) - torque(theta - step, omega)) / (2.0 * _STEP)
            by_omega[0, i, :, k] = (torque(theta, omega + step) - torque(theta, omega - step)) / (2.0 * _STEP)
    return replace(linear, unit_theta=by_theta, unit_omega=by_omega)


def looked_at(
    program: Program, river: River, reach: float, hands: Sequence[HandImpedance], pace: float = 1.0, n: int = 16
) -> Seen:
    """The worst of states on the curve at rest and at `pace` times its own, and of states off it by `reach` [m]."""
    phases = river.phases(n)
    points, velocity = river.curve.point(phases), river.curve.velocity(phases)
    tangent = velocity / np.linalg.norm(velocity, axis=1, keepdims=True)
    plane = np.linalg.svd(tangent[:, None, :])[2][:, 1:, :]
    angles = 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    away = [reach * (np.cos(a) * plane[:, 0] + np.sin(a) * plane[:, 1]) for a in angles]
    states = [(points, 0.0 * velocity), *((points + off, pace * velocity) for off in (0.0 * points, *away))]
    plants = [(hand, river.still_at(phases, hand)) for hand in hands]
    worst, strongest = Seen(0.0, 0.0, points[0], velocity[0], hands[0], n * len(states), 0.0), 0.0
    for p, v in states:
        law = differenced(plants[0][1], program, river, p, v)
        fresh = program.fresh_memory()
        forces = [force_at(program, fresh, *of) for of in zip(p, v, phases.tolist(), strict=True)]
        strongest = max(strongest, float(np.linalg.norm(forces, axis=1).max()))
        for hand, plant in plants:
            loop = SampledLoop(replace(plant, unit_theta=law.unit_theta, unit_omega=law.unit_omega), river.sampling)
            values = np.linalg.eigvals(loop.frozen(1.0, 0.0))
            radius = np.where(np.abs(np.angle(values)) > _SWINGS, np.abs(values), 0.0).max(axis=1)
            at = int(radius.argmax())
            if radius[at] > worst.radius:
                worst = Seen(float(radius[at]), float(phases[at]), p[at], v[at], hand, n * len(states), 0.0)
    return worst._replace(strongest=strongest)
