"""Which sources a module is made of: its own, and those of the project that it imports, and so on."""

import ast
import hashlib
from collections.abc import Iterator
from functools import cache
from importlib.metadata import version
from pathlib import Path

import llvmlite.binding

from sim.compilation.unit_cache import cache_folder

_ROOT = Path(__file__).resolve().parents[2]
_PACKAGES = ("models", "controllers", "sim", "experiments")
_LIBRARIES = ("casadi", "mujoco", "numba", "numpy", "scipy")


def kept_folder(module: str) -> Path:
    """Folder for what a module of the project finds and what is found anew only after a change of its code."""
    return cache_folder() / sources_hash(module)[:16]


@cache
def sources_hash(module: str) -> str:
    """Hash of the code that a module reaches by imports, of the libraries and the machine; comments do not count.

    Parameters
    ----------
    module : str
        Dotted name of a module of the project.

    Returns
    -------
    str
        Hexadecimal digits.
    """
    found: dict[str, str] = {}
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name in found or (path := _file(name)) is None:
            continue
        tree = ast.parse(path.read_bytes())
        found[name] = ast.dump(tree)
        waiting += _imported(tree)
    libraries = [f"{library} {version(library)}" for library in _LIBRARIES]
    # Libraries round by the processor's own instructions.
    processor = [llvmlite.binding.get_host_cpu_name(), llvmlite.binding.get_host_cpu_features().flatten()]
    text = "\n".join([*(f"{name} {found[name]}" for name in sorted(found)), *libraries, *processor])
    return hashlib.sha256(text.encode()).hexdigest()


def _file(name: str) -> Path | None:
    if name.partition(".")[0] not in _PACKAGES:
        return None
    path = _ROOT.joinpath(*name.split("."))
    return next((file for file in (path.with_suffix(".py"), path / "__init__.py") if file.is_file()), None)


def _imported(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
