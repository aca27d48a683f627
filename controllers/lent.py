"""Named tuples lent to compiled functions: one pointer is passed, and fields are read by name where they are needed.

numba passes a tuple field by field, every array as its pointers, shape and strides, and counts a reference for each. A
call with a state of sixty arrays thus has several hundred arguments, which take most of the time to compile its kernel.
A lent tuple is one argument, arrays read from it are not counted (see `controllers.borrowed`), and code that reads a
field by its name is the same for a tuple and for a lent one.
"""

from typing import Any, Protocol, TypeVar, cast

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import intrinsic, lower_getattr_generic, models, register_model

from controllers.borrowed import without_owner

_Tuple = TypeVar("_Tuple")
_INDEX_TYPE = ir.IntType(32)


class Lent(types.Type):
    """Numba type of a lent tuple.

    Parameters
    ----------
    kind : numba type
        Type of the named tuple.
    """

    def __init__(self, kind: Any):
        self.kind = kind
        super().__init__(name=f"Lent({kind})")

    @property
    def key(self) -> object:
        """Identity of the type: the type of the tuple, since its name does not include the names of its fields."""
        return self.kind

    @property
    def instance_class(self) -> type:
        """Class of the named tuple."""
        return cast(type, self.kind.instance_class)


def _is_named_tuple(kind: Any) -> bool:
    return isinstance(kind, types.NamedTuple | types.NamedUniTuple)


@register_model(Lent)
class _LentPointer(models.PrimitiveModel):
    def __init__(self, manager: Any, lent: Lent):
        super().__init__(manager, lent, manager.lookup(lent.kind).get_value_type().as_pointer())


@infer_getattr
class _LentFields(AttributeTemplate):
    key = Lent

    def generic_resolve(self, lent: Lent, name: str) -> Any:
        if name not in lent.kind.fields:
            return None
        field = lent.kind.types[lent.kind.fields.index(name)]
        return Lent(field) if _is_named_tuple(field) else field


@lower_getattr_generic(Lent)
def _read_field(context: Any, builder: Any, lent: Lent, whole: Any, name: str) -> Any:
    index = lent.kind.fields.index(name)
    pointer = builder.gep(whole, [_INDEX_TYPE(0), _INDEX_TYPE(index)], inbounds=True)
    field = lent.kind.types[index]
    return pointer if _is_named_tuple(field) else without_owner(context, builder, field, builder.load(pointer))


@intrinsic
def _lend(typingctx: Any, value: Any) -> Any:
    lent = isinstance(value, Lent)

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return values[0] if lent else cgutils.alloca_once_value(builder, values[0])

    return (value if lent else Lent(value))(value), generate


class _Lend(Protocol):
    def __call__(self, value: _Tuple) -> _Tuple: ...


by_pointer = cast(_Lend, _lend)
"""Lend a named tuple to functions that compiled code calls: valid as long as the caller runs and keeps the tuple.
A tuple that is already lent is passed on unchanged."""
