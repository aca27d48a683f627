"""Borrowed arrays in compiled code: arrays without reference counting, valid for the duration of a call.

numba counts a reference, by an atomic instruction, for every array of a tuple that is passed to a function or taken out
of a tuple. In a loop that passes a hundred arrays per tick this takes a tenth of the time, although the caller keeps
the arrays alive anyway.
"""

from typing import Any, Protocol, TypeVar, cast

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.arrayobj import make_array

_Value = TypeVar("_Value")


@intrinsic
def _borrow(typingctx: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return without_owner(context, builder, value, values[0])

    return value(value), generate


def without_owner(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """LLVM value of a numba type in which arrays have no owner (`meminfo`), so that references are not counted."""
    if isinstance(kind, types.Array):
        array = make_array(kind)(context, builder, value)
        array.meminfo = cgutils.get_null_value(array.meminfo.type)
        array.parent = cgutils.get_null_value(array.parent.type)
        return array._getvalue()
    if isinstance(kind, types.BaseTuple):
        for i, part in enumerate(cast(Any, kind).types):
            inner = without_owner(context, builder, part, builder.extract_value(value, i))
            value = builder.insert_value(value, inner, i)
    return value


class _Borrow(Protocol):
    def __call__(self, value: _Value) -> _Value: ...


without_refcount = cast(_Borrow, _borrow)
"""An array, or a tuple that contains arrays, without reference counting; for compiled code only.

The original must outlive every use: compiled code may neither return nor store a borrowed array. It must be passed on
to a function at once, since numba regards assignments to an array made in the same function as dead code.
"""
