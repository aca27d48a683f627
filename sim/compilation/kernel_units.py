"""Kernels compiled one by one, kept on disk, and called by their address.

The servo's loop knows the arguments of a kernel, not the kernel (see `controllers.kernel_call`): a run compiles the
laws of force and the kinds of map that it uses, each once for each version of the code. A unit is compiled from the
very function that Python calls.
"""

from collections.abc import Callable, Iterable
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import types

from controllers.fields.instructions import LAW_ARGUMENTS
from controllers.fields.law import Program
from controllers.haptic_map.evaluate import MAP_ARGUMENTS, MAP_KERNELS, kinds_of
from controllers.kernel_call import address_of
from sim.compilation.compiled import entry_point

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


def map_units(maps: Iterable[tuple[int, Array]]) -> IntArray:
    """Addresses of the kernels that maps need, by kind; 0 for the others. Compiles what has not been yet.

    Parameters
    ----------
    maps : iterable of (int, Array)
        Kind and parameters of each map.
    """
    units = np.zeros(max(MAP_KERNELS) + 1, dtype=np.int64)
    for kind, params in maps:
        for needed in kinds_of(kind, params):
            units[needed] = _address(MAP_KERNELS[needed], MAP_ARGUMENTS)
    return units


def law_units(program: Program) -> IntArray:
    """Addresses of the kernels of a field's laws, in their order; likewise."""
    return np.array([_law_address(kernel) for kernel in program.kernels], dtype=np.int64)


def is_kept(kernel: Callable[..., None]) -> bool:
    """Whether a law's kernel is kept on disk: not one about a function of the user's, a change of which goes unseen."""
    return not getattr(kernel, "py_func").__closure__  # noqa: B009 - a dispatcher


def _law_address(kernel: Callable[..., None]) -> int:
    return (_address if is_kept(kernel) else address_of)(kernel, LAW_ARGUMENTS)


_alive: list[Any] = []  # compiled units: their code must outlive every address


@cache
def _address(kernel: Callable[..., None], arguments: tuple[Any, ...]) -> int:
    unit: Any = entry_point(getattr(kernel, "py_func"))  # noqa: B009 - a dispatcher, which pyright takes for a function
    _alive.append(unit)
    compiled = unit.get_compile_result(types.void(*arguments))
    return int(compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name))
