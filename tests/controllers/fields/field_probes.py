"""Shared helpers of field tests: evaluation in a compiled loop, search for jumps, a mass in a field."""

import numpy as np
from numba import njit

from controllers.fields.algebra.program import evaluate
from controllers.fields.algebra.walker_feed import feed_walkers
from controllers.state import HandState


@njit
def run_over(units, ops, params, memory, hands, wrenches):
    for i in range(len(hands)):
        evaluate(units, ops, params, memory, hands[i], wrenches[i])


@njit
def glide(units, ops, params, memory, mass, period, push, path, velocity):
    """Simulate a mass in a field from path[0] at velocity[0], with an external force at each tick."""
    hand, wrench = np.zeros(15), np.zeros(6)
    hand[4] = 1.0
    for k in range(len(path) - 1):
        hand[0], hand[1:4], hand[8:11] = k * period, path[k], velocity[k]
        evaluate(units, ops, params, memory, hand, wrench)
        velocity[k + 1] = velocity[k] + period / mass * (wrench[:3] + push[k])
        path[k + 1] = path[k] + period * velocity[k + 1]


def force_of(program, hand):
    """Force at the first tick of a run."""
    memory, wrenches = program.fresh_memory(), np.empty((1, 6))
    feed_walkers(program.fresh_walkers(), program.params, memory, hand.vector())
    run_over(*program.compiled(), memory, hand.vector()[None], wrenches)
    return wrenches[0, :3]


def mass_in(program, start, velocity, push, mass=0.1, period=1e-3):
    """Path of a mass in a field and the final memory of the program."""
    path, speed = np.zeros((len(push), 3)), np.zeros((len(push), 3))
    path[0], speed[0] = start, velocity
    memory = program.fresh_memory()
    glide(*program.compiled(), memory, mass, period, push, path, speed)
    return path, memory


def largest_jump(program, start, end, v=(0.0, 0.0, 0.0), t=0.0, samples=400, hunts=4):
    """Largest jump of the force along a line, by bisection of the intervals in which it changes most."""
    start, end = np.asarray(start, float), np.asarray(end, float)

    def force(s):
        return force_of(program, HandState.at(start + s * (end - start), v, t))

    shares = np.linspace(0.0, 1.0, samples + 1)
    values = np.array([force(s) for s in shares])
    steps = np.linalg.norm(np.diff(values, axis=0), axis=1)
    # Where the slope changes most a jump hides, not only where the slope is largest.
    bends = np.abs(np.diff(steps, prepend=steps[0])) + np.abs(np.diff(steps, append=steps[-1]))
    worst = 0.0
    for k in {*np.argsort(steps)[-hunts:], *np.argsort(bends)[-hunts:]}:
        low, high, a, b = shares[k], shares[k + 1], values[k], values[k + 1]
        while (high - low) * np.linalg.norm(end - start) > 1e-13:
            middle = 0.5 * (low + high)
            m = force(middle)
            if np.linalg.norm(m - a) > np.linalg.norm(b - m):
                high, b = middle, m
            else:
                low, a = middle, m
        worst = max(worst, float(np.linalg.norm(b - a)))
    return worst
