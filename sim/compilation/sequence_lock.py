"""A sequence lock: numbers that one writes and others read, in compiled code of threads or of processes.

Numbers of eight bytes are written whole; barriers between count and numbers let every reader, on every processor, see
them in the order in which they are written (Lameter, "Effective synchronization on Linux/NUMA systems", 2005).
"""

from typing import Any

from numba import types
from numba.extending import intrinsic

from controllers.state import Array, IntArray
from sim.compilation.compiled import entry_point

_TRIES = 20  # so a writer that was stopped in the middle costs its reader microseconds


def _fence(_: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        builder.fence("seq_cst")
        return context.get_dummy_value()

    return types.none(), generate


barrier: Any = intrinsic(_fence)
"""What is written before it is seen before what is written after it."""


@entry_point
def write_whole(count: IntArray, shared: Array, numbers: Array) -> None:
    """Write all of `numbers`: the count, shape (1,), is odd meanwhile."""
    count[0] += 1
    barrier()
    for i in range(len(numbers)):
        shared[i] = numbers[i]
    barrier()
    count[0] += 1


@entry_point
def read_whole(count: IntArray, shared: Array, whole: Array, into: Array) -> bool:
    """Read all; False, and nothing, if a writer was stopped in the middle of them.

    Parameters
    ----------
    count, shared : array
        Of `write_whole`.
    whole, into : Array
        Of one length; `whole` is for what may not be whole.
    """
    for _ in range(_TRIES):
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
