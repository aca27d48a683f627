"""Work arrays on the stack of a compiled kernel, so that a servo tick allocates nothing on the heap.

`numpy.empty` in compiled code allocates heap memory in every call. A work array lies in the stack frame of the function
that creates it, like a local array in C: it must not be returned, nor stored beyond that call. In Python, hence also if
a kernel is evaluated on symbols, it is `numpy.empty`.
"""

from typing import Any

import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload
from numba.np.arrayobj import populate_array

from geometry.arrays import Array, IntArray


def work_array(shape: int | tuple[int, ...]) -> Array:
    """Uninitialised array of floats on the stack of the compiled caller.

    Parameters
    ----------
    shape : int or tuple of int
        If not a compile-time constant, the call must not be in a loop: the stack would grow with each iteration.
    """
    return np.empty(shape)


def work_integers(shape: int | tuple[int, ...]) -> IntArray:
    """`work_array` of integers."""
    return np.empty(shape, np.int64)


def _stack_allocator(kind: types.Type) -> Any:
    """Intrinsic that allocates an array of a number type on the caller's stack."""

    @intrinsic(prefer_literal=True)
    def array(_: Any, shape: Any) -> Any:
        sizes = list(shape) if isinstance(shape, types.BaseTuple) else [shape]  # pyright: ignore[reportArgumentType]
        array_type = types.Array(kind, len(sizes), "C")
        constant = all(isinstance(size, types.Literal) for size in sizes)

        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            index, number = context.get_value_type(types.intp), context.get_value_type(kind)
            if constant:
                shapes = [index(size.literal_value) for size in sizes]
                count = index(int(np.prod([size.literal_value for size in sizes])))
                # Allocated in the function's entry block: one array, even if requested in a loop.
                data = cgutils.alloca_once(builder, number, count)
            else:
                parts = cgutils.unpack_tuple(builder, given[0]) if isinstance(shape, types.BaseTuple) else [given[0]]
                shapes = [context.cast(builder, p, size, types.intp) for p, size in zip(parts, sizes, strict=True)]
                count = index(1)
                for size in shapes:
                    count = builder.mul(count, size)
                data = builder.alloca(number, count)
            itemsize = index(context.get_abi_sizeof(number))
            strides = [itemsize]
            for size in reversed(shapes[1:]):
                strides.insert(0, builder.mul(strides[0], size))
            array = context.make_array(array_type)(context, builder)
            populate_array(array, data, shapes, strides, itemsize, None)
            return array._getvalue()

        return array_type(shape), generate

    return array


_stack_floats, _stack_integers = _stack_allocator(types.float64), _stack_allocator(types.int64)


@overload(work_array, prefer_literal=True, strict=False, inline="always")
def _work_array(shape: Any) -> Any:
    return lambda shape: _stack_floats(shape)  # pyright: ignore[reportUnknownLambdaType]


@overload(work_integers, prefer_literal=True, strict=False, inline="always")
def _work_integers(shape: Any) -> Any:
    return lambda shape: _stack_integers(shape)  # pyright: ignore[reportUnknownLambdaType]
