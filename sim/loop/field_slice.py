"""The force field sampled at many points, for display; the field's memory is left unchanged."""

import numpy as np
from numba import njit

from controllers.fields.program import evaluate
from controllers.state import HAND_POSITION, HAND_SWITCH, Array
from sim.compilation.compiled import entry_point
from sim.loop.servo import Field


@njit
def _wrench_at(field: Field, scratch: Array, hand: Array, wrench: Array) -> None:
    scratch[:] = field.memory
    evaluate(field.units, field.ops, field.params, scratch, hand, wrench)


@entry_point
def field_slice(field: Field, hand: Array, points: Array, scratch: Array, forces: Array) -> None:
    """Force of a field on the hand if it were at given points, with the switch released.

    Parameters
    ----------
    field : Field
        Its memory is copied for each point and left unchanged.
    hand : Array
        The hand vector (15,); its position and switch are overwritten.
    points : Array
        Positions in H [m], shape (n, 3).
    scratch : Array
        Work space of the same shape as the field's memory.
    forces : Array
        Written [N], shape (n, 3).
    """
    wrench = np.zeros(6)
    hand[HAND_SWITCH] = 0.0
    for i in range(points.shape[0]):
        for k in range(3):
            hand[HAND_POSITION + k] = points[i, k]
        _wrench_at(field, scratch, hand, wrench)
        for k in range(3):
            forces[i, k] = wrench[k]
