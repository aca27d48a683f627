"""Units on disk: compiled once, shared between processes, and recompiled when damaged."""

import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from numba import njit

from geometry.whole_files import read_hashed, write_hashed
from sim.compilation import unit_cache
from sim.compilation.compiled import entry_point
from sim.compilation.unit_cache import is_sound, remove_forgotten

ROOT = Path(unit_cache.__file__).parent.parent
TOYS = Path(__file__).parent / "toy_kernels.py"

_LOAD = """
import numba
from numba import typeof, types
import toy_kernels as toys
from sim.compilation.units import Unit, unit_function
vector = types.Array(types.float64, 1, "C")
units = [
    Unit.of(toys.force, typeof(toys.Spring(1.0, 0.0)), types.float64, vector),
    Unit.of(toys.other, types.float64, vector),
]
for unit in units:
    unit.address()
print(*(sum(unit_function(u.module, u.name).stats.cache_misses.values()) for u in units))
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("HVF_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache" / "hvf"


def _kernel(gain: float):
    def double(x):
        return gain * x

    return entry_point(double)


def _compiled(kernel) -> int:
    return sum(kernel.stats.cache_misses.values())


def test_unit_is_compiled_once(folder: Path):
    first, second, other = _kernel(2.0), _kernel(2.0), _kernel(3.0)
    assert [first(4.0), second(4.0), other(4.0)] == [8.0, 8.0, 12.0]
    assert [_compiled(kernel) for kernel in (first, second, other)] == [1, 0, 1]
    assert len(list(folder.glob("*.unit"))) == 2


@pytest.mark.parametrize("damage", [b"", b"short", None])
def test_damaged_file_is_recompiled(folder: Path, damage: bytes | None):
    _kernel(2.0)(4.0)
    (path,) = folder.glob("*.unit")
    content = path.read_bytes()
    path.write_bytes(content[:-7] + b"changed" if damage is None else damage)
    assert not is_sound(path)
    reloaded = _kernel(2.0)
    assert reloaded(4.0) == 8.0
    assert _compiled(reloaded) == 1
    assert is_sound(path)


def test_intact_file_without_a_unit_is_recompiled(folder: Path):
    _kernel(2.0)(4.0)
    (path,) = folder.glob("*.unit")
    write_hashed(path, b"no pickle")
    assert _kernel(2.0)(4.0) == 8.0


def test_unwritable_cache_folder_is_tolerated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("HVF_CACHE_DIR", str(tmp_path / "file"))
    assert _kernel(2.0)(4.0) == 8.0


def test_concurrent_writers_leave_one_intact_file(tmp_path: Path):
    path, contents = tmp_path / "a.unit", [bytes([i]) * 100_000 for i in range(32)]
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda content: write_hashed(path, content), contents))
        assert all(pool.map(is_sound, [path] * 32))
    assert read_hashed(path) in contents
    assert list(tmp_path.iterdir()) == [path]


def test_only_units_unused_for_months_are_removed(tmp_path: Path):
    old, new, foreign = tmp_path / "old.unit", tmp_path / "new.unit", tmp_path / "old.kept"
    for path in (old, new, foreign):
        path.touch()
    os.utime(old, (1.0, 1.0))
    os.utime(foreign, (1.0, 1.0))
    remove_forgotten(tmp_path)
    assert not old.exists()
    assert new.exists()
    assert foreign.exists()


def test_flush_removes_only_the_units_of_its_function(folder: Path):
    @entry_point
    def single(x):
        return x

    _kernel(2.0)(4.0)
    single(1.0)
    _kernel(2.0)._cache.flush()
    assert [path.name.split("-")[0].split(".")[-1] for path in folder.glob("*.unit")] == ["single"]


def test_kernel_that_holds_an_address_is_not_cached(folder: Path):
    @njit
    def factorial(n):
        return n * factorial(n - 1) if n > 1 else 1

    for _ in range(2):
        with pytest.warns(UserWarning, match="cannot be kept"):
            assert entry_point(lambda n: factorial(5) + n)(1) == 121


def test_nested_entry_point_is_compiled_into_its_caller(folder: Path):
    inner = _kernel(2.0)

    @njit
    def outer(x):
        return inner(x) + 1.0

    assert outer(1.0) == 3.0
    assert not list(folder.glob("*.unit"))
    assert inner(1.0) == 2.0
    assert len(list(folder.glob("*.unit"))) == 1


def _misses(sources: Path, cache: Path) -> list[int]:
    """Number of units a process compiles that loads both toy kernels, `force` and `other`."""
    process = subprocess.run(
        [sys.executable, "-P", "-c", _LOAD], check=True, capture_output=True, text=True, cwd=sources,
        env=os.environ | {"HVF_CACHE_DIR": str(cache), "PYTHONPATH": f"{sources}{os.pathsep}{ROOT}"},
    )  # fmt: skip
    return [int(word) for word in process.stdout.split()]


@pytest.mark.slow
def test_source_change_recompiles_only_what_reaches_it(tmp_path: Path):
    shutil.copy(TOYS, tmp_path)
    copy, cache = tmp_path / TOYS.name, tmp_path / "cache"
    source = copy.read_text(encoding="utf-8")
    assert _misses(tmp_path, cache) == [1, 1]
    assert _misses(tmp_path, cache) == [0, 0]
    copy.write_text("# a comment\n\n" + source.replace('"""How far."""', '"""How far it is."""'), encoding="utf-8")
    assert _misses(tmp_path, cache) == [0, 0]
    copy.write_text(source.replace("GAIN = 2.0", "GAIN = 3.0"), encoding="utf-8")
    assert _misses(tmp_path, cache) == [1, 0]
    copy.write_text(source, encoding="utf-8")
    assert _misses(tmp_path, cache) == [0, 0]


def test_loaded_unit_equals_the_compiled_one_bit_for_bit(folder: Path):
    def root(x, y):
        y[0] = np.sqrt(x[0] + x[1] * x[1]) if x[0] > 0.0 else np.nan

    x, compiled, loaded = np.array([0.3, 0.7]), np.empty(1), np.empty(1)
    entry_point(root)(x, compiled)
    reloaded = entry_point(root)
    reloaded(x, loaded)
    assert _compiled(reloaded) == 0
    assert compiled.tobytes() == loaded.tobytes()
