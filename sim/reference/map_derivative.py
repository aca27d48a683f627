"""The derivative of a haptic map at one stylus pose, from Python, with the same compiled kernels as the servo."""

import numpy as np
from numba import types

from controllers.fields.algebra.instructions import VECTOR
from controllers.haptic_map.base import STYLUS_TANGENT, HapticMap
from controllers.haptic_map.map_stages import evaluate_map_jacobian
from geometry.arrays import Array, IntArray
from sim.compilation.compiled import entry_point
from sim.compilation.kernel_units import linked_stages
from sim.compilation.units import Unit


@entry_point
def _derivative(stages: IntArray, params: Array, x: Array, memory: Array, pose: Array, jacobian: Array) -> None:
    evaluate_map_jacobian(stages, params, x, memory, pose, jacobian)


def derivative_unit() -> Unit:
    """The compilation unit of `map_derivative`, without the map's kernels."""
    matrix, stages = types.Array(types.float64, 2, "C"), types.Array(types.int64, 2, "C")
    return Unit.of(_derivative, stages, VECTOR, VECTOR, VECTOR, VECTOR, matrix)


def map_derivative(haptic_map: HapticMap, x: Array) -> Array:
    """`HapticMap.jacobian` at a stylus pose (7,), bit for bit the same, by kernels from the compilation cache.

    Returns
    -------
    Array, shape (nv, 6)
    """
    stages, params, memory, _ = haptic_map.compiled()
    pose, jacobian = np.empty(haptic_map.nq), np.empty((haptic_map.nv, STYLUS_TANGENT))
    _derivative(linked_stages(stages), params, x, memory, pose, jacobian)
    return jacobian
