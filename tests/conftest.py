"""Shared by all tests: one BLAS thread per process, and kernels cached on disk.

Tests run in parallel, one process per core; more BLAS threads only spin, and lifting four clips took five times the
processor time. A run compiles its kernels as parts of a few units; a test that calls a kernel directly would compile it
anew in each process. Such kernels are cached on disk between processes, as units are. A process that needs what another
one is compiling waits and loads it.
"""

import fcntl
import signal
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from experiments.console import startup  # noqa: F401 - before NumPy is imported

# isort: split
import pytest
from hypothesis import settings
from numba.core.caching import NullCache
from numba.core.dispatcher import Dispatcher

from controllers.certificates.report import Verdict
from sim.compilation import bound_call, unit_workers
from sim.compilation.deferred_codegen import is_nested
from sim.compilation.unit_cache import UnitCache, cache_folder
from sim.compilation.unit_key import UnknownIngredient, UnknownName
from sim.compilation.workers import Call, run_in_workers

signal.signal(signal.SIGINT, signal.default_int_handler)  # pytest's own, in place of the start-up's

# The same examples in every run, also on a machine that is slow or busy.
settings.register_profile("deterministic", derandomize=True, deadline=None)
settings.load_profile("deterministic")


class _TestKernelCache(UnitCache):
    """Cache in a folder of its own, because some tests count the files of units."""

    def path(self, signature: Any) -> Path:
        path = super().path(signature)
        return path.parent / "kernels" / path.name


class _KernelCache(NullCache):
    """Caches every kernel that has a key; no `UnitCache` itself, so that the kernel is not taken for a unit.

    A kernel that a run has compiled as a unit is loaded from there.
    """

    def __init__(self, kernel: Dispatcher):
        self._units = UnitCache(kernel.py_func, kernel.targetoptions)
        self._kernels = _TestKernelCache(kernel.py_func, kernel.targetoptions)
        self.path = self._kernels.path

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            found = self._units.load_overload(sig, target_context)
            return self._kernels.load_overload(sig, target_context) if found is None else found
        except (UnknownIngredient, UnknownName):
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of kernels that hold an address, which cannot be cached
            try:
                self._kernels.save_overload(sig, data)
            except (UnknownIngredient, UnknownName):
                return


_compile = Dispatcher.compile
_LOCKS = cache_folder() / "locks"


@contextmanager
def _exclusively(name: str) -> Iterator[None]:
    """While no other process is in a block of this name."""
    _LOCKS.mkdir(parents=True, exist_ok=True)
    with (_LOCKS / name).open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _compile_or_load(self: Any, signature: Any) -> Any:
    if type(self._cache) is NullCache and not is_nested() and self.py_func.__module__ != bound_call.__name__:
        self._cache = _KernelCache(self)
    with suppress(UnknownIngredient, UnknownName):
        if isinstance(self._cache, UnitCache | _KernelCache) and not is_nested():
            path = self._cache.path(signature)
            if not path.exists():
                with _exclusively(path.stem):
                    return _compile(self, signature)
    return _compile(self, signature)


def _compile_missing(calls: list[Call], done: Callable[[int], None]) -> None:
    with _exclusively("units"):
        missing = [k for k, (_, (unit,)) in enumerate(calls) if not unit.is_kept()]
        if missing:
            run_in_workers([calls[k] for k in missing], lambda k: done(missing[k]))


unit_workers.run_in_workers = _compile_missing
Dispatcher.compile = _compile_or_load


@pytest.fixture
def without_page(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs write neither figures nor a report page, which would take longer than the run itself."""
    monkeypatch.setattr("experiments.results.pages.report.write_report_of", lambda folder: None)


@pytest.fixture
def without_region(monkeypatch: pytest.MonkeyPatch) -> None:
    """Certificates have no region of attraction, whose search takes most of their time."""
    monkeypatch.setattr("experiments.certify.certify.region", lambda *given: Verdict("unknown", "not searched"))
