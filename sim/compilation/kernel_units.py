"""Compilation units of single kernels: laws of force and haptic maps, cached on disk and called by address.

The servo's loop depends only on the argument types of a kernel, not on the kernel (see `controllers.kernel_call`): a
run compiles the laws and kinds of map that it uses, each once per version of its code. A unit is compiled from the same
function that Python calls.
"""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from controllers.fields.algebra.instructions import LAW_ARGUMENTS
from controllers.fields.algebra.law import Program
from controllers.fields.algebra.program import evaluate
from controllers.fields.algebra.walker_feed import Walkers
from controllers.haptic_map.evaluate import MAP_ARGUMENTS, MAP_KERNELS, kinds_of
from controllers.kernel_call import KEEPERS, address_of
from controllers.state import Array, IntArray
from controllers.walking.walking import follow_hand
from sim.compilation.compiled import keep_on_disk
from sim.compilation.units import Unit

for _kernel in (evaluate, *MAP_KERNELS.values()):  # what Python asks of a field or a map is answered by its unit
    keep_on_disk(_kernel)


def map_units(maps: Iterable[tuple[int, Array]]) -> IntArray:
    """Addresses of the kernels that maps need, by kind; 0 for the others. Compiles those that are not in the cache.

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


def law_units(program: Program) -> IntArray:
    """Addresses of the kernels of a field's laws, in order. Compiles those that are not in the cache."""
    addresses = [
        _law_unit(kernel).address() if is_kept(kernel) else address_of(kernel, LAW_ARGUMENTS)
        for kernel in program.kernels
    ]
    return np.array(addresses, dtype=np.int64)


def linked_walkers(walkers: Walkers) -> Walkers:
    """The walkers of a field with the address of their kernel; compiles it if it is not in the cache."""
    return walkers.linked(_law_unit(follow_hand).address()) if len(walkers.feeds) else walkers


def is_kept(kernel: Callable[..., None]) -> bool:
    """Whether a law's kernel is cached on disk as a unit: not if it is a closure over a user-defined function."""
    return not getattr(kernel, "py_func").__closure__  # noqa: B009 - a dispatcher


@KEEPERS.append
def _keep_law(kernel: Any, arguments: tuple[Any, ...]) -> None:
    if arguments == LAW_ARGUMENTS and is_kept(kernel):
        keep_on_disk(kernel)


def units_of_map(kind: int, params: Array) -> tuple[Unit, ...]:
    """Compilation units that a map needs."""
    return tuple(_map_unit(needed) for needed in kinds_of(kind, params))


def units_of_laws(program: Program) -> tuple[Unit, ...]:
    """Compilation units of the laws of a field and of its walkers, except those of user-defined functions."""
    walker = (follow_hand,) if program.walker_feeds else ()
    return tuple(_law_unit(kernel) for kernel in (*program.kernels, *walker) if is_kept(kernel))


def _map_unit(kind: int) -> Unit:
    return Unit.of(MAP_KERNELS[kind], *MAP_ARGUMENTS)


def _law_unit(kernel: Callable[..., None]) -> Unit:
    return Unit.of(kernel, *LAW_ARGUMENTS)
