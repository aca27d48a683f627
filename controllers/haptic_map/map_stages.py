"""Haptic maps in the form of the compiled tick: kernels that are called one after the other by their addresses.

A map's own kernel writes the pose; each map around it adds a kernel that changes the pose. All have the same signature,
so only kernels that are used are compiled, each alone, and a new one needs no entry anywhere.
"""

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np
from numba import njit, types

from controllers.errors import ControllerError, ParameterError
from controllers.kernel_call import kernel_call, register_kernel
from controllers.work_array import work_array
from geometry.arrays import Array, IntArray

Kernel: TypeAlias = Callable[[Array, Array, Array, Array, Array], None]
"""Compiled function (params, x, memory, pose, jacobian) of a map; writes or changes h(x), and h_*(x) unless empty."""

_VECTOR = types.Array(types.float64, 1, "C")
MAP_ARGUMENTS = (_VECTOR, _VECTOR, _VECTOR, _VECTOR, types.Array(types.float64, 2, "C"))
"""Types of a kernel's arguments: params, x, memory, pose, jacobian."""

_KERNEL, _END, _ADDRESS = range(3)
_call_kernel = kernel_call(MAP_ARGUMENTS)
_registered_kernels: list[Kernel] = []  # in this process, in the order in which the map classes were defined


def register(kernel: Kernel) -> None:
    """Register a kernel, an ``njit`` function, for use in maps; `HapticMap` registers that of every class.

    Raises
    ------
    ParameterError
        If it is not compiled by numba.
    """
    if not hasattr(kernel, "py_func"):
        raise ParameterError(f"the kernel of a map is {kernel!r}; expected a function compiled by numba's njit")
    if kernel not in _registered_kernels:
        register_kernel(kernel, MAP_ARGUMENTS)
        _registered_kernels.append(kernel)


class CompiledMap(NamedTuple):
    """A map in the form that the servo evaluates (see `evaluate_map`).

    Attributes
    ----------
    stages : IntArray, shape (n, 3)
        Kernels in the order of their calls. Columns: number of the kernel (`kernels_of`), end of its parameters (which
        begin where those of the stage before end), and its address, 0 until it is `linked`.
    params : Array
        Parameters of all stages.
    memory : Array
        State of the map between ticks, at the start of a run.
    size : float
        Ratio of the lengths of the figure shown to those of the figure of its clips [1].
    """

    stages: IntArray
    params: Array
    memory: Array
    size: float = 1.0

    @classmethod
    def of(cls, kernel: Kernel, params: Array, memory: Array) -> "CompiledMap":
        """A map of one kernel."""
        return cls(np.zeros((0, 3), dtype=np.int64), np.zeros(0), memory).followed_by(kernel, params)

    def followed_by(self, kernel: Kernel, params: Array) -> "CompiledMap":
        """The map whose pose is changed by one more kernel."""
        row = np.array([[_registered_kernels.index(kernel), len(self.params) + len(params), 0]], dtype=np.int64)
        return self._replace(stages=np.concatenate([self.stages, row]), params=np.concatenate([self.params, params]))


def kernels_of(stages: IntArray) -> tuple[Kernel, ...]:
    """Kernels of the stages of a map, in the order of their calls."""
    return tuple(_registered_kernels[number] for number in stages[:, _KERNEL])


def linked(stages: IntArray, address: Callable[[Kernel], int]) -> IntArray:
    """The same stages with the addresses of their kernels."""
    result = stages.copy()
    result[:, _ADDRESS] = [address(kernel) for kernel in kernels_of(stages)]
    return result


@njit
def first_params(stages: IntArray, params: Array) -> Array:
    """Parameters of the first stage: those of the innermost map."""
    return params[: stages[0, _END]]


@njit
def evaluate_map_jacobian(
    stages: IntArray, params: Array, x: Array, memory: Array, pose: Array, jacobian: Array
) -> None:
    """Pose h(x) and derivative h_*(x); arguments as in `evaluate_map`, and `jacobian`, shape (nv, 6), written."""
    first = 0
    for n in range(stages.shape[0]):
        if stages[n, _ADDRESS] == 0:
            raise ControllerError("a kernel of this haptic map is not compiled; its stages are not linked")
        end = stages[n, _END]
        _call_kernel(stages[n, _ADDRESS], (params[first:end], x, memory, pose, jacobian))
        first = end


@njit
def evaluate_map(stages: IntArray, params: Array, x: Array, memory: Array, pose: Array) -> None:
    """Pose h(x).

    Parameters
    ----------
    stages, params, memory
        See `CompiledMap`; the memory is updated.
    x : Array, shape (7,)
        Stylus pose: p_H [m], R_H (quaternion wxyz).
    pose : Array, shape (nq,)
        Written.

    Raises
    ------
    ControllerError
        If a stage has no address.
    """
    evaluate_map_jacobian(stages, params, x, memory, pose, work_array((0, 6)))
