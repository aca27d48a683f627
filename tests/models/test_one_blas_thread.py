"""A decorated function runs on one BLAS thread; the caller keeps its number of threads."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from controllers.haptic_map.lifting.room import Room
from experiments.config.options import run_config
from experiments.lifting.lift import lift_clips
from experiments.setups.wiring import wire
from models.errors import ModelError
from models.mocap.preparation.prepare import prepared

ENTRY_POINTS: list[tuple[str, str, Callable[[], object]]] = [
    ("models.mocap.preparation.prepare", "load", lambda: prepared(Path("walk.bvh"))),
    ("experiments.lifting.lift", "load_clips", lambda: lift_clips(["walk"], Room())),
    ("experiments.setups.wiring", "check_rates", lambda: wire(run_config())),
]


SUBPROCESS_CODE = """
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


def _blas_threads() -> set[int]:
    return {int(pool["num_threads"]) for pool in threadpool_info() if pool["user_api"] == "blas"}


def test_thread_count_of_the_caller_is_restored_after_return_and_after_an_error() -> None:
    """Run in a subprocess, where no other package has loaded a BLAS library built for a single thread."""
    output = subprocess.run([sys.executable, "-c", SUBPROCESS_CODE], capture_output=True, text=True, check=True).stdout
    assert output == "{2} {1} {2}\n{2}\n"


@pytest.mark.parametrize(("module", "first_call", "entry_point"), ENTRY_POINTS)
def test_preparation_lifting_and_wiring_run_on_one_blas_thread(
    monkeypatch: pytest.MonkeyPatch, module: str, first_call: str, entry_point: Callable[[], object]
) -> None:
    seen: list[set[int]] = []

    def stop(*_: object, **__: object) -> None:
        seen.append(_blas_threads())
        raise ModelError("seen")

    monkeypatch.setattr(f"{module}.{first_call}", stop)
    with threadpool_limits(limits=2, user_api="blas"), pytest.raises(ModelError, match="seen"):
        entry_point()
    assert seen == [{1}]
