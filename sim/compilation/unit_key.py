"""The cache key of a compiled unit: a hash of everything that its code depends on, and of nothing else.

The key is computed by a walk from the unit's function over the globals and closure variables that it names: functions
count by their bytecode, constants by their value, types by their fields. Comments, docstrings, line numbers and folders
do not count, so a unit is still found after a change that it does not depend on, and from another copy of the sources.
A value of unknown kind is an error, since the code might depend on it.
"""

# pyright: reportPrivateUsage=false, reportAttributeAccessIssue=false

import dis
import enum
import hashlib
import inspect
import sys
import types as python_types
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite
import mujoco
import numba
import numpy as np
from numba import config, types
from numba.core.dispatcher import Dispatcher
from numba.core.extending import _Intrinsic
from numba.core.registry import cpu_target

from controllers.lent import Lent
from sim.compilation import deferred_codegen
from sim.compilation.deferred_codegen import install
from sim.errors import SimError

Function = Callable[..., Any]

# numba's settings that affect the generated code; the others concern caches, threads and printing.
_SETTINGS = (
    "OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "BOUNDSCHECK", "DEBUGINFO_DEFAULT", "LLVM_REFPRUNE_PASS",
    "LLVM_REFPRUNE_FLAGS", "ENABLE_AVX", "USING_SVML", "DISABLE_JIT", "USE_LEGACY_TYPE_SYSTEM",
)  # fmt: skip
_LITERALS = (bool, int, float, complex, str, bytes, type(None), type(Ellipsis), np.generic)
_PLAIN_TYPES = (
    types.Number, types.Boolean, types.NoneType, types.Omitted, types.Literal, types.Array, types.CPointer,
    types.RawPointer, types.Record, types.UnicodeType, types.NumberClass, types.TypeRef,
)  # fmt: skip


class UnknownIngredient(SimError):
    """A function refers to a value that a key cannot be computed from."""


class UnknownName(SimError):
    """A function names a global that does not exist."""


def unit_key(function: Function, arguments: Iterable[Any], options: dict[str, Any]) -> str:
    """Key of a function compiled for given types of arguments: 24 hex digits.

    Parameters
    ----------
    function : callable
        The Python function, not the dispatcher.
    arguments : iterable of numba types
        Types of its arguments.
    options : dict
        Options of its compilation, a dispatcher's `targetoptions`.

    Raises
    ------
    UnknownIngredient
        If a value that it reaches is of an unknown kind.
    """
    digest = hashlib.sha256(repr((_platform(), [describe_type(argument) for argument in arguments])).encode())
    seen: dict[int, int] = {}
    pending: list[tuple[Function, dict[str, Any]]] = [(function, options)]
    # A function reached again is denoted by its place in the walk, which distinguishes functions of the same name.
    while pending:
        reached, its_options = pending.pop()
        if id(reached) in seen:
            digest.update(f"again {seen[id(reached)]};".encode())
            continue
        seen[id(reached)] = len(seen)
        digest.update(repr(_describe_options(its_options)).encode())
        described, callees = _describe_function(reached)
        digest.update(described)
        pending.extend(reversed(callees))
    return digest.hexdigest()[:24]


def reached_functions(function: Function) -> list[Function]:
    """All functions that are compiled into a unit of a given function, which comes first."""
    found, pending = {id(function): function}, [function]
    while pending:
        for other, _ in _describe_function(pending.pop())[1]:
            if id(other) not in found:
                found[id(other)] = other
                pending.append(other)
    return list(found.values())


@cache
def _platform() -> tuple[object, ...]:
    """Versions, processor and settings that compiled code depends on."""
    settings = tuple((name, repr(getattr(config, name, None))) for name in _SETTINGS)
    versions = (sys.version, numba.__version__, llvmlite.__version__, np.__version__, mujoco.__version__)
    return versions, cpu_target.target_context.codegen().magic_tuple(), settings, _code_generator()


def _code_generator() -> str:
    """The code generator: numba's own, or `deferred_codegen`, by the hash of its source file."""
    return hashlib.sha256(Path(deferred_codegen.__file__).read_bytes()).hexdigest() if install() else "numba"


_Callees = list[tuple[Function, dict[str, Any]]]


@cache
def _describe_function(function: Function) -> tuple[bytes, _Callees]:
    """Description of a function without its callees, and the functions it refers to with their options, in order."""
    callees: _Callees = []
    name = f"{function.__module__}.{function.__qualname__}"
    items: list[object] = [name, _describe_code(function.__code__, name)]
    items.append(_describe_value(function.__defaults__, name, callees))
    items.append(_describe_value(function.__kwdefaults__, name, callees))
    for free, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        items.append((free, _describe_value(cell.cell_contents, f"{name}: {free}", callees)))
    for chain in sorted(_global_names(function.__code__)):
        items.append((chain, _describe_global(function, chain, callees)))
    return repr(items).encode(), callees


def _instructions(code: python_types.CodeType) -> Iterator[tuple[int, int]]:
    """Opcodes with their arguments, as by `dis` but in a sixth of its time, which matters at the start of a run."""
    bytecode, high = code.co_code, 0
    for opcode, low in zip(bytecode[::2], bytecode[1::2], strict=True):
        argument = high | low
        if opcode == dis.EXTENDED_ARG:
            high = argument << 8
        else:
            high = 0
            yield opcode, argument


def _describe_code(code: python_types.CodeType, name: str) -> tuple[object, ...]:
    """Description of bytecode with its constants and names; without line numbers and docstring."""
    instructions: list[tuple[int, object]] = []
    for opcode, argument in _instructions(code):
        if opcode in _CONSTANT_LOADS:
            value = code.co_consts[argument]
            is_code = isinstance(value, python_types.CodeType)
            instructions.append((opcode, _describe_code(value, name) if is_code else _describe_constant(value, name)))
        else:
            instructions.append((opcode, argument))
    names = code.co_names, code.co_varnames, code.co_cellvars, code.co_freevars
    counts = (code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags & ~_HAS_DOCSTRING)
    return tuple(instructions), names, code.co_exceptiontable, counts


_HAS_DOCSTRING = 0x4000000  # a flag of code from Python 3.13 on
_CONSTANT_LOADS = frozenset(dis.hasconst)
_GLOBAL_LOADS = {dis.opmap["LOAD_GLOBAL"]: 1, dis.opmap["LOAD_NAME"]: 0}
_ATTRIBUTE_LOADS = {dis.opmap["LOAD_ATTR"]: 1} if sys.version_info >= (3, 12) else {
    dis.opmap["LOAD_ATTR"]: 0, dis.opmap["LOAD_METHOD"]: 0,
}  # fmt: skip
"""Opcodes that load a global, and an attribute of the last loaded value; the values are the number of low bits of the
argument that are not part of the name's index."""
_IGNORED_OPCODES = frozenset(dis.opmap[opcode] for opcode in ("CACHE", "PUSH_NULL") if opcode in dis.opmap)


def _describe_constant(value: object, name: str) -> object:
    if isinstance(value, tuple):
        return tuple(_describe_constant(item, name) for item in value)
    if isinstance(value, frozenset):
        return ("frozenset", sorted(repr(_describe_constant(item, name)) for item in value))
    return _describe_literal(value, name)


def _describe_literal(value: object, name: str) -> object:
    if isinstance(value, _LITERALS):
        return type(value).__name__, repr(value)
    raise UnknownIngredient(f"{name} is a {type(value).__qualname__}; expected a number, an array, a function, a type")


def _global_names(code: python_types.CodeType) -> set[tuple[str, ...]]:
    """Names of globals, each with the chain of attributes that is taken of it."""
    found: set[tuple[str, ...]] = set()
    chain: tuple[str, ...] = ()
    for opcode, argument in _instructions(code):
        if opcode in _GLOBAL_LOADS:
            found |= {chain} if chain else set()
            chain = (code.co_names[argument >> _GLOBAL_LOADS[opcode]],)
        elif opcode in _ATTRIBUTE_LOADS and chain:
            chain = (*chain, code.co_names[argument >> _ATTRIBUTE_LOADS[opcode]])
        elif opcode not in _IGNORED_OPCODES:
            found |= {chain} if chain else set()
            chain = ()
    for constant in code.co_consts:
        if isinstance(constant, python_types.CodeType):
            found |= _global_names(constant)
    return found


def _describe_global(function: Function, chain: tuple[str, ...], callees: _Callees) -> object:
    name = f"{function.__module__}.{function.__qualname__}: {'.'.join(chain)}"
    if chain[0] not in function.__globals__:
        builtins = function.__globals__["__builtins__"]
        known = builtins if isinstance(builtins, dict) else vars(builtins)
        if chain[0] not in known:
            raise UnknownName(f"{name} does not exist")
        return "builtin"
    value = function.__globals__[chain[0]]
    for attribute in chain[1:]:
        # Only attributes of modules and enumerations are followed; any other value is described as a whole.
        if not isinstance(value, python_types.ModuleType | enum.EnumType):
            break
        value = getattr(value, attribute)
    return _describe_value(value, name, callees)


def _describe_value(value: Any, name: str, callees: _Callees) -> object:
    """Description of a global, closure variable, default or option that differs for different values."""
    if isinstance(value, Dispatcher):
        callees.append((value.py_func, value.targetoptions))
        return "compiled function"
    if isinstance(value, _Intrinsic):
        callees.append((value._defn, {}))
        return "intrinsic"
    if isinstance(value, dict):
        return "dict", [
            (_describe_value(key, name, callees), _describe_value(item, name, callees)) for key, item in value.items()
        ]
    if isinstance(value, tuple):
        kind = _describe_class(type(value), name) if type(value) is not tuple else "tuple"
        return kind, [_describe_value(item, name, callees) for item in value]
    if isinstance(value, type):
        return _describe_class(value, name)
    if _is_library(value):
        return "library", type(value).__qualname__, str(getattr(value, "__module__", "")), _name_of(value)
    if isinstance(value, python_types.FunctionType):
        callees.append((value, {}))
        callees.extend((template._overload_func, template._jit_options) for template in _overloads(value))
        return "function"
    return _describe_datum(value, name)


def _describe_datum(value: Any, name: str) -> object:
    """Description of a value that refers to no Python function."""
    if isinstance(value, types.ExternalFunction):
        return "external", value.symbol, str(value.sig)
    if isinstance(value, types.Type):
        return "type", describe_type(value)
    if isinstance(value, enum.Enum):
        return "member", type(value).__qualname__, value.name, repr(value.value)
    if isinstance(value, np.ndarray):
        if value.dtype.hasobject:
            raise UnknownIngredient(f"{name} is an array of objects; expected numbers")
        content = hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()
        return "array", value.dtype.str, value.shape, value.flags.c_contiguous, content
    return ("dtype", repr(value)) if isinstance(value, np.dtype) else _describe_literal(value, name)


def _describe_options(options: dict[str, Any]) -> list[object]:
    callees: _Callees = []
    described: list[object] = [
        (key, _describe_value(options[key], f"option {key}", callees)) for key in sorted(options)
    ]
    return [*described, *(f"{other.__module__}.{other.__qualname__}" for other, _ in callees)]


def _describe_class(kind: type, name: str) -> tuple[object, ...]:
    """Description of a class: of a library by name; of this project NamedTuples, exceptions and numba types."""
    identity = (kind.__module__, kind.__qualname__)
    fields = getattr(kind, "_fields", None)
    if fields is not None:
        return "named tuple", *identity, fields, repr(getattr(kind, "_field_defaults", {}))
    if _is_library(kind) or issubclass(kind, BaseException):
        return "class", *identity
    if issubclass(kind, types.Type):  # its module defines its representation and lowering
        return "numba type", *identity, hashlib.sha256(Path(inspect.getfile(kind)).read_bytes()).hexdigest()
    raise UnknownIngredient(
        f"{name} is the class {kind.__qualname__}; expected a NamedTuple, an exception or a numba type"
    )


def _is_library(value: object) -> bool:
    """Whether a value is a module, class or function of a library, whose version is in the key already.

    Instances of a library's classes and their bound methods are not: their state is not determined by the version.
    """
    if isinstance(value, python_types.ModuleType):
        name: object = value.__name__
    elif callable(value) and _name_of(value) and isinstance(getattr(value, "__self__", None), _MODULE_OWNERS):
        name = getattr(value, "__module__", None) or type(value).__module__
    else:
        return False
    package = str(name).split(".")[0]
    return package in sys.stdlib_module_names - {"__main__"} or package in _LIBRARIES


_MODULE_OWNERS = (python_types.NoneType, python_types.ModuleType)
_LIBRARIES = ("numpy", "numba", "llvmlite", "mujoco")


def _name_of(value: object) -> str:
    return str(getattr(value, "__qualname__", getattr(value, "__name__", "")))


def _overloads(function: Function) -> Iterator[Any]:
    """Templates by which numba compiles calls of a plain Python function."""
    context = cpu_target.typing_context
    context.refresh()
    for template in getattr(context._lookup_global(function), "templates", ()):
        if hasattr(template, "_overload_func"):
            yield template


def describe_type(kind: Any) -> object:
    """Description of a numba type, including the field names of tuples, which the type's own name lacks.

    Raises
    ------
    UnknownIngredient
        If the type is of an unknown kind.
    """
    if isinstance(kind, types.NamedTuple | types.NamedUniTuple):
        inner = [describe_type(field) for field in kind.types]
        return kind.instance_class.__module__, kind.instance_class.__qualname__, kind.fields, inner
    if isinstance(kind, types.BaseTuple):
        return "tuple", [describe_type(item) for item in kind.types]
    if isinstance(kind, types.CPointer):
        return "pointer", describe_type(kind.dtype)
    if isinstance(kind, Lent):
        return "lent", describe_type(kind.kind)
    if isinstance(kind, _PLAIN_TYPES):
        return type(kind).__name__, str(kind)
    raise UnknownIngredient(f"the type {kind} is a {type(kind).__qualname__}; expected numbers, arrays and tuples")
