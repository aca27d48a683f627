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

from controllers.state import Array
from sim.compilation.compiled import entry_point

_ADDRESS, _NUMBER = types.uintp, types.int64


class KeptCall:
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
        kept = before, () if number is None else (number,), after
        self._call, self._release = _compiled(function, *(numba.typeof(part) for part in kept))
        self._address = keep_arguments(kept)

    def __call__(self) -> None:
        """Call the function."""
        self._call(self._address)

    def __del__(self) -> None:
        if hasattr(self, "_address"):
            self._release(self._address)


def _place(context: Any, builder: Any, kind: Any, address: Any) -> Any:
    return builder.inttoptr(address, context.get_value_type(kind).as_pointer())


def _keeping(_: Any, kind: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        size = context.get_abi_sizeof(context.get_value_type(kind))
        memory = context.nrt.allocate(builder, context.get_constant(types.uintp, size))
        context.nrt.incref(builder, kind, given[0])
        address = builder.ptrtoint(memory, context.get_value_type(_ADDRESS))
        builder.store(given[0], _place(context, builder, kind, address))
        return address

    return _ADDRESS(kind), generate


_keep: Any = intrinsic(_keeping)


@entry_point
def keep_arguments(arguments: Any) -> int:
    """Store arguments in their compiled representation; returns the address. The copy keeps their arrays alive."""
    return _keep(arguments)


@cache
def _compiled(function: Any, before: Any, number: Any, after: Any) -> tuple[Any, Any]:
    """Functions of the address of stored arguments: one that calls `function` with them, and one that frees them."""
    kinds = (before, number, after)
    together, parts = types.Tuple(kinds), (*before.types, *(_NUMBER for _ in number.types), *after.types)
    function.compile(parts)
    found = function.overloads[parts]
    code = found.library.get_pointer_to_function(found.fndesc.llvm_func_name)

    def calling(_: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            kept = builder.load(_place(context, builder, together, given[0]))
            first, between, last = (
                cgutils.unpack_tuple(builder, builder.extract_value(kept, i), len(kind.types))
                for i, kind in enumerate(kinds)
            )
            places = (context.make_array(number[0])(context, builder, value) for value in between)
            whole = [builder.fptosi(builder.load(place.data), context.get_value_type(_NUMBER)) for place in places]
            shape = context.call_conv.get_function_type(types.none, parts)
            where = builder.inttoptr(context.get_constant(types.uintp, code), shape.as_pointer())
            arguments = [*first, *whole, *last]
            status, _ = context.call_conv.call_function(builder, where, types.none, parts, arguments)
            with cgutils.if_unlikely(builder, status.is_error):
                context.call_conv.return_status_propagate(builder, status)
            return context.get_dummy_value()

        return types.none(_ADDRESS), generate

    def releasing(_: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            where = _place(context, builder, together, given[0])
            context.nrt.decref(builder, together, builder.load(where))
            context.nrt.free(builder, builder.bitcast(where, cgutils.voidptr_t))
            return context.get_dummy_value()

        return types.none(_ADDRESS), generate

    call: Any = intrinsic(calling)
    release: Any = intrinsic(releasing)

    def call_at(address: int) -> None:
        call(address)

    def release_at(address: int) -> None:
        release(address)

    return njit((_ADDRESS,), nogil=True)(call_at), njit((_ADDRESS,))(release_at)
