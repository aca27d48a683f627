"""Calls of compiled functions with arguments that are unboxed once, so that a call allocates nothing.

numba's own calls unbox every array of the arguments anew, with a header on the heap for each. Here the arguments are
stored in their compiled representation, and the function is called by address.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numba
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

from geometry.arrays import Array
from sim.compilation.compiled import entry_point

_ADDRESS, _NUMBER = types.uintp, types.int64


class BoundCall:
    """A compiled function bound to stored arguments.

    Parameters
    ----------
    function : callable
        A compiled function that returns nothing and keeps no reference to its arguments.
    before, after : tuple
        Its arguments before and after the integer.
    number : Array, optional
        Array, shape (1,), whose value at each call is passed as an integer between them; by default none is passed.
    """

    def __init__(
        self, function: Callable[..., None], before: tuple[Any, ...], number: Array | None = None,
        after: tuple[Any, ...] = (),
    ):  # fmt: skip
        stored = before, () if number is None else (number,), after
        self._call, self._release = _compile_call(function, *(numba.typeof(part) for part in stored))
        self._address = keep_arguments(stored)

    def __call__(self) -> None:
        """Call the function."""
        self._call(self._address)

    def __del__(self) -> None:
        if hasattr(self, "_address"):
            self._release(self._address)


def _typed_pointer(context: Any, builder: Any, kind: Any, address: Any) -> Any:
    return builder.inttoptr(address, context.get_value_type(kind).as_pointer())


def _store_typing(_: Any, kind: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        size = context.get_abi_sizeof(context.get_value_type(kind))
        memory = context.nrt.allocate(builder, context.get_constant(types.uintp, size))
        context.nrt.incref(builder, kind, given[0])
        address = builder.ptrtoint(memory, context.get_value_type(_ADDRESS))
        builder.store(given[0], _typed_pointer(context, builder, kind, address))
        return address

    return _ADDRESS(kind), generate


_store: Any = intrinsic(_store_typing)


@entry_point
def keep_arguments(arguments: Any) -> int:
    """Store arguments in their compiled representation; returns the address. The copy keeps their arrays alive."""
    return _store(arguments)


@cache
def _compile_call(function: Any, before: Any, number: Any, after: Any) -> tuple[Any, Any]:
    """Functions of the address of stored arguments: one that calls `function` with them, and one that frees them."""
    group_types = (before, number, after)
    storage, argument_types = types.Tuple(group_types), (*before.types, *(_NUMBER for _ in number.types), *after.types)
    function.compile(argument_types)
    found = function.overloads[argument_types]
    code = found.library.get_pointer_to_function(found.fndesc.llvm_func_name)

    def call_typing(_: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            stored = builder.load(_typed_pointer(context, builder, storage, given[0]))
            leading, numbers, trailing = (
                cgutils.unpack_tuple(builder, builder.extract_value(stored, i), len(kind.types))
                for i, kind in enumerate(group_types)
            )
            arrays = (context.make_array(number[0])(context, builder, value) for value in numbers)
            integers = [builder.fptosi(builder.load(array.data), context.get_value_type(_NUMBER)) for array in arrays]
            shape = context.call_conv.get_function_type(types.none, argument_types)
            pointer = builder.inttoptr(context.get_constant(types.uintp, code), shape.as_pointer())
            arguments = [*leading, *integers, *trailing]
            status, _ = context.call_conv.call_function(builder, pointer, types.none, argument_types, arguments)
            with cgutils.if_unlikely(builder, status.is_error):
                context.call_conv.return_status_propagate(builder, status)
            return context.get_dummy_value()

        return types.none(_ADDRESS), generate

    def release_typing(_: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            pointer = _typed_pointer(context, builder, storage, given[0])
            context.nrt.decref(builder, storage, builder.load(pointer))
            context.nrt.free(builder, builder.bitcast(pointer, cgutils.voidptr_t))
            return context.get_dummy_value()

        return types.none(_ADDRESS), generate

    call: Any = intrinsic(call_typing)
    release: Any = intrinsic(release_typing)

    def call_at(address: int) -> None:
        call(address)

    def release_at(address: int) -> None:
        release(address)

    return njit((_ADDRESS,), nogil=True)(call_at), njit((_ADDRESS,))(release_at)
