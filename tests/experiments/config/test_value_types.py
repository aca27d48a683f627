"""Types of configuration values: numbers, switches and names, from Python, words and files."""

import math
import re
from typing import Any, get_args, get_type_hints

import numpy as np
import pytest

from controllers.errors import ParameterError
from experiments.config.maps import Cylindrical
from experiments.config.options import run_config
from experiments.config.part import from_dict, from_json
from experiments.config.run_config import Figure, RunConfig
from experiments.trials.design.study_config import Users, Where, parse_study
from experiments.tuning.tune_config import Range, TuneConfig
from tests.experiments.config.test_options import NEEDED, PARTS

PLACES = [
    (cls, name)
    for cls in (*PARTS, Users, Where)
    for name, hint in get_type_hints(cls).items()
    if {int, float} & {hint, *get_args(hint)}
]


def _part(cls: Any, **values: object) -> Any:
    return cls(**NEEDED.get(cls, {}), **values)


@pytest.mark.parametrize(("cls", "name"), PLACES, ids=lambda value: getattr(value, "__name__", value))
def test_text_and_booleans_are_not_accepted_as_numbers(cls: Any, name: str) -> None:
    bounds = (getattr(bound, "ge", None) for bound in cls.__pydantic_fields__[name].metadata)
    right = max(1, *(math.ceil(bound) for bound in bounds if bound is not None), 0)
    for wrong in (True, np.True_, "1", str(right), ""):
        with pytest.raises(ParameterError, match=rf"^{name} is {re.escape(repr(wrong))}; expected a number$"):
            _part(cls, **{name: wrong})
    most = min((bound.le for bound in cls.__pydantic_fields__[name].metadata if hasattr(bound, "le")), default=right)
    for number in (right, np.int64(right), float(right), np.float32(right)) if right <= most else (most,):
        assert getattr(_part(cls, **{name: number}), name) == number


@pytest.mark.parametrize("wrong", [0, 1, "yes", "true", 1.0])
def test_switch_accepts_only_true_or_false(wrong: object) -> None:
    with pytest.raises(ParameterError, match=rf"^expressive is {wrong!r}; expected true or false$"):
        _part(Cylindrical, expressive=wrong)
    with pytest.raises(ParameterError, match=rf"^--walls is {wrong!r}; expected true or false$"):
        run_config(walls=wrong)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"seconds": true}', "seconds is True; expected a number"),
        ('{"mode": {"kind": "rivers", "stiffness": "300"}}', "mode.rivers.stiffness is '300'; expected a number"),
        ('{"map": {"kind": "cylindrical", "raw": 1}}', "map.cylindrical.raw is 1; expected true or false"),
        ('{"user": {"pushes": [{"at": "1", "seconds": 1, "force": 1}]}}', "user.pushes.0.at is '1'; expected a number"),
        ('{"user": {"person": {"age": true}}}', "user.person.age is True; expected a number"),
    ],
)
def test_wrong_type_in_file_is_named_by_its_path(text: str, message: str) -> None:
    with pytest.raises(ParameterError, match=rf"^my\.json: {re.escape(message)}$"):
        from_json(RunConfig, text, "my.json")


def test_integers_in_a_file_are_accepted_as_floats() -> None:
    text = '{"seconds": 3, "mode": {"kind": "follow", "stiffness": 200}, "figure": {"figure_ticks": 2.0}}'
    config = from_json(RunConfig, text, "my.json")
    assert config == run_config(seconds=3.0, stiffness=200.0)
    assert config.figure == Figure()


def test_non_numeric_study_and_tuning_values_are_refused() -> None:
    for values in ({"repetitions": True}, {"seconds": "8"}, {"users": {"number": True}}):
        with pytest.raises(ParameterError, match=r"expected a number$"):
            parse_study({"name": "mine", "factors": {"stiffness": [100, 300]}} | values, "my.toml")
    for bounds in ({"low": True, "high": 2}, {"low": 1, "high": "2"}):
        with pytest.raises(ParameterError, match=r"^my\.toml: space\.stiffness\..* expected a number$"):
            from_dict(TuneConfig, {"name": "mine", "space": {"stiffness": bounds}}, "my.toml")
    assert from_dict(TuneConfig, {"name": "a", "space": {"lap": {"low": 1, "high": 2}}}, "").space["lap"].high == 2.0


@pytest.mark.parametrize("end", ["low", "high"])
@pytest.mark.parametrize("value", [math.inf, -math.inf, math.nan])
def test_non_finite_range_bounds_are_refused(end: str, value: float) -> None:
    with pytest.raises(ParameterError, match=rf"^{end} is {value:g}; expected 0 or more, and finite$"):
        Range(**({"low": 0.0, "high": 1.0} | {end: value}))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"map": 3}, "--map is 3; expected a name"),
        ({"mode": ["follow"]}, "--mode is ['follow']; expected a name"),
        ({"replay": None}, "--replay is None; expected a name"),
        ({"around": {"lap": 3.0}}, "--around is not known; there are "),
        ({"does": "push"}, "--does is not known; there are "),
    ],
    ids=str,
)
def test_name_options_accept_only_text_and_part_names_are_unknown(words: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=f"^{re.escape(message)}"):
        run_config(**words)
