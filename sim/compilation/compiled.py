"""Compilation of the functions of ``sim`` that Python calls, with a cache on disk.

Kernels of ``models`` and ``controllers`` are compiled as parts of compilation units: the entry points of ``sim``, and
kernels that are called by address (see `sim.compilation.kernel_units`). A unit is cached under a key of everything that
its code depends on (`sim.compilation.unit_key`, `sim.compilation.unit_cache`), so a stale unit is never run, and none
is recompiled for a change that it does not depend on.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

from sim.compilation import unit_cache
from sim.compilation.deferred_codegen import install

_Function = TypeVar("_Function", bound=Callable[..., object])

install()


def entry_point(function: _Function) -> _Function:
    """Compile a function to run without the GIL, cached on disk: for functions of ``sim`` that Python calls."""
    compiled = cast(_Function, njit(nogil=True)(function))
    keep_on_disk(compiled)
    return compiled


def keep_on_disk(compiled: Any) -> None:
    """Cache a numba function on disk, so that it is compiled once, whether called by Python or by address."""
    if not isinstance(compiled._cache, unit_cache.UnitCache):
        compiled._cache = unit_cache.UnitCache(compiled.py_func, compiled.targetoptions)
