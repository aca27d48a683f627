"""The key of a unit: changes with everything that determines its code, and with nothing else."""

import dis
import sys
import types as python_types
from collections import namedtuple
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from numba import njit, typeof, types

from controllers.fields.algebra.instructions import LAW_ARGUMENTS
from controllers.fields.bunny import bunny_wrench
from controllers.fields.follow import follow_wrench
from controllers.fields.governor import governor_wrench
from controllers.fields.higher_order import higher_order_wrench
from controllers.fields.stretchy_tubes import stretchy_wrench
from controllers.haptic_map.cylindrical import cylindrical_map
from controllers.haptic_map.expressive import express
from controllers.haptic_map.lifted_kernel import lifted_map
from controllers.haptic_map.map_stages import MAP_ARGUMENTS
from controllers.haptic_map.river_clips import river_clips_map
from controllers.lent import Lent
from sim.compilation import unit_key as unit_key_module
from sim.compilation.unit_key import UnknownIngredient, UnknownName, describe_type, reached_functions, unit_key
from sim.loop.servo import run_block

SOURCE = (Path(__file__).parent / "toy_kernels.py").read_text(encoding="utf-8")
VECTOR = types.Array(types.float64, 1, "C")


@pytest.fixture
def keys(monkeypatch: pytest.MonkeyPatch):
    """Keys of the toy kernels `force` and `other` after a change of their source."""

    def of(old: str = "", new: str = "") -> tuple[str, str]:
        assert old in SOURCE
        module = python_types.ModuleType("toy")
        monkeypatch.setitem(sys.modules, "toy", module)
        exec(compile(SOURCE.replace(old, new) if old else SOURCE, f"/somewhere/{hash(new)}.py", "exec"), vars(module))
        spring = typeof(module.Spring(1.0, 0.0))
        return (
            unit_key(module.force.py_func, (spring, types.float64, VECTOR), {}),
            unit_key(module.other.py_func, (types.float64, VECTOR), {}),
        )

    return of


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("GAIN = 2.0\n", "# a comment\n\n\nGAIN = 2.0  # another\n"),
        ('    """How far."""\n', ""),
        ('    """How far."""\n', '    """How far it is stretched."""\n'),
        ("def other", "def one_more(x: float) -> float:\n    return x\n\n\n@njit\ndef other"),
        ("x: float, out: list[float]", "x, out"),
    ],
    ids=["comment", "no docstring", "docstring", "another function", "annotation"],
)
def test_changes_without_effect_on_code_leave_the_key(keys, old: str, new: str):
    assert keys(old, new) == keys()


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("GAIN = 2.0", "GAIN = 3.0"),
        ("GAIN = 2.0", "GAIN = 2"),
        ("x - spring.rest", "spring.rest - x"),
        ("GAIN * spring", "2.5 * GAIN * spring"),
        ("@njit\ndef stretch", "@njit(fastmath=True)\ndef stretch"),
        ("    stiffness: float\n    rest: float", "    rest: float\n    stiffness: float"),
    ],
    ids=["constant", "constant's type", "called function", "own code", "options", "tuple fields"],
)
def test_code_changes_alter_only_the_keys_of_functions_that_reach_them(keys, old: str, new: str):
    (force, other), (force_now, other_now) = keys(), keys(old, new)
    assert force_now != force
    assert other_now == other


MAPS = (cylindrical_map, lifted_map, river_clips_map, express)
LAWS = (follow_wrench, bunny_wrench, governor_wrench, higher_order_wrench, stretchy_wrench)


def _scaled(scale: object):
    @njit
    def kernel(x):
        return x * scale

    return kernel


def test_closure_variable_is_part_of_the_key():
    one, same, two = (unit_key(_scaled(scale).py_func, (types.float64,), {}) for scale in (1.0, 1.0, 2.0))
    assert one == same != two
    assert unit_key(_scaled(_scaled(1.0)).py_func, (), {}) != unit_key(_scaled(_scaled(2.0)).py_func, (), {})
    array = np.arange(3.0)
    first = unit_key(_scaled(array).py_func, (), {})
    assert unit_key(_scaled(array.copy()).py_func, (), {}) == first != unit_key(_scaled(array + 1.0).py_func, (), {})


def test_argument_types_and_options_are_part_of_the_key():
    function = _scaled(1.0).py_func
    keys = {
        unit_key(function, arguments, options)
        for arguments in ((types.float64,), (types.int64,), (VECTOR,), (types.Array(types.float64, 1, "A"),))
        for options in ({}, {"nogil": True}, {"boundscheck": True})
    }
    assert len(keys) == 12


@pytest.mark.parametrize(
    "value", [object(), [1.0], {1.0}, np.array([None]), Fraction(1, 2), np.random.default_rng(1), [].append]
)
def test_closure_value_without_a_key_is_an_error(value: object):
    with pytest.raises(UnknownIngredient, match="scale"):
        unit_key(_scaled(value).py_func, (types.float64,), {})


def test_lent_tuple_is_described_by_its_fields():
    pair, swapped = (typeof(namedtuple("Pair", names)(1.0, 2.0)) for names in ("a b", "b a"))
    described = [describe_type(kind) for kind in (pair, Lent(pair), Lent(swapped))]
    assert described[0] in described[1]
    assert described[1] != described[2]


def test_unknown_types_and_names_are_errors():
    with pytest.raises(UnknownIngredient, match="type"):
        describe_type(types.ListType(types.float64))
    namespace: dict[str, object] = {"__name__": "nowhere"}
    exec("def wrong(x):\n    return missing(x)\n", namespace)
    with pytest.raises(UnknownName, match="missing"):
        unit_key(namespace["wrong"], (), {})  # pyright: ignore[reportArgumentType]


def test_order_of_called_functions_is_part_of_the_key():
    def difference(first, second):
        @njit
        def kernel(x):
            return first(x) - second(x)

        return kernel

    one, two = _scaled(1.0), _scaled(2.0)
    assert unit_key(difference(one, two).py_func, (), {}) != unit_key(difference(two, one).py_func, (), {})


def test_numba_settings_are_part_of_the_key(monkeypatch: pytest.MonkeyPatch):
    from sim.compilation import unit_key as module

    before = unit_key(_scaled(1.0).py_func, (), {})
    module._platform.cache_clear()
    monkeypatch.setattr(module.config, "OPT", 1)
    assert unit_key(_scaled(1.0).py_func, (), {}) != before
    module._platform.cache_clear()


def test_keys_of_all_kernels_of_a_run_differ():
    given = [(run_block, ())] + [(kernel, LAW_ARGUMENTS) for kernel in LAWS]
    given += [(kernel, MAP_ARGUMENTS) for kernel in MAPS]
    keys = {unit_key(function.py_func, arguments, {}) for function, arguments in given}  # pyright: ignore
    assert len(keys) == len(given)


def test_loop_does_not_reach_laws_and_laws_do_not_reach_the_loop():
    loop = {f"{f.__module__}.{f.__qualname__}" for f in reached_functions(run_block.py_func)}  # pyright: ignore
    laws = {kernel.__name__ for kernel in LAWS}
    assert not {name.rsplit(".", 1)[1] for name in loop} & laws
    assert not any("whole_body" in name or "reference." in name for name in loop)
    follow = {f.__module__ for f in reached_functions(follow_wrench.py_func)}  # pyright: ignore
    assert all(name.startswith("controllers.") for name in follow)


def test_kernels_chosen_by_device_type_are_part_of_the_loop() -> None:
    reached = {f"{function.__module__}.{function.__qualname__}" for function in reached_functions(run_block.py_func)}
    for kernel in ("devices.exchange.sense_exchange", "devices.simulated.advance_simulated"):
        assert f"sim.{kernel}" in reached
    assert "controllers.safety.faults.judge_reading" in reached


def test_instructions_and_names_are_decoded_as_by_dis() -> None:
    kernels = (run_block, *LAWS, *MAPS)
    for function in {id(f): f for kernel in kernels for f in reached_functions(kernel.py_func)}.values():
        code = function.__code__
        read = [one for one in dis.get_instructions(code) if one.opname != "EXTENDED_ARG"]
        ours = [one for one in unit_key_module._instructions(code) if dis.opname[one[0]] != "CACHE"]
        assert ours == [(one.opcode, one.arg or 0) for one in read]
        named = {one.argval for one in read if one.opname == "LOAD_GLOBAL"}
        nested = [part for part in code.co_consts if isinstance(part, python_types.CodeType)]
        chains = unit_key_module._global_names(code.replace(co_consts=()) if nested else code)
        assert {chain[0] for chain in chains} == named
        attributes = {one.argval for one in read if one.opname in ("LOAD_ATTR", "LOAD_METHOD")}
        assert {name for chain in chains for name in chain[1:]} <= attributes


FIRST, SECOND = 1.0, 2.0


def test_first_of_two_adjacent_globals_is_part_of_the_key() -> None:
    def of_two(first: float) -> str:
        def pair():
            return max(FIRST, SECOND)

        scope = {"FIRST": first, "SECOND": 2.0, "__builtins__": __builtins__, "__name__": __name__}
        return unit_key(python_types.FunctionType(pair.__code__, scope), (), {})

    assert of_two(1.0) == of_two(1.0) != of_two(1.5)
