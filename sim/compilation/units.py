"""Compilation units: a function and its argument types, by which any process can find it in the cache or compile it."""

import importlib
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

from numba import types

from sim.compilation.compiled import keep_on_disk
from sim.compilation.unit_cache import is_sound
from sim.errors import SimError


class Unit(NamedTuple):
    """A function that is compiled separately, together with all that it calls by name; may be sent to another process.

    Attributes
    ----------
    module, name : str
        Module and name of the function.
    arguments : tuple of numba types
        Types of its arguments; it returns nothing.
    """

    module: str
    name: str
    arguments: tuple[Any, ...]

    @classmethod
    def of(cls, function: Callable[..., None], *arguments: Any) -> "Unit":
        """Unit of a function of a module; the function may also be a part of other units."""
        return cls(function.__module__, function.__qualname__, arguments)

    def is_kept(self) -> bool:
        """Whether the cache holds it, compiled from the present code."""
        dispatcher: Any = unit_function(self.module, self.name)
        return is_sound(dispatcher._cache.path(self.arguments))

    def load(self) -> Any:
        """Its compilation result, from the cache or compiled now."""
        return unit_function(self.module, self.name).get_compile_result(types.void(*self.arguments))

    def address(self) -> int:
        """Address of its code in this process, to be called with exactly these types (`controllers.kernel_call`)."""
        compiled = self.load()
        return int(compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name))


@cache
def unit_function(module: str, name: str) -> Any:
    """The dispatcher of a unit's function, cached on disk.

    Raises
    ------
    SimError
        If it is not a compiled function of a module.
    """
    dispatcher: Any = getattr(importlib.import_module(module), name, None)
    if not hasattr(dispatcher, "py_func"):
        raise SimError(f"{module}.{name} is not a compiled function of a module; expected one that is")
    keep_on_disk(dispatcher)
    return dispatcher
