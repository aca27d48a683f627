"""No import cycles among files and folders; the folders of tests mirror those of the packages."""

import ast
import graphlib
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("geometry", "models", "controllers", "sim", "experiments", "tools")


@cache
def imports() -> dict[str, set[str]]:
    """Imports of each file of the packages from other ones, also those within functions."""
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
    """Imports between rooms: the folders that directly contain files."""
    rooms: dict[str, set[str]] = {}
    for file, found in graph.items():
        rooms.setdefault(str(Path(file).parent), set()).update(str(Path(other).parent) for other in found)
    return {name: found - {name} for name, found in rooms.items()}


@pytest.mark.parametrize("view", [lambda graph: graph, by_folder], ids=["files", "folders"])
def test_no_import_cycles(view) -> None:
    graph = view(imports())
    assert len(graph) > 20
    try:
        tuple(graphlib.TopologicalSorter(graph).static_order())
    except graphlib.CycleError as error:
        pytest.fail(" imports ".join(error.args[1]))


@pytest.mark.parametrize(
    ("view", "file", "imported"),
    [
        (dict, "models/errors.py", "models/world/scene.py"),
        (by_folder, "models/mocap/motion/ranges.py", "models/mocap/readers/motion_file.py"),
        (by_folder, "models/mocap/motion/ranges.py", "models/mocap/library.py"),
    ],
)
def test_added_import_that_closes_a_cycle_is_detected(view, file: str, imported: str) -> None:
    graph = imports()
    assert {file, imported} <= graph.keys()
    with pytest.raises(graphlib.CycleError):
        tuple(graphlib.TopologicalSorter(view(graph | {file: graph[file] | {imported}})).static_order())


def test_folders_of_tests_mirror_the_packages() -> None:
    test_folders = {
        path.parent.relative_to(ROOT / "tests")
        for package in PACKAGES
        for path in (ROOT / "tests" / package).rglob("*.py")
    }
    package_folders = {path.parent.relative_to(ROOT) for package in PACKAGES for path in (ROOT / package).rglob("*.py")}
    assert len(test_folders) > 20
    assert not test_folders - package_folders, "folders of tests without a folder of that name in the packages"
