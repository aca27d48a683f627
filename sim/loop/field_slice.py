"""The force field sampled at many points, for display; the field's memory and walkers are left unchanged."""

import numpy as np
from numba import njit

from controllers.fields.algebra.program import evaluate
from controllers.fields.algebra.walker_feed import Walkers, feed_walkers
from controllers.state import HAND_POSITION, HAND_SWITCH
from geometry.arrays import Array
from sim.compilation.compiled import entry_point
from sim.loop.servo import Field


@njit
def _wrench_at(field: Field, hand: Array, wrench: Array) -> None:
    memory, walkers = field.memory.copy(), Walkers(field.walkers.feeds, field.walkers.state.copy())
    feed_walkers(walkers, field.params, memory, hand)
    evaluate(field.units, field.ops, field.params, memory, hand, wrench)


@entry_point
def field_slice(field: Field, hand: Array, points: Array, forces: Array) -> None:
    """Force of a field on the hand if it were at given points, with the switch released.

    Parameters
    ----------
    field : Field
        Its memory and walkers are copied for each point and left unchanged.
    hand : Array
        The hand vector (15,); its position and switch are overwritten.
    points : Array
        Positions in H [m], shape (n, 3).
    forces : Array
        Written [N], shape (n, 3).
    """
    wrench = np.zeros(6)
    hand[HAND_SWITCH] = 0.0
    for i in range(points.shape[0]):
        for k in range(3):
            hand[HAND_POSITION + k] = points[i, k]
        _wrench_at(field, hand, wrench)
        for k in range(3):
            forces[i, k] = wrench[k]
