"""Every number that can be typed has an interval, and one outside is refused by the name of its option."""

from dataclasses import dataclass, field, fields, replace
from math import inf, nan

import pytest
from experiments.config.options import Interval, above, at_least, check_numbers

from controllers.errors import ParameterError
from experiments.config.run_config import ArmConfig
from experiments.config.words import run_config

CONFIGS = (run_config(), ArmConfig())
NUMBERS = [(config, option) for config in CONFIGS for option in fields(config) if "interval" in option.metadata]


@dataclass(frozen=True)
class Inner:
    length: float = above(0.0, 1.0, "m")


@dataclass(frozen=True)
class Outer:
    wide_gap: float | None = at_least(0.5, None, "s")
    reach: float = at_least(1.0, 2.0, infinite=True)
    name: str = "any"
    inner: Inner = field(default_factory=Inner)


def test_no_number_of_a_configuration_is_without_an_interval() -> None:
    for config in CONFIGS:
        numbers = {o.name for o in fields(config) if type(getattr(config, o.name)) in (int, float)}
        assert numbers - {o.name for of, o in NUMBERS if of is config} == set()
        check_numbers(config)


@pytest.mark.parametrize(("config", "option"), NUMBERS, ids=lambda value: getattr(value, "name", ""))
def test_a_number_outside_its_interval_is_refused_by_its_option(config, option) -> None:
    interval: Interval = option.metadata["interval"]
    flag = "--" + option.name.replace("_", "-")
    wrong = [-1.0, -inf, nan] + [0.0] * (interval.open or interval.least > 0.0) + [inf] * (not interval.infinite)
    for value in wrong:
        with pytest.raises(ParameterError, match=rf"^{flag} is {value:g}; expected "):
            check_numbers(replace(config, **{option.name: value}))


def test_the_message_says_what_would_be_right() -> None:
    for options, said in (
        (Outer(wide_gap=0.4), "--wide-gap is 0.4; expected 0.5 s or more, and finite"),
        (Outer(reach=0.0), "--reach is 0; expected 1 or more"),
        (Outer(inner=Inner(0.0)), "--length is 0; expected more than 0 m, and finite"),
    ):
        with pytest.raises(ParameterError) as error:
            check_numbers(options)
        assert str(error.value) == said
    check_numbers(Outer(wide_gap=0.5, reach=inf))
