"""A sequence lock in compiled code: one writer and any number of readers, in threads or in processes.

Eight-byte numbers are written atomically; memory barriers between count and numbers make every reader, on every
processor, see the writes in order (Lameter, "Effective synchronization on Linux/NUMA systems", 2005).
"""

from typing import Any

from numba import types
from numba.extending import intrinsic

from geometry.arrays import Array, IntArray
from sim.compilation.compiled import entry_point

_MAX_ATTEMPTS = 20  # limits to microseconds what a reader loses to a writer that stopped while writing


def _fence(_: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        builder.fence("seq_cst")
        return context.get_dummy_value()

    return types.none(), generate


barrier: Any = intrinsic(_fence)
"""Memory barrier: writes before it become visible before writes after it."""


@entry_point
def write_whole(count: IntArray, shared: Array, numbers: Array) -> None:
    """Write all of `numbers` to `shared`; meanwhile the count, shape (1,), is odd."""
    count[0] += 1
    barrier()
    for i in range(len(numbers)):
        shared[i] = numbers[i]
    barrier()
    count[0] += 1


@entry_point
def read_whole(count: IntArray, shared: Array, whole: Array, into: Array) -> bool:
    """Read all numbers consistently; returns False, with `into` unchanged, if a writer stopped while writing.

    Parameters
    ----------
    count, shared : array
        Those of `write_whole`.
    whole, into : Array
        Scratch, which may be left inconsistent, and result, of the same length.
    """
    for _ in range(_MAX_ATTEMPTS):
        before = count[0]
        barrier()
        for i in range(len(whole)):
            whole[i] = shared[i]
        barrier()
        if before % 2 == 0 and before == count[0]:
            for i in range(len(whole)):
                into[i] = whole[i]
            return True
    return False
