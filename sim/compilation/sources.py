"""The code that a module reaches by imports, within this project, and hashes of it.

Comments and docstrings do not count, so a change of wording does not invalidate a cached result.
"""

import ast
import hashlib
import json
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path

import llvmlite.binding

from geometry.whole_files import atomic_file
from sim.compilation.unit_cache import cache_folder

_ROOT = Path(__file__).resolve().parents[2]
_PACKAGES = ("geometry", "models", "controllers", "sim", "experiments")
_LIBRARIES = ("casadi", "mujoco", "numba", "numpy", "scipy")


def results_folder(module: str) -> Path:
    """Cache folder for results computed by a module of the project; it changes with the code that they depend on."""
    return cache_folder() / sources_hash(module)[:16]


@cache
def sources_hash(module: str) -> str:
    """Hash of the code that a module reaches by imports, of the libraries and the processor.

    Parameters
    ----------
    module : str
        Dotted name of a module of the project.

    Returns
    -------
    str
        Hexadecimal digits.
    """
    code_hashes = reached_code(module)
    libraries = [f"{library} {version(library)}" for library in _LIBRARIES]
    # Rounding in libraries depends on the processor's instructions.
    processor = [llvmlite.binding.get_host_cpu_name(), llvmlite.binding.get_host_cpu_features().flatten()]
    text = "\n".join([*(f"{name} {code_hashes[name]}" for name in sorted(code_hashes)), *libraries, *processor])
    return hashlib.sha256(text.encode()).hexdigest()


def reached_code(module: str) -> dict[str, str]:
    """Hash of the code of a module, and of each that it reaches by imports within the project, by name."""
    hashes = _CodeHashes(cache_folder() / "code.json")
    code_hashes: dict[str, str] = {}
    pending = [module]
    while pending:
        name = pending.pop()
        if name in code_hashes or (path := _module_file(name)) is None:
            continue
        code_hashes[name], imported = hashes.read(path)
        pending += imported
    hashes.save()
    return code_hashes


class _CodeHashes:
    """A cache of hashes and imports of files, by modification time and size, since parsing all of them is slow.

    Parameters
    ----------
    file : Path
        File of the cache; it may be missing.
    """

    def __init__(self, file: Path):
        self._file, self._changed = file, False
        self._entries: dict[str, tuple[list[int], str, list[str]]] = {}
        with suppress(OSError, ValueError, TypeError):
            self._entries = dict(json.loads(file.read_text(encoding="utf-8")))

    def read(self, path: Path) -> tuple[str, list[str]]:
        """Hash of a file's code, and the names that it imports."""
        stamp = [path.stat().st_mtime_ns, path.stat().st_size]
        entry = self._entries.get(str(path))
        if entry is None or entry[0] != stamp:
            tree = ast.parse(path.read_bytes())
            code = ast.dump(_DocstringRemover().visit(tree)).encode()
            entry = stamp, hashlib.sha256(code).hexdigest(), list(_imported_names(tree))
            self._entries[str(path)], self._changed = entry, True
        return entry[1], entry[2]

    def save(self) -> None:
        """Write new entries to the file; a folder that cannot be written to is ignored."""
        if not self._changed:
            return
        with suppress(OSError):
            self._file.parent.mkdir(parents=True, exist_ok=True)
            entries = {path: entry for path, entry in self._entries.items() if Path(path).exists()}
            with atomic_file(self._file) as file:
                file.write(json.dumps(entries).encode())


def _module_file(name: str) -> Path | None:
    if name.partition(".")[0] not in _PACKAGES:
        return None
    path = _ROOT.joinpath(*name.split("."))
    return next((file for file in (path.with_suffix(".py"), path / "__init__.py") if file.is_file()), None)


class _DocstringRemover(ast.NodeTransformer):
    """Removes docstrings, and other strings that stand alone as statements."""

    def visit_Expr(self, node: ast.Expr) -> ast.Expr | None:
        return None if isinstance(node.value, ast.Constant) and isinstance(node.value.value, str) else node


def _imported_names(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
