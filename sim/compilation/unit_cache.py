"""The cache of compiled units on disk, one file per unit, named by the unit's key (`sim.compilation.unit_key`).

A file is written completely under another name and then renamed, so that concurrent writers do not conflict and no
process reads a partial file. It carries a hash of its contents; a file that is truncated, changed or cannot be loaded
is ignored. Units that were not used for a long time are removed.
"""

# pyright: reportPrivateUsage=false, reportIncompatibleMethodOverride=false
# The cache of a dispatcher is not public in numba; `deferred_codegen` lists the versions that were tested.

import os
import pickle
import time
import warnings
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

from numba.core import sigutils
from numba.core.caching import _Cache
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

from geometry.whole_files import read_hashed, write_hashed
from sim.compilation.deferred_codegen import is_nested, referred_by_name
from sim.compilation.unit_key import unit_key

_SUFFIX = ".unit"
_MAX_UNUSED_TIME = 60 * 86400.0  # [s] after which an unused unit is removed
_USE_TIME_RESOLUTION = 86400.0  # [s] resolution of the stored time of last use


def cache_folder() -> Path:
    """Folder of compiled units: under ``HVF_CACHE_DIR``, or the user's cache folder."""
    base = os.environ.get("HVF_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "hvf"


class UnitCache(_Cache):
    """The cache of a numba dispatcher: the units of one function, one per tuple of argument types.

    Parameters
    ----------
    function : callable
        The Python function.
    options : dict
        Options of its compilation.
    """

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]):
        self._function, self._options, self._enabled = function, options, True

    @property
    def cache_path(self) -> str:
        """Folder of all units."""
        return str(cache_folder())

    def path(self, signature: Any) -> Path:
        """Path of the unit for a signature or a tuple of types, whether it exists or not.

        Raises
        ------
        UnknownIngredient
            If no key can be computed.
        """
        arguments: Iterable[Any] = sigutils.normalize_signature(signature)[0]
        return cache_folder() / f"{self._name()}-{unit_key(self._function, arguments, self._options)}{_SUFFIX}"

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Load a compiled unit; None if it is not in the cache."""
        if not self._enabled or is_nested():
            return None
        target_context.refresh()
        path = self.path(sig)
        content = read_hashed(path)
        if content is None:
            return None
        try:
            compiled = CompileResult._rebuild(target_context, *pickle.loads(content))
        except Exception:  # unpickling an unusable file may raise anything
            return None
        _mark_used(path)
        return compiled

    def save_overload(self, sig: Any, data: Any) -> None:
        """Save a compiled unit; a folder that cannot be written to is ignored."""
        if not self._enabled or is_nested():
            return
        if data.lifted or data.library.has_dynamic_globals or referred_by_name(data.library._final_module):
            warnings.warn(f"{self._function.__qualname__} holds an address, so it cannot be kept", stacklevel=2)
            return
        content = dumps(data._reduce())
        path = self.path(sig)
        with suppress(OSError):
            write_hashed(path, content)
            remove_forgotten(path.parent)

    def enable(self) -> None:
        """Switch the cache on, for loading and saving."""
        self._enabled = True

    def disable(self) -> None:
        """Switch the cache off, for loading and saving."""
        self._enabled = False

    def flush(self) -> None:
        """Remove the units of this function, of all versions."""
        for path in cache_folder().glob(f"{self._name()}-*{_SUFFIX}"):
            path.unlink(missing_ok=True)

    def _name(self) -> str:
        return f"{self._function.__module__}.{self._function.__qualname__}".replace("<", "").replace(">", "")


def is_sound(path: Path) -> bool:
    """Whether a file exists and its hash is right."""
    return read_hashed(path) is not None


def remove_forgotten(folder: Path) -> None:
    """Remove the units of a folder that were neither written nor loaded for two months."""
    now = time.time()
    for path in folder.glob(f"*{_SUFFIX}*"):
        with suppress(OSError):
            if now - path.stat().st_mtime > _MAX_UNUSED_TIME:
                path.unlink()


def _mark_used(path: Path) -> None:
    with suppress(OSError):
        if time.time() - path.stat().st_mtime > _USE_TIME_RESOLUTION:
            os.utime(path)
