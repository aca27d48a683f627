"""Kernels compiled one by one, kept on disk, and called by their address.

The servo's loop knows the arguments of a kernel, not the kernel (see `controllers.kernel_call`): a run compiles the
laws of force and the kinds of map that it uses, each once for each version of the code. A unit is compiled from the
very function that Python calls.
"""

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from controllers.fields.program import LAW_ARGUMENTS, LAW_KERNELS
from controllers.haptic_map.evaluate import MAP_ARGUMENTS, MAP_KERNELS, kinds_of
from sim.compilation.units import Unit

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
            units[needed] = _map_unit(needed).address()
    return units


def law_units(ops: IntArray) -> IntArray:
    """Addresses of the kernels that the instructions (n, 4) of a field need, by opcode; likewise."""
    units = np.zeros(max(LAW_KERNELS) + 1, dtype=np.int64)
    for opcode in ops[:, 0].tolist():
        if opcode in LAW_KERNELS:
            units[opcode] = _law_unit(opcode).address()
    return units


def units_of_map(kind: int, params: Array) -> tuple[Unit, ...]:
    """Units that a map needs."""
    return tuple(_map_unit(needed) for needed in kinds_of(kind, params))


def units_of_laws(ops: IntArray) -> tuple[Unit, ...]:
    """Units that the instructions (n, 4) of a field need, each once."""
    return tuple(_law_unit(opcode) for opcode in sorted(set(ops[:, 0].tolist()) & LAW_KERNELS.keys()))


def _map_unit(kind: int) -> Unit:
    return Unit.of(MAP_KERNELS[kind], *MAP_ARGUMENTS)


def _law_unit(opcode: int) -> Unit:
    return Unit.of(LAW_KERNELS[opcode], *LAW_ARGUMENTS)
