"""Evaluation of haptic maps of any kind in the compiled tick.

Every kind has a kernel with the same signature, called by its address, so only kernels that are used are compiled. The
addresses come from `sim.compilation.kernel_units`.
"""

from numba import njit, types

from controllers.errors import ControllerError
from controllers.haptic_map.base import Kernel
from controllers.haptic_map.composite import COMPOSITE, composite_map
from controllers.haptic_map.cylindrical import CYLINDRICAL, cylindrical_map
from controllers.haptic_map.expressive import EXPRESSIVE, base_of, express
from controllers.haptic_map.led import LED, led_map
from controllers.haptic_map.lifted_kernel import LIFTED, lifted_map
from controllers.haptic_map.own_map import OWN, own_map
from controllers.haptic_map.river_clips import RIVER_CLIPS, river_clips_map
from controllers.haptic_map.robot_arm import ROBOT_ARM, robot_arm_map
from controllers.haptic_map.sized import SIZED, size_pose, unsized
from controllers.kernel_call import kernel_call
from controllers.state import Array, IntArray
from controllers.work_array import work_array

MAP_KERNELS: dict[int, Kernel] = {
    CYLINDRICAL: cylindrical_map,
    COMPOSITE: composite_map,
    LIFTED: lifted_map,
    ROBOT_ARM: robot_arm_map,
    RIVER_CLIPS: river_clips_map,
    EXPRESSIVE: express,
    LED: led_map,
    OWN: own_map,
    SIZED: size_pose,
}
"""Kernels by kind; the kernel of a map that wraps another map modifies the output of the wrapped map's kernel."""

_VECTOR = types.Array(types.float64, 1, "C")
MAP_ARGUMENTS = (_VECTOR, _VECTOR, _VECTOR, _VECTOR, types.Array(types.float64, 2, "C"))
"""Types of a kernel's arguments: params, x, memory, pose, jacobian."""

_call = kernel_call(MAP_ARGUMENTS)


def kinds_of(kind: int, params: Array) -> tuple[int, ...]:
    """Kinds of kernels that a map needs: its own, and those of the maps that it wraps."""
    inner, given = unsized.py_func(kind, params)
    base, _ = base_of.py_func(inner, given)
    return tuple(dict.fromkeys((kind, inner, base)))


@njit
def evaluate_map_jacobian(
    units: IntArray, kind: int, params: Array, x: Array, memory: Array, pose: Array, jacobian: Array
) -> None:
    """Pose h(x) and derivative h_*(x); arguments as in `evaluate_map`, and `jacobian`, shape (nv, 6), written."""
    inner, given = unsized(kind, params)
    base, numbers = base_of(inner, given)
    if units[base] == 0 or units[inner] == 0 or units[kind] == 0:
        raise ControllerError("the kernel of this haptic map is not compiled; its kind is missing in the units")
    _call(units[base], (numbers, x, memory, pose, jacobian))
    if inner == EXPRESSIVE:
        _call(units[inner], (given, x, memory, pose, jacobian))
    if kind == SIZED:
        _call(units[kind], (params, x, memory, pose, jacobian))


@njit
def evaluate_map(units: IntArray, kind: int, params: Array, x: Array, memory: Array, pose: Array) -> None:
    """Pose h(x).

    Parameters
    ----------
    units : IntArray
        Addresses of compiled kernels by kind, 0 for those that are not compiled.
    kind, params, memory
        See `CompiledMap`; the memory is updated.
    x : Array, shape (7,)
        Stylus pose: p_H [m], R_H (quaternion wxyz).
    pose : Array, shape (nq,)
        Written.

    Raises
    ------
    ControllerError
        If the address of a kernel that the map needs is 0.
    """
    evaluate_map_jacobian(units, kind, params, x, memory, pose, work_array((0, 6)))
