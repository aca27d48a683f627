"""A decorated function has one BLAS thread, its caller the number it had before."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from controllers.haptic_map.lifting.room import Room
from experiments.config.words import run_config
from experiments.lifting.lift import lift_clips
from experiments.setups.wiring import wire
from models.errors import ModelError
from models.mocap.preparation.prepare import prepared

DOORS: list[tuple[str, str, Callable[[], object]]] = [
    ("models.mocap.preparation.prepare", "load", lambda: prepared(Path("walk.bvh"))),
    ("experiments.lifting.lift", "load_clips", lambda: lift_clips(["walk"], Room())),
    ("experiments.setups.wiring", "check_rates", lambda: wire(run_config())),
]


ALONE = """
import numpy as np
from threadpoolctl import threadpool_info, threadpool_limits
from models.one_blas_thread import on_one_blas_thread

def threads():
    np.linalg.norm(np.eye(2))
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}

@on_one_blas_thread
def within(fail):
    if fail:
        raise ValueError
    return threads()

threadpool_limits(limits=2, user_api="blas")
print(threads(), within(False), threads())
try:
    within(True)
except ValueError:
    print(threads())
"""


def _threads() -> set[int]:
    return {int(pool["num_threads"]) for pool in threadpool_info() if pool["user_api"] == "blas"}


def test_callers_keep_their_threads_also_after_an_error() -> None:
    """In a process of its own: a library of another package may be built for one thread, whatever is asked of it."""
    told = subprocess.run([sys.executable, "-c", ALONE], capture_output=True, text=True, check=True).stdout
    assert told == "{2} {1} {2}\n{2}\n"


@pytest.mark.parametrize(("module", "inner", "outer"), DOORS)
def test_what_is_slow_beside_other_programs_has_one(
    monkeypatch: pytest.MonkeyPatch, module: str, inner: str, outer: Callable[[], object]
) -> None:
    seen: list[set[int]] = []

    def stop(*_: object, **__: object) -> None:
        seen.append(_threads())
        raise ModelError("seen")

    monkeypatch.setattr(f"{module}.{inner}", stop)
    with threadpool_limits(limits=2, user_api="blas"), pytest.raises(ModelError, match="seen"):
        outer()
    assert seen == [{1}]
