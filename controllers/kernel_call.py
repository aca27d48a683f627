"""Calls of compiled kernels by their address, so that a caller is compiled independently of the kernels.

A kernel is one of several functions with the same signature. A call by name would link all of them into the caller; by
address each is compiled, and cached, by itself. Calling convention and errors are those of any other numba call.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, cast

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from controllers.borrowed import without_owner


def kernel_call(arguments: tuple[types.Type, ...]) -> Callable[[int, tuple[Any, ...]], None]:
    """Call of kernels with given types of arguments, for compiled code: ``call(address, (argument, ...))``.

    Parameters
    ----------
    arguments : tuple of numba types
        Argument types of the kernels, which return nothing.

    Returns
    -------
    callable
        The address must be that of a kernel compiled for these types and still alive; nothing checks it.
    """

    @intrinsic
    def call(typingctx: Any, address: Any, given: Any) -> Any:
        return types.void(types.int64, types.Tuple(arguments)), _generate

    return cast(Callable[[int, tuple[Any, ...]], None], call)


@intrinsic
def _call_as_given(typingctx: Any, address: Any, given: Any) -> Any:
    return types.void(types.int64, types.Tuple(tuple(given.types))), _generate


call_as_given = cast(Callable[[int, tuple[Any, ...]], None], _call_as_given)
"""`kernel_call` of kernels compiled for exactly the types of the given arguments."""


@intrinsic
def _lend(typingctx: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        place = cgutils.alloca_once_value(builder, values[0])
        return builder.bitcast(place, context.get_value_type(signature.return_type))

    return types.CPointer(value)(value), generate


lend = cast(Callable[[tuple[Any, ...]], Any], _lend)
"""Pointer to a tuple in the compiled caller's stack frame, for kernels that it calls: they get one pointer instead of
all the tuple's arrays, field by field. Valid as long as the caller runs."""


@intrinsic
def _lent(typingctx: Any, place: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        kind = context.get_value_type(signature.return_type).as_pointer()
        tuple_ = builder.load(builder.bitcast(values[0], kind))
        return without_owner(context, builder, signature.return_type, tuple_)

    return place.dtype(place), generate


lent = cast(Callable[[Any], Any], _lent)
"""The tuple behind a pointer from `lend`, without reference counting (`controllers.borrowed`); nothing checks that it
is still valid."""


def _generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    convention, arguments = context.call_conv, signature.args[1].types
    kernel = convention.get_function_type(types.void, arguments).as_pointer()
    status, _ = convention.call_function(
        builder, builder.inttoptr(values[0], kernel), types.void, arguments,
        cgutils.unpack_tuple(builder, values[1], len(arguments)),
    )  # fmt: skip
    with cgutils.if_unlikely(builder, status.is_error):
        convention.return_status_propagate(builder, status)
    return context.get_dummy_value()


@cache
def address_of(kernel: Any, arguments: tuple[types.Type, ...]) -> int:
    """Address of a kernel (an ``njit`` function) after compiling it in this process for these types; kept alive."""
    kernel.compile(arguments)
    compiled = kernel.get_compile_result(types.void(*arguments))
    return int(compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name))
