"""Code generation deferred to the unit: the same results, errors and addresses, and no undefined symbols."""

import gc
import math
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from numba import njit, types
from numba.core.errors import TypingError

from sim.compilation import deferred_codegen
from sim.compilation.deferred_codegen import TESTED, UnitLibrary, install, undefined_symbols

VECTOR = types.Array(types.float64, 1, "C")


@pytest.fixture(autouse=True)
def empty_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HVF_CACHE_DIR", str(tmp_path))


@njit
def _halved(x):
    if x < 0.0:
        raise ValueError("negative")
    return 0.5 * x


@njit
def _twice_halved(x):
    return _halved(_halved(x))


@njit
def _factorial(n):
    return n * _factorial(n - 1) if n > 1 else 1


@njit
def _combined(x, out):
    work = np.empty(3)
    work[:] = x[:3]
    out[0] = _twice_halved(work.sum()) + math.sin(x[0]) + _factorial(5)
    out[1] = min(x[0], x[1]) ** 3


def test_install_succeeds_for_the_pinned_numba_version():
    assert install()
    assert any(numba.__version__.startswith(version + ".") for version in TESTED)
    pinned = Path(deferred_codegen.__file__).parents[2] / "pyproject.toml"
    assert '"numba>=0.68,<0.69"' in pinned.read_text(encoding="utf-8")


def test_gc_threshold_is_restored_after_compilation_and_after_its_failure():
    before = gc.get_threshold()
    njit(lambda x: x + 1)(2)
    assert gc.get_threshold() == before
    with pytest.raises(TypingError):
        njit(lambda x: x.nothing)(2)
    assert gc.get_threshold() == before


def test_untested_numba_version_is_left_unpatched(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(deferred_codegen, "TESTED", ("0.1",))
    assert not install()


@pytest.mark.slow
def test_unit_has_no_undefined_symbols_and_its_parts_are_deferred():
    result = njit(_combined.py_func).get_compile_result(types.void(VECTOR, VECTOR))
    assert isinstance(result.library, UnitLibrary)
    assert not result.library.deferred
    assert not undefined_symbols(result.library._final_module)
    (part,) = _twice_halved.overloads.values()
    assert part.library.deferred
    assert undefined_symbols(part.library._final_module)


@pytest.mark.slow
def test_results_equal_those_of_python():
    out, x = np.empty(2), np.array([0.3, 0.2, 0.5])
    njit(_combined.py_func)(x, out)
    np.testing.assert_allclose(out, [0.25 + math.sin(0.3) + 120.0, 0.2**3], rtol=1e-15)


def test_part_of_a_unit_is_callable_from_python_and_other_functions():
    @njit
    def user(x):
        return _halved(x) + 1.0

    assert user(2.0) == 2.0
    assert _halved(3.0) == 1.5
    assert user(3.0) == 2.5
    assert njit(lambda x: _halved(x) + user(x))(2.0) == 3.0


def test_recursion_works_alone_and_within_a_unit():
    assert njit(lambda n: _factorial(n) + 0)(6) == 720
    assert _factorial(5) == 120


def test_exception_in_a_part_reaches_python():
    with pytest.raises(ValueError, match="negative"):
        njit(lambda x: _twice_halved(x))(-1.0)


_PLAIN = """
import sys
if sys.argv[1] == "deferred":
    from sim.compilation.deferred_codegen import install
    assert install()
import numpy as np
from controllers.fields.follow import Follow
from controllers.curves.trajectory import Trajectory
from controllers.fields.follow import follow_wrench
from numba import njit
program = Follow(Trajectory.circle(0.05, 4.0), 300.0, 4.0, 0.02).program()
law = njit(follow_wrench.py_func)
row, memory, wrench = program.ops[0], program.fresh_memory(), np.zeros(6)
for t in np.linspace(0.0, 25.0, 200):
    hand = np.zeros(15)
    hand[1:4] = 0.055 * np.cos(t), 0.045 * np.sin(t), 0.004 * np.sin(3.0 * t)
    hand[8:11] = 0.1 * np.sin(t), 0.2, -0.1
    law(program.params, int(row[1]), int(row[3]), memory, int(row[2]), hand, wrench)
    print(wrench.tobytes().hex(), memory.tobytes().hex())
"""


@pytest.mark.slow
def test_law_equals_plain_numba_bit_for_bit():
    root = Path(deferred_codegen.__file__).parent.parent
    options = [
        subprocess.run([sys.executable, "-c", _PLAIN, way], check=True, capture_output=True, text=True, cwd=root).stdout
        for way in ("plain", "deferred")
    ]
    assert len(options[0]) > 10_000
    assert options[0] == options[1]


def test_ctrl_c_while_llvm_emits_code_ends_the_compilation(monkeypatch: pytest.MonkeyPatch, capsys):
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    def tenfold(x):
        return 10 * x

    with monkeypatch.context() as patched:
        patched.setattr("llvmlite.binding.executionengine.string_at", interrupted)
        with pytest.raises(KeyboardInterrupt):
            njit(tenfold).compile((types.int64,))
    assert capsys.readouterr().err == ""
    assert njit(tenfold)(2) == 20
