"""BLAS on one thread: the matrices are small, so more threads only wait for each other and for other programs.

The `hvf` command sets one thread in its environment, before NumPy is imported. In a program that imports NumPy itself,
the functions for which it matters are decorated. Beside another busy program on two cores, a capture is prepared in
10 s with one thread, and in 81 s with two.
"""

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

_P = ParamSpec("_P")
_R = TypeVar("_R")


def on_one_blas_thread(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Let a function run with one BLAS thread; the caller's number is restored after it."""

    @wraps(function)
    def limited(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        with threadpool_limits(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return limited
