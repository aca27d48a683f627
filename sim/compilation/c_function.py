"""Calls of C functions by address from compiled code, and addresses of compiled functions for C.

Arguments are passed by value with their types in compiled code, unchecked. A char is passed as an int, as in all 64-bit
calling conventions.
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

_STRUCT_BY_POINTER = sys.platform == "win32" and platform.machine().lower() in ("amd64", "x86_64")


def _call_intrinsic(result: types.Type) -> Any:
    def typing(_: Any, function: Any, arguments: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            values = cgutils.unpack_tuple(builder, given[1], len(arguments.types))
            result_type = ir.VoidType() if result == types.none else context.get_value_type(result)
            function_type = ir.FunctionType(result_type, [value.type for value in values])
            call = builder.call(builder.inttoptr(given[0], function_type.as_pointer()), values)
            return context.get_dummy_value() if result == types.none else call

        return result(types.intp, arguments), generate

    return intrinsic(typing)


call_int: Any = _call_intrinsic(types.int32)
"""Calls a C function that returns int: ``call_int(address, arguments)``."""
call_void: Any = _call_intrinsic(types.none)
"""Calls a C function that returns nothing: ``call_void(address, arguments)``."""


def struct_heads(hidden: bool) -> Any:
    """An intrinsic that calls a C function without arguments that returns a struct of 9 to 16 bytes: its first int.

    Parameters
    ----------
    hidden : bool
        Whether such a struct is returned through a hidden pointer argument, as on Windows x86-64; elsewhere it is
        returned in two registers.
    """

    def typing(_: Any, function: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            word, number = ir.IntType(64), ir.IntType(32)
            if hidden:
                buffer = cgutils.alloca_once(builder, word, 2)
                function_type = ir.FunctionType(ir.VoidType(), [buffer.type])
                builder.call(builder.inttoptr(given[0], function_type.as_pointer()), [buffer])
                return builder.load(builder.bitcast(buffer, number.as_pointer()))
            function_type = ir.FunctionType(ir.LiteralStructType([word, word]), [])
            call = builder.call(builder.inttoptr(given[0], function_type.as_pointer()), [])
            return builder.trunc(builder.extract_value(call, 0), number)

        return types.int32(types.intp), generate

    return intrinsic(typing)


call_struct_head: Any = struct_heads(_STRUCT_BY_POINTER)
"""`struct_heads` for this platform: ``call_struct_head(address)``."""


def address_of(function: Any) -> int:
    """Address of a function of a library loaded by ctypes."""
    return ctypes.cast(function, ctypes.c_void_p).value or 0


def address_for_c(function: Callable[..., object], signature: Any) -> int:
    """Address at which C can call a compiled `entry_point` of scalar arguments.

    The function runs without the GIL and must not raise.

    Parameters
    ----------
    function : callable
        A function of a module, so that its code stays alive.
    signature : numba signature
        Types of result and arguments.
    """
    compiled: Any = function
    compiled_result = compiled.get_compile_result(signature)
    return int(compiled_result.library.get_pointer_to_function(compiled_result.fndesc.llvm_cfunc_wrapper_name))
