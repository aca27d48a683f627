"""How the functions of ``sim`` that Python calls are compiled, and where what they need is kept between processes.

Kernels of ``models`` and ``controllers`` are compiled as parts of units: the entry points here, and the kernels that
are called by their address (see `sim.compilation.kernel_units`). A unit is kept under a key of what it is made of
(`sim.compilation.unit_key`, `sim.compilation.unit_cache`), so no stale one is ever run, and none is made again for a
change that it does not depend on.
"""

import hashlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import llvmlite
import llvmlite.binding
import mujoco
import numba
from numba import njit

from sim.compilation import unit_cache
from sim.compilation.deferred_codegen import install

_ROOT = Path(__file__).resolve().parents[2]
_KERNEL_PACKAGES = ("models", "controllers", "sim")
_Function = TypeVar("_Function", bound=Callable[..., object])

install()


def source_hash() -> str:
    """Hash of all kernel sources, and of the versions and the processor that compiled code is for, 16 hex digits."""
    digest = hashlib.sha256()
    digest.update(f"{sys.version} {numba.__version__} {llvmlite.__version__} {mujoco.__version__}".encode())
    binding = llvmlite.binding
    digest.update(f"{binding.get_host_cpu_name()} {binding.get_host_cpu_features().flatten()}".encode())
    for package in _KERNEL_PACKAGES:
        for path in sorted((_ROOT / package).rglob("*.py")):
            digest.update(path.relative_to(_ROOT).as_posix().encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def entry_point(function: _Function) -> _Function:
    """Compile without the GIL and keep on disk: for the few functions of ``sim`` that are called from Python."""
    compiled: Any = njit(nogil=True)(function)
    compiled._cache = unit_cache.UnitCache(function, compiled.targetoptions)
    return cast(_Function, compiled)
