"""C functions by their address, called from compiled code; and compiled functions by theirs, called from C.

Arguments go by value with the types that they have in compiled code: nothing checks them. A char goes as an int, which
is how all calling conventions of 64 bits have it.
"""

import ctypes
import platform
import sys
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

_HIDDEN = sys.platform == "win32" and platform.machine().lower() in ("amd64", "x86_64")


def _calls(result: types.Type) -> Any:
    def calling(_: Any, function: Any, arguments: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            values = cgutils.unpack_tuple(builder, given[1], len(arguments.types))
            told = ir.VoidType() if result == types.none else context.get_value_type(result)
            shape = ir.FunctionType(told, [value.type for value in values])
            called = builder.call(builder.inttoptr(given[0], shape.as_pointer()), values)
            return context.get_dummy_value() if result == types.none else called

        return result(types.intp, arguments), generate

    return intrinsic(calling)


call_int: Any = _calls(types.int32)
"""What a C function at an address returns, of a tuple of arguments."""
call_void: Any = _calls(types.none)


def struct_heads(hidden: bool) -> Any:
    """What calls C functions that take nothing and return a struct of 9 to 16 bytes, of which it gives the first int.

    Parameters
    ----------
    hidden : bool
        Whether such a struct is written to where a first argument points, as on Windows' x86-64; it comes in two
        registers elsewhere.
    """

    def calling(_: Any, function: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            word, number = ir.IntType(64), ir.IntType(32)
            if hidden:
                room = cgutils.alloca_once(builder, word, 2)
                shape = ir.FunctionType(ir.VoidType(), [room.type])
                builder.call(builder.inttoptr(given[0], shape.as_pointer()), [room])
                return builder.load(builder.bitcast(room, number.as_pointer()))
            shape = ir.FunctionType(ir.LiteralStructType([word, word]), [])
            called = builder.call(builder.inttoptr(given[0], shape.as_pointer()), [])
            return builder.trunc(builder.extract_value(called, 0), number)

        return types.int32(types.intp), generate

    return intrinsic(calling)


call_struct_head: Any = struct_heads(_HIDDEN)
"""The first int of a struct of 9 to 16 bytes that a C function at an address returns."""


def address_of(function: Any) -> int:
    """Where a function of a library lies that ctypes loaded."""
    return ctypes.cast(function, ctypes.c_void_p).value or 0


def address_for_c(function: Callable[..., object], signature: Any) -> int:
    """Where C finds a compiled function, an entry point of numbers; it runs without the GIL, and must not raise.

    Parameters
    ----------
    function : callable
        Of a module: its code lives as long as it.
    signature : numba signature
        Of result and arguments.
    """
    compiled: Any = function
    found = compiled.get_compile_result(signature)
    return int(found.library.get_pointer_to_function(found.fndesc.llvm_cfunc_wrapper_name))
