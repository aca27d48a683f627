"""The evaluation of a haptic map, of whatever kind, in the compiled tick."""

import numpy as np
from numba import njit

from controllers.haptic_map.composite import COMPOSITE, composite_map
from controllers.haptic_map.cylindrical import CYLINDRICAL, cylindrical_map
from controllers.haptic_map.expressive import EXPRESSIVE, base_of, express
from controllers.haptic_map.led import LED, led_map
from controllers.haptic_map.lifted import LIFTED, lifted_map
from controllers.haptic_map.river_clips import RIVER_CLIPS, river_clips_map
from controllers.haptic_map.robot_arm import ROBOT_ARM, robot_arm_map
from controllers.state import Array


@njit
def _evaluate_one(kind: int, params: Array, x: Array, memory: Array, pose: Array, jacobian: Array) -> None:
    """A map that wraps no other."""
    if kind == CYLINDRICAL:
        cylindrical_map(params, x, memory, pose, jacobian)
    elif kind == COMPOSITE:
        composite_map(params, x, memory, pose, jacobian)
    elif kind == LIFTED:
        lifted_map(params, x, memory, pose, jacobian)
    elif kind == ROBOT_ARM:
        robot_arm_map(params, x, memory, pose, jacobian)
    elif kind == RIVER_CLIPS:
        river_clips_map(params, x, memory, pose, jacobian)
    elif kind == LED:
        led_map(params, x, memory, pose, jacobian)


@njit
def evaluate_map_jacobian(kind: int, params: Array, x: Array, memory: Array, pose: Array, jacobian: Array) -> None:
    """Pose h(x) and derivative h_*(x); arguments as in `evaluate_map`, and `jacobian`, shape (nv, 6), written."""
    base, numbers = base_of(kind, params)
    _evaluate_one(base, numbers, x, memory, pose, jacobian)
    if kind == EXPRESSIVE:
        express(params, x, pose, jacobian)


@njit
def evaluate_map(kind: int, params: Array, x: Array, memory: Array, pose: Array) -> None:
    """Pose h(x).

    Parameters
    ----------
    kind, params, memory
        Of a `CompiledMap`; the memory is updated.
    x : Array, shape (7,)
        Stylus pose: p_H [m], R_H (quaternion wxyz).
    pose : Array, shape (nq,)
        Written.
    """
    evaluate_map_jacobian(kind, params, x, memory, pose, np.empty((0, 6)))
