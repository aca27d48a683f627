"""Deferred code generation for numba: a function that only compiled code calls is not optimised and emitted by itself.

numba optimises each called function, links its callees into it, emits code for it and for a wrapper that Python could
call, and does the same again one level up. Here a called function is only typed and lowered; the unit that is called
from Python, or by address, links all of them, is optimised once and emitted once. Results are bit for bit the same.

This patches numba's internals. With an untested version numba is left unpatched, which is slower but correct.
"""

# pyright: reportPrivateUsage=false, reportAttributeAccessIssue=false
# The patched attributes are private to numba; TESTED lists the versions for which they are known.

import gc
from typing import Any
from weakref import WeakValueDictionary

import numba
from llvmlite import ir
from numba.core import base, codegen, cpu, dispatcher, sigutils
from numba.core.environment import lookup_environment

from sim.compilation.lost_interrupts import reraise_lost_interrupts
from sim.errors import SimError

TESTED = ("0.68",)
"""Minor versions of numba for whose internals the patches were tested."""

_SYMBOL = "_ZN"  # prefix of the names that numba gives to functions
_ENVIRONMENT = "_ZN08NumbaEnv"  # prefix of the names of their environments, which hold constants
_YOUNG = (20_000, 10, 1000)  # thresholds of Python's garbage collector without a full collection


class UndefinedSymbol(SimError):
    """A compiled unit refers to a function that none of its parts defines."""


class _NoEntry:
    """Placeholder for the entry point of a function that only compiled code calls."""


class _Depth:
    """Nesting depth of the compilation in progress, 1 for the outermost; protected by numba's compiler lock.

    What a compilation makes is needed until it ends: to look through all of it for garbage again and again takes a
    tenth of the time, so meanwhile only young objects are looked through.
    """

    now = 0
    thresholds = gc.get_threshold()

    def __enter__(self) -> None:
        if _Depth.now == 0:
            _Depth.thresholds = gc.get_threshold()
            gc.set_threshold(*_YOUNG)
        _Depth.now += 1

    def __exit__(self, *error: object) -> None:
        _Depth.now -= 1
        if _Depth.now == 0:
            gc.set_threshold(*_Depth.thresholds)


_defining: "WeakValueDictionary[str, UnitLibrary]" = WeakValueDictionary()


class UnitLibrary(codegen.JITCodeLibrary):
    """Code of one function: emitted if the compilation began with it, else only linked into the outer unit.

    Attributes
    ----------
    deferred : bool
        Whether it is only to be linked.
    """

    def __init__(self, *arguments: Any, **options: Any):
        super().__init__(*arguments, **options)
        self.deferred = _Depth.now > 1

    def add_ir_module(self, ir_module: ir.Module) -> None:
        """Add an IR module, and register the functions that it defines, for code that refers to them by name."""
        for function in ir_module.functions:
            if not function.is_declaration:
                _defining[function.name] = self
        super().add_ir_module(ir_module)

    def finalize(self) -> None:
        """Link, optimise and emit; if deferred, none of these."""
        if self.deferred:
            self._raise_if_finalized()
            self._finalized = True
            return
        self._linking_libraries = _needed(self._linking_libraries)
        super().finalize()
        # Recursive calls go by address, so the called functions must be emitted.
        for name in referred_by_name(self._final_module):
            if name in _defining and _defining[name].deferred:
                _defining[name].get_pointer_to_function(name)

    def get_pointer_to_function(self, name: str) -> int:
        """Address of a function; a deferred library is emitted first."""
        if self.deferred:
            self.deferred = self._finalized = False
            self.finalize()
        return super().get_pointer_to_function(name)

    def _optimize_functions(self, ll_module: Any) -> None:
        if not self.deferred:
            super()._optimize_functions(ll_module)
            return
        ll_module.data_layout = self._codegen._data_layout
        # numba would set up the passes anew for each function, even for mere declarations.
        passes, builder = self._codegen._function_pass_manager()
        for function in ll_module.functions:
            if not function.is_declaration:
                passes.run(function, builder)

    def _optimize_final_module(self) -> None:
        missing = undefined_symbols(self._final_module)
        if missing:
            raise UndefinedSymbol(f"{self.name} refers to {', '.join(sorted(missing))}, which nothing defines")
        super()._optimize_final_module()


def referred_by_name(module: Any) -> list[str]:
    """Functions that an LLVM module calls by addresses that numba resolves at run time: recursive ones."""
    prefix = codegen.RuntimeLinker.PREFIX
    return [v.name.removeprefix(prefix) for v in module.global_variables if v.name.startswith(prefix)]


def undefined_symbols(module: Any) -> set[str]:
    """Names of compiled functions that an LLVM module uses but does not define."""
    return {f.name for f in module.functions if f.is_declaration and f.name.startswith(_SYMBOL)}


def _needed(libraries: list[Any]) -> list[Any]:
    """Libraries and all their dependencies in link order, users first: LLVM links only symbols already referred to."""
    order: list[Any] = []
    seen: set[int] = set()

    def visit(library: Any) -> None:
        if id(library) not in seen:
            seen.add(id(library))
            if getattr(library, "deferred", False):
                for other in reversed(library._linking_libraries):
                    visit(other)
            order.append(library)

    for library in reversed(libraries):
        visit(library)
    return order[::-1]


def is_nested() -> bool:
    """Whether a compilation is in progress, so that a function compiled now becomes a part of its unit."""
    return _Depth.now > 0


def install() -> bool:
    """Install deferred code generation in this process, if this version of numba is a tested one.

    Returns
    -------
    bool
        Whether it is installed; repeated calls have no further effect.
    """
    if not any(numba.__version__.startswith(version + ".") for version in TESTED):
        return False
    kind = codegen.JITCPUCodegen
    if kind._library_class is not UnitLibrary:
        kind._library_class = UnitLibrary
        _count_depth()
        _spare_wrappers()
        _compile_anew_for_python()
    return True


def _count_depth() -> None:
    core, subroutine = dispatcher._FunctionCompiler._compile_core, base.BaseContext._compile_subroutine_no_cache

    def compile_core(self: Any, *arguments: Any, **options: Any) -> Any:
        with _Depth():
            return core(self, *arguments, **options)

    def compile_subroutine(self: Any, *arguments: Any, **options: Any) -> Any:
        with _Depth():
            return subroutine(self, *arguments, **options)

    dispatcher._FunctionCompiler._compile_core = compile_core
    base.BaseContext._compile_subroutine_no_cache = compile_subroutine


def _spare_wrappers() -> None:
    customize, executable = dispatcher._FunctionCompiler._customize_flags, cpu.CPUContext.get_executable
    add = dispatcher._DispatcherBase.add_overload

    def customize_flags(self: Any, flags: Any) -> Any:
        flags = customize(self, flags)
        if _Depth.now > 1:
            flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
        return flags

    def get_executable(self: Any, library: Any, fndesc: Any, env: Any) -> Any:
        entry = _NoEntry() if _Depth.now > 1 else executable(self, library, fndesc, env)
        if not library.deferred:
            _set_environments(library)
        return entry

    def add_overload(self: Any, result: Any) -> None:
        if isinstance(result.entry_point, _NoEntry):
            self.overloads[tuple(result.signature.args)] = result
        else:
            add(self, result)

    dispatcher._FunctionCompiler._customize_flags = customize_flags
    cpu.CPUContext.get_executable = get_executable
    dispatcher._DispatcherBase.add_overload = add_overload


def _set_environments(library: UnitLibrary) -> None:
    """Set the environments (constants) of all functions in emitted code, as numba does for cached code."""
    library._ensure_finalized()
    for variable in library._final_module.global_variables:
        environment = lookup_environment(variable.name) if variable.name.startswith(_ENVIRONMENT) else None
        if environment is not None and library.codegen._engine.get_global_value_address(variable.name):
            library.codegen.set_env(variable.name, environment)


def _compile_anew_for_python() -> None:
    """Make a function that was compiled as a part of a unit be compiled anew when Python calls it or needs its code."""
    compile_, result = dispatcher.Dispatcher.compile, dispatcher.Dispatcher.get_compile_result

    def forget_part(self: Any, arguments: tuple[Any, ...]) -> None:
        part = self.overloads.get(arguments)
        if _Depth.now == 0 and part is not None and isinstance(part.entry_point, _NoEntry):
            del self.overloads[arguments]

    def compile_signature(self: Any, signature: Any) -> Any:
        arguments, _ = sigutils.normalize_signature(signature)
        forget_part(self, tuple(arguments))
        with reraise_lost_interrupts():  # LLVM calls Python back with the object that it has made
            return compile_(self, signature)

    def get_compile_result(self: Any, signature: Any) -> Any:
        forget_part(self, tuple(signature.args))
        return result(self, signature)

    dispatcher.Dispatcher.compile = compile_signature
    dispatcher.Dispatcher.get_compile_result = get_compile_result
