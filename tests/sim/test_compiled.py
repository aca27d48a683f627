"""Hash of all sources, by which what is found with them is kept: other after any change."""

import shutil
from pathlib import Path

import pytest

from sim.compilation import compiled

PACKAGES = ("models", "controllers", "sim")


@pytest.fixture
def sources(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for package in PACKAGES:
        shutil.copytree(
            Path(compiled.__file__).parents[2] / package, tmp_path / package, ignore=shutil.ignore_patterns("*.bvh")
        )
    monkeypatch.setattr(compiled, "_ROOT", tmp_path)
    return tmp_path


def test_the_folder_stays_the_same_while_the_sources_do(sources: Path) -> None:
    assert compiled.cache_folder() == compiled.cache_folder()


def test_a_change_in_any_source_is_another_folder(sources: Path) -> None:
    """Every file that holds a kernel, and every other file beside it, is part of the key."""
    seen = {compiled.cache_folder()}
    files = [path for package in PACKAGES for path in sorted((sources / package).rglob("*.py"))]
    assert len(files) > 30
    for path in files:
        path.write_text(path.read_text(encoding="utf-8") + "\n# changed\n", encoding="utf-8")
        folder = compiled.cache_folder()
        assert folder not in seen, path
        seen.add(folder)


def test_a_renamed_source_is_another_folder(sources: Path) -> None:
    before = compiled.cache_folder()
    (sources / "controllers" / "easing.py").rename(sources / "controllers" / "ease.py")
    assert compiled.cache_folder() != before


def test_the_folder_can_be_chosen(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("HVF_CACHE_DIR", str(tmp_path))
    assert compiled.cache_folder().is_relative_to(tmp_path)
