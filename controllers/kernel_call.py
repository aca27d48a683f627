"""Calls of compiled kernels by their address, so that a caller is compiled independently of the kernels.

A kernel is one of several functions with the same signature. A call by name would link all of them into the caller; by
address each is compiled, and cached, separately. Calling convention and errors are those of any other numba call.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, cast

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic


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
        return types.void(types.int64, types.Tuple(arguments)), _emit_call

    return cast(Callable[[int, tuple[Any, ...]], None], call)


@intrinsic
def _call_as_given(typingctx: Any, address: Any, given: Any) -> Any:
    return types.void(types.int64, types.Tuple(tuple(given.types))), _emit_call


call_as_given = cast(Callable[[int, tuple[Any, ...]], None], _call_as_given)
"""`kernel_call` of kernels compiled for exactly the types of the given arguments."""


def _emit_call(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    convention, arguments = context.call_conv, signature.args[1].types
    kernel = convention.get_function_type(types.void, arguments).as_pointer()
    status, _ = convention.call_function(
        builder, builder.inttoptr(values[0], kernel), types.void, arguments,
        cgutils.unpack_tuple(builder, values[1], len(arguments)),
    )  # fmt: skip
    with cgutils.if_unlikely(builder, status.is_error):
        convention.return_status_propagate(builder, status)
    return context.get_dummy_value()


_KernelListener = Callable[[Any, tuple[types.Type, ...]], None]
_announced_kernels: list[tuple[Any, tuple[types.Type, ...]]] = []
_listeners: list[_KernelListener] = []


def register_kernel(kernel: Any, arguments: tuple[types.Type, ...]) -> None:
    """Notify all listeners of a kernel (an ``njit`` function) and its argument types, before it is compiled."""
    _announced_kernels.append((kernel, arguments))
    for listener in _listeners:
        listener(kernel, arguments)


def add_kernel_listener(listener: _KernelListener) -> _KernelListener:
    """Notify a function of every kernel, past and future; `sim.compilation` so caches the code of laws and maps."""
    _listeners.append(listener)
    for kernel, arguments in _announced_kernels:
        listener(kernel, arguments)
    return listener


@cache
def address_of(kernel: Any, arguments: tuple[types.Type, ...]) -> int:
    """Address of a kernel (an ``njit`` function) after compiling it in this process for these types; kept alive."""
    register_kernel(kernel, arguments)
    kernel.compile(arguments)
    compiled = kernel.get_compile_result(types.void(*arguments))
    return int(compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name))
