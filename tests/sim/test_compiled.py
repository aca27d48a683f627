"""Hash of all sources, by which certificates name the program: other after any change."""

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


def test_the_hash_stays_the_same_while_the_sources_do(sources: Path) -> None:
    assert compiled.source_hash() == compiled.source_hash()


@pytest.mark.slow
def test_a_change_in_any_source_is_another_hash(sources: Path) -> None:
    """Every file that holds a kernel, and every other file beside it, is part of the key."""
    seen = {compiled.source_hash()}
    files = [path for package in PACKAGES for path in sorted((sources / package).rglob("*.py"))]
    assert len(files) > 30
    for path in files:
        path.write_text(path.read_text(encoding="utf-8") + "\n# changed\n", encoding="utf-8")
        found = compiled.source_hash()
        assert found not in seen, path
        seen.add(found)


def test_a_renamed_source_is_another_hash(sources: Path) -> None:
    before = compiled.source_hash()
    (sources / "controllers" / "easing.py").rename(sources / "controllers" / "ease.py")
    assert compiled.source_hash() != before
