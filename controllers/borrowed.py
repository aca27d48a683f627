"""Arrays that compiled code borrows for the length of a call: it counts no references to them.

numba counts a reference, by an atomic instruction, for every array of a tuple that a function is handed, and for every
array that it takes out of one. For a loop that hands on a hundred arrays a tick these cost a tenth of its time, and
they guard what the caller keeps alive anyway.
"""

from typing import Any, Protocol, TypeVar, cast

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.arrayobj import make_array

_Value = TypeVar("_Value")


@intrinsic
def _borrowed(typingctx: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return without_owner(context, builder, value, values[0])

    return value(value), generate


def without_owner(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """The value of a type, in which no array knows whose memory it is in."""
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


class _Borrowed(Protocol):
    def __call__(self, value: _Value) -> _Value: ...


borrowed = cast(_Borrowed, _borrowed)
"""An array, or a tuple with arrays in it, whose references are not counted; for compiled code only.

What it is made from must outlive every use of it: compiled code may neither return it nor keep it. It is to be handed
on to a function at once: numba takes assignments to what is made in the same function for dead, and drops them.
"""
