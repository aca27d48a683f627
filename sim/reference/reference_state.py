"""What the reference of the figure holds, and the poses of its map along the motion of the stylus."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from controllers.haptic_map.evaluate import evaluate_map
from controllers.state import Array
from sim.reference.stylus_filter import turned_on
from sim.reference.transition import Transition, carry_on

IntArray = npt.NDArray[np.int64]


class CompiledReference(NamedTuple):
    """State and scratch of the reference, as the servo loop holds it.

    Attributes
    ----------
    figure_model : int
        Address of the model of the figure alone, whose tangent space the reference lives in.
    smoothing : float
        θ = exp(−ω T) of the tracking filter, for the period T at which it runs.
    period : float
        T [s].
    units : IntArray
        Addresses of the map's kernels (see `sim.compilation.kernel_units`).
    kind, params, memory
        The haptic map and its state (the lap).
    hand : Array
        Smoothed position, velocity and acceleration of the hand in H, shape (3, 3).
    trail : Array
        Smoothed position one period ago, and two, shape (2, 3).
    going : Array
        Scratch: the hand with the rates at which its smoothed position goes, shape (3, 3).
    orientation, turning : Array
        Smoothed orientation R_H of the stylus (wxyz), shape (4,), and in its own frame ω and α, shape (2, 3).
    started : Array
        0 until the hand has been seen, shape (1,).
    pose, velocity, acceleration : Array
        What the figure should do, shapes (75,), (57,), (57,).
    transition : Transition
        From clip to clip, where rivers play clips of their own.
    clip_seconds : float
        Time of the clips [s] where flights that are held are let down to the floor (`sim.reference.settling`); 0:
        they are not.
    settled : Array
        Share by which they are, and its rates, shape (3,).
    """

    figure_model: int
    smoothing: float
    period: float
    units: IntArray
    kind: int
    params: Array
    memory: Array
    hand: Array
    trail: Array
    going: Array
    orientation: Array
    turning: Array
    started: Array
    pose: Array
    velocity: Array
    acceleration: Array
    transition: Transition
    clip_seconds: float
    settled: Array
    scratch_memory: Array
    scratch_x: Array
    before: Array
    after: Array
    to_before: Array
    to_after: Array


@njit(forceinline=True)
def look_around(reference: CompiledReference, hand: Array) -> None:
    """Poses of the map along a motion of the stylus: now, a period before and a period after; the memory is now's."""
    period, x = reference.period, reference.scratch_x
    x[:3], x[3:] = hand[0], reference.orientation
    evaluate_map(reference.units, reference.kind, reference.params, x, reference.memory, reference.pose)
    for sign, pose in ((-1.0, reference.before), (1.0, reference.after)):
        for i in range(3):
            x[i] = hand[0, i] + sign * period * hand[1, i] + 0.5 * period**2 * hand[2, i]
        x[3], x[4], x[5], x[6] = turned_on(reference.orientation, reference.turning, sign * period)
        reference.scratch_memory[:] = reference.memory
        evaluate_map(reference.units, reference.kind, reference.params, x, reference.scratch_memory, pose)


@njit(forceinline=True)
def follow_trail(reference: CompiledReference) -> None:
    """Rates of the smoothed hand by its own last positions: the filter's come after, where a hand is thrown."""
    now, trail, going, period = reference.hand[0], reference.trail, reference.going, reference.period
    for i in range(3):
        going[0, i] = now[i]
        going[1, i] = 0.5 * (3.0 * now[i] - 4.0 * trail[0, i] + trail[1, i]) / period
        going[2, i] = (now[i] - 2.0 * trail[0, i] + trail[1, i]) / period**2


@njit
def carry(reference: CompiledReference) -> None:
    """Move the three poses to what a transition shows."""
    if reference.transition.since[0] >= reference.transition.lasts[0]:
        return
    carry_on(reference.transition, 0.0, reference.pose)
    carry_on(reference.transition, -reference.period, reference.before)
    carry_on(reference.transition, reference.period, reference.after)
