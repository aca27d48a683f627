"""Hash of a module's sources: changes with the code that the module reaches, and with nothing else."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from sim.compilation import sources
from sim.compilation.sources import sources_hash

MODULE = "controllers.haptic_map.cylindrical"


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    root = Path(sources.__file__).parents[2]
    for package in ("geometry", "models", "controllers"):
        shutil.copytree(root / package, tmp_path / package, ignore=shutil.ignore_patterns("*.bvh", "__pycache__"))
    monkeypatch.setattr(sources, "_ROOT", tmp_path)
    monkeypatch.setenv("HVF_CACHE_DIR", str(tmp_path / "cache"))
    yield tmp_path
    sources_hash.cache_clear()


def fresh_hash() -> str:
    sources_hash.cache_clear()
    return sources_hash(MODULE)


def hash_after_edit(tree: Path, name: str, text: str) -> str:
    with (tree / name).open("a", encoding="utf-8") as file:
        file.write(text)
    return fresh_hash()


def test_change_in_a_direct_or_transitive_import_changes_the_hash(tree: Path) -> None:
    before = fresh_hash()
    after_own_edit = hash_after_edit(tree, "controllers/haptic_map/cylindrical.py", "\nAGAIN = 1\n")
    assert after_own_edit != before
    assert hash_after_edit(tree, "geometry/rotations.py", "\nAGAIN = 1\n") != after_own_edit


def test_comments_docstrings_and_unrelated_modules_leave_the_hash(tree: Path) -> None:
    before = fresh_hash()
    assert hash_after_edit(tree, "controllers/haptic_map/cylindrical.py", "\n# a comment\n") == before
    assert hash_after_edit(tree, "geometry/rotations.py", '\n"""Words that stand alone."""\n') == before
    assert hash_after_edit(tree, "controllers/safety/thermal.py", "\nAGAIN = 1\n") == before


@pytest.mark.slow
def test_hash_is_the_same_with_a_stored_corrupt_or_missing_cache_file(tree: Path) -> None:
    first = fresh_hash()
    (cache_file,) = (tree / "cache").rglob("code.json")
    assert fresh_hash() == first
    for invalid in ("[1, 2", "7.5", "[[1]]"):
        cache_file.write_text(invalid, encoding="utf-8")
        assert fresh_hash() == first
    cache_file.unlink()
    assert fresh_hash() == first
