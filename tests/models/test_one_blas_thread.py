"""A decorated function has one BLAS thread, its caller the number it had before."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from controllers.haptic_map.lifting.room import Room
from experiments.config.words import run_config
from experiments.lifting.lift import lift_clips
from experiments.setups.wiring import wire
from models.errors import ModelError
from models.mocap.preparation.prepare import prepared
from models.one_blas_thread import on_one_blas_thread

DOORS: list[tuple[str, str, Callable[[], object]]] = [
    ("models.mocap.preparation.prepare", "load", lambda: prepared(Path("walk.bvh"))),
    ("experiments.lifting.lift", "load_clips", lambda: lift_clips(["walk"], Room())),
    ("experiments.setups.wiring", "check_rates", lambda: wire(run_config())),
]


def _threads() -> set[int]:
    np.linalg.norm(np.eye(2))
    return {int(pool["num_threads"]) for pool in threadpool_info() if pool["user_api"] == "blas"}


def test_the_caller_keeps_its_threads_also_after_an_error() -> None:
    @on_one_blas_thread
    def within(fail: bool) -> set[int]:
        if fail:
            raise ValueError("as asked")
        return _threads()

    with threadpool_limits(limits=2, user_api="blas"):
        assert _threads() == {2}
        assert within(fail=False) == {1}
        with pytest.raises(ValueError, match="as asked"):
            within(fail=True)
        assert _threads() == {2}


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
