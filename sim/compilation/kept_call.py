"""A compiled function that is handed its arguments once: a call then takes one number, and makes no memory.

Else each of the arrays in its arguments is taken apart anew in every call, with a header of its own from the heap. The
arguments lie as compiled code holds them in memory that is kept, and the function is called by its address.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, cast

import numba
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic


class KeptCall:
    """Call of a compiled function, whose other arguments are kept.

    Parameters
    ----------
    function : callable
        Compiled; it returns nothing, and does not keep its arguments.
    before, after : tuple
        Of its arguments, those before and after the whole number that a call hands over.
    """

    def __init__(self, function: Callable[..., None], before: tuple[Any, ...], after: tuple[Any, ...] = ()):
        kept, call, self._release = _compiled(function, numba.typeof(before), numba.typeof(after))
        self._address, self._call = kept((before, after)), call

    def __call__(self, number: int) -> None:
        """Call the function."""
        self._call(self._address, number)

    def __del__(self) -> None:
        if hasattr(self, "_address"):
            self._release(self._address)


@cache
def _compiled(function: Any, before: types.Tuple, after: types.Tuple) -> tuple[Any, Any, Any]:
    """What keeps the arguments and tells their address, what calls the function with them, and what lets them go."""
    together, number, address = types.Tuple((before, after)), types.int64, types.uintp
    parts = (*before.types, number, *after.types)
    function.compile(parts)
    found = function.overloads[parts]
    code = found.library.get_pointer_to_function(found.fndesc.llvm_func_name)

    def place(context: Any, builder: Any, at: Any) -> Any:
        return builder.inttoptr(at, context.get_value_type(together).as_pointer())

    @intrinsic
    def keep(_: Any, values: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            size = context.get_abi_sizeof(context.get_value_type(together))
            memory = context.nrt.allocate(builder, context.get_constant(types.uintp, size))
            context.nrt.incref(builder, together, given[0])
            at = builder.ptrtoint(memory, context.get_value_type(address))
            builder.store(given[0], place(context, builder, at))
            return at

        return address(together), generate

    @intrinsic
    def call(_: Any, at: Any, value: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            kept = builder.load(place(context, builder, given[0]))
            first, last = (
                cgutils.unpack_tuple(builder, builder.extract_value(kept, i), len(kinds.types))
                for i, kinds in enumerate((before, after))
            )
            shape = context.call_conv.get_function_type(types.none, parts)
            where = builder.inttoptr(context.get_constant(types.uintp, code), shape.as_pointer())
            status, _ = context.call_conv.call_function(builder, where, types.none, parts, [*first, given[1], *last])
            with cgutils.if_unlikely(builder, status.is_error):
                context.call_conv.return_status_propagate(builder, status)
            return context.get_dummy_value()

        return types.none(address, number), generate

    @intrinsic
    def release(_: Any, at: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            where = place(context, builder, given[0])
            context.nrt.decref(builder, together, builder.load(where))
            context.nrt.free(builder, builder.bitcast(where, cgutils.voidptr_t))
            return context.get_dummy_value()

        return types.none(address), generate

    return (
        cast(Any, njit((together,))(lambda values: keep(values))),
        cast(Any, njit((address, number), nogil=True)(lambda at, value: call(at, value))),
        cast(Any, njit((address,))(lambda at: release(at))),
    )  # fmt: skip
