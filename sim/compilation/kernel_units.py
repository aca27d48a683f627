"""Compilation units of single kernels: laws of force and haptic maps, cached on disk and called by address.

The servo's loop depends only on the argument types of a kernel, not on the kernel (see `controllers.kernel_call`): a
run compiles the laws and maps that it uses, each once per version of its code. A unit is compiled from the same
function that Python calls.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from controllers.fields.algebra.instructions import LAW_ARGUMENTS
from controllers.fields.algebra.law import Program
from controllers.fields.algebra.program import evaluate
from controllers.fields.algebra.walker_feed import Walkers
from controllers.haptic_map.map_stages import MAP_ARGUMENTS, kernels_of, linked
from controllers.kernel_call import add_kernel_listener, address_of
from controllers.walking.walking import Walking, follow_hand
from geometry.arrays import IntArray
from sim.compilation.compiled import keep_on_disk
from sim.compilation.units import Unit

keep_on_disk(evaluate)  # calls of `evaluate` from Python use its cached unit


def linked_stages(stages: IntArray) -> IntArray:
    """Stages of a map with the addresses of their kernels. Compiles those that are not in the cache."""
    return linked(stages, lambda kernel: _kernel_address(kernel, MAP_ARGUMENTS))


def law_units(program: Program) -> IntArray:
    """Addresses of the kernels of a field's laws, in order. Compiles those that are not in the cache."""
    return np.array([_kernel_address(kernel, LAW_ARGUMENTS) for kernel in program.kernels], dtype=np.int64)


def linked_walkers(walkers: Walkers) -> Walkers:
    """The walkers of a field with the address of their kernel; compiles it if it is not in the cache."""
    return walkers.linked(_kernel_address(follow_hand, LAW_ARGUMENTS)) if len(walkers.feeds) else walkers


def is_cacheable(kernel: Callable[..., None]) -> bool:
    """Whether a kernel is cached on disk as a unit: not if it is a closure over a user-defined function."""
    return not getattr(kernel, "py_func").__closure__  # noqa: B009 - a dispatcher


@add_kernel_listener
def _cache_kernel(kernel: Any, arguments: tuple[Any, ...]) -> None:
    if arguments in (LAW_ARGUMENTS, MAP_ARGUMENTS) and is_cacheable(kernel):
        keep_on_disk(kernel)


def units_of_map(stages: IntArray) -> tuple[Unit, ...]:
    """Compilation units that the stages of maps need, except those of user-defined functions."""
    kernels = dict.fromkeys(kernels_of(stages))
    return tuple(Unit.of(kernel, *MAP_ARGUMENTS) for kernel in kernels if is_cacheable(kernel))


def units_of_laws(program: Program) -> tuple[Unit, ...]:
    """Compilation units of the laws of a field and of its walkers, except those of user-defined functions."""
    walker = (follow_hand,) if any(isinstance(feed.source, Walking) for feed in program.feeds) else ()
    return tuple(Unit.of(kernel, *LAW_ARGUMENTS) for kernel in (*program.kernels, *walker) if is_cacheable(kernel))


def _kernel_address(kernel: Callable[..., None], arguments: tuple[Any, ...]) -> int:
    return Unit.of(kernel, *arguments).address() if is_cacheable(kernel) else address_of(kernel, arguments)
