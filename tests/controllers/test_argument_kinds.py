"""Checks of argument kinds: curves, numbers, flags, weights and hands of another kind raise with their name."""

import re
from collections.abc import Sequence
from math import nan
from typing import Any

import numpy as np
import pytest

from controllers.checks import check_callable, check_field_types, check_kind, numbers_of
from controllers.curves.trajectory import Trajectory
from controllers.errors import ControllerError, ParameterError
from controllers.fields.algebra.weights import Weight
from controllers.fields.bundle import RiverBundle
from controllers.fields.bunny import Bunny
from controllers.fields.follow import Follow
from controllers.fields.higher_order import HigherOrder
from controllers.fields.river import River
from controllers.fields.stretchy_tubes import StretchyTubes
from controllers.safety.energy_tank import EnergyTank
from controllers.state import HandState

CIRCLE = Trajectory.circle(0.05, 4.0)
FOLLOW = Follow(CIRCLE, 300.0, 8.0)
BUNDLE = RiverBundle((River(CIRCLE),), ("level",))
CONSTRUCTORS: list[tuple[Any, dict[str, Any]]] = [
    (Follow, {"curve": CIRCLE, "k_r": 300, "b_d": 8, "epsilon": 0.2, "parallel": False}),
    (Bunny, {"curve": CIRCLE, "k_r": 300, "b_d": 8, "delta": 0.05, "attraction": "point", "pace": "wait"}),
    (River, {"curve": CIRCLE, "epsilon": 0.02, "tau": 0.02, "drag": 4}),
    (RiverBundle, {"rivers": (River(CIRCLE),), "names": ("level",)}),
    (HigherOrder, {"bundle": BUNDLE, "admission": 0.1, "sigma": 0.1, "form": "smooth"}),
    (StretchyTubes, {"curve": CIRCLE, "k_f": 100, "k_s": 100, "until": 3, "then": FOLLOW, "depth": 4, "hold": "curve"}),
    (EnergyTank, {"period": 1e-3, "power": 1, "capacity": 1, "drain_time": 0.05}),
    (Trajectory.circle, {"radius": 0.05, "period": 4, "wave": 0.0}),
    (Weight.speed, {"low": 0.1, "high": 1}),
    (Weight.constant, {"s": 1}),
    (FOLLOW.limited, {"force": 3, "torque": 1}),
    (FOLLOW.gated, {"weight": Weight.switch()}),
    (FOLLOW.blended, {"other": FOLLOW, "weight": Weight.switch()}),
    (FOLLOW.wrench, {"hand": HandState.at((0.0, 0.0, 0.0))}),
]
WRONG = ("x", [1.0], {}, object(), np.zeros(2))


@pytest.mark.parametrize(("make", "name"), [(make, name) for make, valid in CONSTRUCTORS for name in valid])
def test_value_of_another_kind_raises_with_its_name(make: Any, name: str) -> None:
    valid = next(valid for constructor, valid in CONSTRUCTORS if constructor is make or constructor == make)
    make(**valid)
    for wrong in (*WRONG, *(() if isinstance(valid[name], bool) else (True,)), *(() if name == "then" else (None,))):
        with pytest.raises(ParameterError, match=rf"^{name} is .*; expected "):
            make(**valid | {name: wrong})


def test_message_states_the_expected_kind() -> None:
    for kind, expected in (
        (Trajectory, "Trajectory"), (float, "a number"), (int, "a whole number"), (bool, "True or False"),
        (Trajectory | None, "Trajectory or None"), (tuple[float, float], "2 numbers"),
        (tuple[float, ...], "a sequence, each a number"), (Sequence[Trajectory], "a sequence, each Trajectory"),
    ):  # fmt: skip
        with pytest.raises(ParameterError, match=f"^curve is 'x'; expected {expected}$"):
            check_kind("curve", "x", kind)
    with pytest.raises(ParameterError, match=r"^pace is 'runs'; expected one of clock, wait$"):
        Bunny(CIRCLE, 1.0, 1.0, 0.1, pace="runs")  # pyright: ignore[reportArgumentType]
    with pytest.raises(ParameterError, match=r"^the other field is 3; expected Law$"):
        FOLLOW + 3  # pyright: ignore[reportOperatorIssue, reportUnusedExpression]


def test_takes_accepts_only_functions_with_the_expected_arguments() -> None:
    for right in (lambda t, p: t, lambda t, p, s=1: t, lambda *those: those, max, print):
        check_callable("cost", right, "t", "p")
    for wrong, shown in (
        (3, "3"), (None, "None"), (lambda t: t, "<lambda>(t)"), (lambda t, p, s: t, "<lambda>(t, p, s)"),
        (len, "len(obj, /)"),
    ):  # fmt: skip
        with pytest.raises(ParameterError, match=f"^{re.escape(f'cost is {shown}; expected a function of t, p')}$"):
            check_callable("cost", wrong, "t", "p")


def test_numpy_scalars_are_accepted_as_numbers() -> None:
    for number in (np.float64(3.0), np.float32(3.0), np.int64(3), 3):
        check_field_types(Follow(CIRCLE, number, number, epsilon=number, parallel=np.bool_(True)))  # pyright: ignore
    check_kind("direction", np.zeros(3), tuple[float, float, float])
    with pytest.raises(ParameterError, match=r"^direction is .*; expected 3 numbers$"):
        check_kind("direction", (0.0, 1.0), tuple[float, float, float])


@pytest.mark.parametrize("wrong", [None, "x", ["1", "2"], [[0.0], [1.0, 2.0]], {}, [True, False], [None, 1.0]])
def test_samples_that_are_not_numbers_raise(wrong: Any) -> None:
    with pytest.raises(ParameterError, match=r"^samples is .*; expected numbers, with rows of equal lengths$"):
        numbers_of("samples", wrong)
    for given in ({"times": wrong}, {"positions": wrong}):
        with pytest.raises(ControllerError):
            Trajectory(**({"times": [0.0, 1.0], "positions": [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]} | given))


def test_position_without_three_numbers_raises() -> None:
    with pytest.raises(ControllerError, match="the centre of a circle is"):
        Trajectory.circle(0.05, 4.0, centre=(0.0, 0.0))
    with pytest.raises(ParameterError, match="the centre of a ball is"):
        Weight.ball((0.0, 0.0), 0.1)
    with pytest.raises(ParameterError, match=r"the hand has 14 numbers; expected 15"):
        FOLLOW.wrench(HandState.at((0.0, 0.0)))


@pytest.mark.parametrize("make", [lambda x: Trajectory.circle(x, 4.0), lambda x: Trajectory.circle(0.05, x)])
@pytest.mark.parametrize("wrong", [nan, -1.0, float("inf"), 0.0])
def test_circle_with_invalid_size_or_period_raises(make: Any, wrong: float) -> None:
    with pytest.raises(ControllerError):
        make(wrong)
