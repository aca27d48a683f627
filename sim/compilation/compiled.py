"""Where compiled code is kept between processes, so that no stale kernel is ever run.

numba notices a change only in the file of the function it cached, not in the files of the functions that one calls.
So the kernels of ``models`` and ``controllers`` are not cached by themselves; the entry points of ``sim`` are, with
everything they call linked in, in a folder named by a hash of every source file that can hold a kernel. Any change
there is another folder; copies of the same sources share one. What else takes long and depends on nothing but these
sources and its input may be kept there.
"""

import hashlib
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar, cast

import llvmlite
import llvmlite.binding
import mujoco
import numba
from numba import config, njit
from numba.core.caching import UserProvidedCacheLocator

_ROOT = Path(__file__).resolve().parents[2]
_KERNEL_PACKAGES = ("models", "controllers", "sim")
_Function = TypeVar("_Function", bound=Callable[..., object])


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


def cache_folder() -> Path:
    """Folder of the compiled code of these sources: under ``HVF_CACHE_DIR``, or the user's cache folder."""
    base = os.environ.get("HVF_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "hvf" / source_hash()


class SourceLocator(UserProvidedCacheLocator):
    """Where numba keeps the code of a function: by the place of its file within these sources.

    By numba's own choice, the absolute path, another copy of these sources would find this folder, and nothing in it.
    """

    @classmethod
    def get_suitable_cache_subpath(cls, py_file: str) -> str:
        """The file's folder, from the root of these sources on if it is one of those in the hash."""
        folder = Path(py_file).resolve().parent
        if not any(folder.is_relative_to(_ROOT / package) for package in _KERNEL_PACKAGES):
            return super().get_suitable_cache_subpath(py_file)
        return ".".join(folder.relative_to(_ROOT).parts)


CACHE_FOLDER = cache_folder()
config.CACHE_DIR = str(CACHE_FOLDER)  # pyright: ignore[reportAttributeAccessIssue]
config.CACHE_LOCATOR_CLASSES = f"{__name__}.{SourceLocator.__name__}"  # pyright: ignore[reportAttributeAccessIssue]


def entry_point(function: _Function) -> _Function:
    """Compile without the GIL and cache on disk: for the few functions of ``sim`` that are called from Python."""
    return cast(_Function, njit(nogil=True, cache=True)(function))


def is_cached() -> bool:
    """Whether these sources have been compiled on this machine before."""
    return any(CACHE_FOLDER.rglob("*.nbc"))
