"""Numbers in memory by their address, for compiled code."""

from typing import Any, cast

import numpy as np
from numba import types
from numba.extending import intrinsic

from controllers.state import Array, IntArray
from sim.compilation.compiled import entry_point


def loader(kind: types.Type) -> Any:
    """What gives the value at an address, of a kind; arrays in it stay those of whoever keeps them there."""

    def loading(_: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            value = builder.load(builder.inttoptr(given[0], context.get_value_type(kind).as_pointer()))
            context.nrt.incref(builder, kind, value)
            return value

        return kind(types.intp), generate

    return intrinsic(loading)


number_at: Any = loader(types.float64)
"""The number at an address; nothing checks it."""
int32_at: Any = loader(types.int32)


def items(array: Array) -> "memoryview[float]":
    """An array whose items are Python's numbers: to read one makes no object of NumPy's."""
    return cast("memoryview[float]", array.data)


@entry_point
def gather(addresses: IntArray, into: Array) -> None:
    """Copy numbers, each from its own address, shape (n,) both."""
    for i in range(len(addresses)):
        into[i] = number_at(addresses[i])


def addresses_of(arrays: list[Array]) -> IntArray:
    """Where the numbers of arrays lie, one array after the other; the caller keeps them alive."""
    found = [array.ctypes.data + array.strides[0] * np.arange(len(array)) for array in arrays]
    return np.concatenate(found).astype(np.int64)
