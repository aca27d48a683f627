"""Imports go one way: no file, and no folder, is reached from what it imports."""

import ast
import graphlib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("models", "controllers", "sim", "experiments")


def imports() -> dict[str, set[str]]:
    """Files of the packages by path, and what each imports of them, also within functions."""
    files = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py")] + [ROOT / "hvf.py"]
    modules = {".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path for path in files}
    graph: dict[str, set[str]] = {}
    for path in files:
        names: list[str] = []
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                inner = [f"{node.module}.{alias.name}" for alias in node.names]
                names += [name for name in inner if name in modules] or [node.module]
            elif isinstance(node, ast.Import):
                names += [alias.name for alias in node.names]
        found = {str(modules[name].relative_to(ROOT)) for name in names if name in modules}
        graph[str(path.relative_to(ROOT))] = found - {str(path.relative_to(ROOT))}
    return graph


def by_folder(graph: dict[str, set[str]]) -> dict[str, set[str]]:
    """Rooms: folders without folders in them; a file beside folders, such as the errors of a package, is one itself."""
    inner = {str(Path(file).parent.parent) for file in graph}

    def room(file: str) -> str:
        folder = str(Path(file).parent)
        return file if folder in inner else folder

    rooms: dict[str, set[str]] = {}
    for file, found in graph.items():
        rooms.setdefault(room(file), set()).update(room(other) for other in found)
    return {name: found - {name} for name, found in rooms.items()}


@pytest.mark.parametrize("view", [lambda graph: graph, by_folder], ids=["files", "folders"])
def test_no_circle_of_imports(view) -> None:
    graph = view(imports())
    assert len(graph) > 20
    try:
        tuple(graphlib.TopologicalSorter(graph).static_order())
    except graphlib.CycleError as error:
        pytest.fail(" imports ".join(error.args[1]))


def test_a_circle_would_be_found() -> None:
    graph = imports() | {"models/errors.py": {"models/scene.py"}}
    with pytest.raises(graphlib.CycleError):
        tuple(graphlib.TopologicalSorter(graph).static_order())
