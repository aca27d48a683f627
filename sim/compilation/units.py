"""Units of compiled code: a function and the types of its arguments, by which any process can find or compile it."""

import importlib
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

from numba import types

from sim.compilation.compiled import entry_point
from sim.compilation.unit_cache import UnitCache, is_sound
from sim.errors import SimError


class Unit(NamedTuple):
    """A function compiled by itself, with all that it calls; may be sent to another process.

    Attributes
    ----------
    module, name : str
        Where the function is.
    arguments : tuple of numba types
        Of its arguments; it returns nothing.
    """

    module: str
    name: str
    arguments: tuple[Any, ...]

    @classmethod
    def of(cls, function: Callable[..., None], *arguments: Any) -> "Unit":
        """Unit of a function of a module, which may be one that is compiled for others already."""
        return cls(function.__module__, function.__qualname__, arguments)

    def is_kept(self) -> bool:
        """Whether it is on disk, compiled from what it would be compiled from now."""
        kept: Any = unit_function(self.module, self.name)
        return is_sound(kept._cache.path(self.arguments))

    def load(self) -> Any:
        """Result of its compilation, which happens if it is not kept."""
        return unit_function(self.module, self.name).get_compile_result(types.void(*self.arguments))

    def address(self) -> int:
        """Where its code is in this process, to be called with exactly these types (see `controllers.kernel_call`)."""
        compiled = self.load()
        return int(compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name))


@cache  # the code of what is in it outlives every address
def unit_function(module: str, name: str) -> Any:
    """The function compiled for calls from Python, and kept; from its own source, as every unit of it is.

    Raises
    ------
    SimError
        If it is not a compiled function of a module.
    """
    found: Any = getattr(importlib.import_module(module), name, None)
    if not hasattr(found, "py_func"):
        raise SimError(f"{module}.{name} is not a compiled function of a module; expected one that is")
    return found if isinstance(found._cache, UnitCache) else entry_point(found.py_func)
