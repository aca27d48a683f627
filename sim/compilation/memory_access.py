"""Access to numbers in memory by address, for compiled code."""

from typing import Any, cast

import numpy as np
from numba import types
from numba.extending import intrinsic

from geometry.arrays import Array, IntArray
from sim.compilation.compiled import entry_point


def loader(kind: types.Type) -> Any:
    """An intrinsic that loads a value of a given type from an address; arrays in it are shared, not copied."""

    def loading(_: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            value = builder.load(builder.inttoptr(given[0], context.get_value_type(kind).as_pointer()))
            context.nrt.incref(builder, kind, value)
            return value

        return kind(types.intp), generate

    return intrinsic(loading)


number_at: Any = loader(types.float64)
"""The float64 at an address; the address is not checked."""
int32_at: Any = loader(types.int32)
"""The int32 at an address; the address is not checked."""


def items(array: Array) -> "memoryview[float]":
    """A view of an array whose items are Python floats: reading one creates no NumPy scalar."""
    return cast("memoryview[float]", array.data)


@entry_point
def gather(addresses: IntArray, into: Array) -> None:
    """Copy numbers from individual addresses into an array, shape (n,) both."""
    for i in range(len(addresses)):
        into[i] = number_at(addresses[i])


def addresses_of(arrays: list[Array]) -> IntArray:
    """Addresses of the numbers of arrays, one array after the other; the caller must keep the arrays alive."""
    found = [array.ctypes.data + array.strides[0] * np.arange(len(array)) for array in arrays]
    return np.concatenate(found).astype(np.int64)
