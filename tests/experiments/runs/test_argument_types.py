"""Arguments of `hvf` functions with a wrong type or value are refused at the call, by name."""

import re
from dataclasses import replace
from math import inf, nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hvf
from experiments.cli import main

CURVE = hvf.circle()
DANCE, CHEER = hvf.clips("squat_dance", "cheer")
MAP = hvf.Cylindrical([DANCE, CHEER], around=CURVE)
SIM = hvf.Simulation(field=hvf.Follow(CURVE, 300.0, 8.0), haptic_map=MAP, figure=hvf.Figure(kind="none"))
STUDY = hvf.Study.of(name="mine", factors={"stiffness": [100, 200]})
HALF = hvf.Weight.constant(0.5)
SPACE = {"field.k_r": (50.0, 200.0)}
VALID_ARGUMENTS: list[tuple[Any, dict[str, Any]]] = [
    (hvf.Cylindrical, {"clips": [DANCE], "around": CURVE, "reach": 0.02, "expressive": False}),
    (hvf.Composite, {"clips": [DANCE], "around": CURVE, "reach": 0.02, "expressive": False}),
    (hvf.Push, {"at": 1, "seconds": 1, "force": 1, "direction": (0, 0, 1), "place": (0, 0, 0), "radius": 0.1}),
    (hvf.Grab, {"at": 1, "carry": (0, 0, 1), "seconds": 1, "hold": 1, "place": (0, 0, 0), "steady": False}),
    (hvf.Turn, {"at": 1, "seconds": 1, "angle": 1, "axis": (0, 0, 1)}),
    (hvf.User, {"pushes": (), "turns": (), "grabs": (), "traces": CURVE, "person": hvf.Person()}),
    (hvf.Person, {"name": "mine", "age": 40}),
    (hvf.persona, {"name": "median"}),
    (hvf.population, {"number": 2, "seed": 1}),
    (hvf.circle, {"radius": 0.05, "lap": 4}),
    (hvf.Clip, {"poses": DANCE.poses, "name": "mine"}),
    (hvf.Simulation, {"field": SIM.field, "haptic_map": MAP, "user": hvf.User(), "device": SIM.device, "seed": 1}),
    (hvf.Search, {"candidates": 3, "sampler": "tpe", "costs": 1, "threads": 1, "allow_unknown": False, "seed": 1}),
    (hvf.Study, {"config": STUDY.config, "text": ""}),
    (hvf.intents.Trace, {"tempo": 1}),
    (hvf.intents.Exaggerate, {"larger": 2, "where": (0.1, 0.2)}),
    (hvf.intents.CutCorner, {"start": 0.1, "end": 0.2}),
    (hvf.intents.Press, {"pushes": (hvf.Push(1.0, 1.0, 2.0),)}),
    (hvf.sweep, {"sim": SIM, "values": {"seed": [1]}, "threads": 1}),
]
OPTIONAL = {"traces", "person", "direction", "place"}


@pytest.mark.parametrize(("make", "name"), [(make, name) for make, given in VALID_ARGUMENTS for name in given])
def test_argument_of_wrong_type_is_refused_by_name(make: Any, name: str) -> None:
    given = next(given for made, given in VALID_ARGUMENTS if made is make) | ({"fps": 30.0} if make is hvf.Clip else {})
    make(**given)
    for wrong in (object(), {"x": 1} if name != "values" else 3, hvf.Wrench, *(() if name in OPTIONAL else (None,))):
        with pytest.raises(hvf.HvfError, match=name):
            make(**given | {name: wrong})
    for wrong in ("1", True):
        if not isinstance(given[name], bool | str):
            with pytest.raises(hvf.HvfError, match=name):
                make(**given | {name: wrong})


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: hvf.certify(3), "sim is 3; expected Simulation"),  # pyright: ignore
        (lambda: hvf.certify(SIM, delay="1"), "delay is '1'; expected a number"),  # pyright: ignore
        (lambda: hvf.certify(SIM, delay=-1.0), "delay must be finite and at least 0 s, got -1.0"),
        (lambda: hvf.certify(SIM, delay=3.0), "the delay of a loop must be at most 128 periods of 0.001 s, got 3.0 s"),
        (lambda: hvf.load(None), "path is None; expected text or Path"),  # pyright: ignore
        (lambda: hvf.clips("walk", 3), "name is 3; expected text or Path"),  # pyright: ignore
        (lambda: hvf.Person(hand=np.ones(2)), "hand is array([1., 1.]); expected text"),  # pyright: ignore
        (lambda: hvf.Push(10**400, 1.0, 1.0), "expected a number"),
        (lambda: hvf.Study.load(3), "path is 3; expected text or Path"),  # pyright: ignore
        (lambda: hvf.law(3), "a law is made from a function law(hand, …); got 3"),  # pyright: ignore
        (lambda: hvf.rest_pose("tall"), "stature is 'tall'; expected more than 0 m, and finite"),  # pyright: ignore
        (lambda: hvf.Cylindrical(DANCE, around=CURVE), "expected a sequence, each Clip"),  # pyright: ignore
        (lambda: hvf.Composite([DANCE], around=CURVE, reach=-0.1), "reach is -0.1; expected more than 0 m, and finite"),
        (lambda: hvf.User(intent=hvf.intents.Trace), "expected PersonIntent or None"),  # pyright: ignore
        (lambda: hvf.Simulation(field=SIM.field, haptic_map=hvf.Cylindrical), "haptic_map is "),  # pyright: ignore
        (lambda: SIM.run("3"), "seconds is '3'; expected a number"),  # pyright: ignore
        (lambda: SIM.run(nan), "a run of nan s; expected 0.004 s or more, and finite"),
        (lambda: SIM.run(3.0, record=3), "record is 3; expected text or Path"),  # pyright: ignore
        (lambda: SIM.run(3.0, record="a\0b"), "record is 'a\\x00b'; expected a path without a null character"),
        (lambda: SIM.session(-1.0), "seconds is -1; expected more than 0 s, and finite"),
        (lambda: SIM.session(inf), "seconds is inf; expected more than 0 s, and finite"),
        (lambda: hvf.sweep(SIM, {"field.k_r": 300}), "field.k_r is 300; expected a sequence"),  # pyright: ignore
        (lambda: hvf.sweep(SIM, {"field.k_r": []}), "field.k_r has no values; expected one or more"),
        (lambda: hvf.tune(3, SPACE, len), "sim is 3; expected Simulation"),  # pyright: ignore
        (lambda: hvf.tune(SIM, SPACE, 3), "cost is 3; expected a function of a run"),  # pyright: ignore
        (lambda: hvf.tune(SIM, {"field.k_r": ("a", "b")}, len), "expected a sequence, each a number"),  # pyright: ignore
        (lambda: hvf.tune(SIM, SPACE, len, panel=(3,)), "expected a sequence, each User"),  # pyright: ignore
        (lambda: np.ones(2) * SIM.field, "s is array([1., 1.]); expected a number"),
        (lambda: hvf.circle(lap=1e10), "lap is 1e+10; expected at most 86400 s"),
        (lambda: hvf.Search(candidates=10**12), "candidates is 1000000000000; expected 1 to 1000000"),
        (lambda: hvf.Search(candidates=0), "candidates is 0; expected 1 to 1000000"),
        (lambda: hvf.Search(sampler="best"), "sampler is 'best'; expected one of tpe, cma-es, nsga-ii, random"),  # pyright: ignore
        (lambda: hvf.Clip(DANCE.poses, "30", "mine"), "30 frames per second; expected a positive number"),  # pyright: ignore
        (lambda: hvf.Clip(np.array([["1"] * 75]), 30.0, "mine"), "poses are no array of numbers"),
    ],
)  # fmt: skip
def test_message_says_what_is_expected(make: Any, message: str) -> None:
    with pytest.raises(hvf.HvfError) as error:
        make()
    assert message in str(error.value)


@pytest.mark.parametrize(("kind", "most"), [(hvf.Cylindrical, 4), (hvf.Composite, 3)])
def test_map_refuses_invalid_clip_counts_reach_and_curves(kind: Any, most: int) -> None:
    for number in (0, most + 1):
        with pytest.raises(
            hvf.ParameterError, match=f"^got {number} clips; expected 1 to {most} for the {kind.__name__.lower()} map$"
        ):
            kind([DANCE] * number, around=CURVE)
    assert kind([DANCE] * most, around=CURVE).parts
    with pytest.raises(hvf.ParameterError, match=r"reach is 0\.05 m about a curve of radius 0\.0477 m; expected less"):
        kind([DANCE], around=CURVE, reach=0.05)
    with pytest.raises(hvf.SimError, match="beyond the Phantom's stops"):
        kind([DANCE], around=hvf.circle(radius=0.5))


def test_tuning_refuses_too_many_trials() -> None:
    users = (hvf.User(),) * 3
    with pytest.raises(hvf.SimError, match="500000 candidates, 3 users are too many; expected at most 1000000 trials"):
        hvf.tune(SIM, SPACE, len, users, search=hvf.Search(candidates=500_000))  # pyright: ignore


@pytest.mark.parametrize("radius", [0.09, 0.5])
def test_curve_beyond_the_workspace_is_refused_as_on_the_command_line(
    radius: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", "--radius", str(radius), "--figure", "none", "--out", str(tmp_path / "run")]) == 2
    message = capsys.readouterr().err.removeprefix("hvf: ").strip()
    assert "beyond the Phantom's stops" in message
    far, rivers = hvf.circle(radius=radius), (hvf.River(CURVE), hvf.River(hvf.circle(radius=radius)))
    bundle = hvf.RiverBundle(rivers, ("near", "far"))
    higher = hvf.HigherOrder(bundle, admission=0.05, sigma=0.02)
    tubes = hvf.StretchyTubes(far, k_f=100, k_s=100)
    for field in (hvf.Follow(far, 300, 8), hvf.Bunny(far, 300, 8, 0.1), bundle, higher, tubes, rivers[1].gated(HALF)):
        with pytest.raises(hvf.SimError, match=f"^{re.escape(message)}$"):
            replace(SIM, field=field).session(1.0)
    with pytest.raises(hvf.SimError, match=f"^{re.escape(message)}$"):
        replace(SIM, user=hvf.User(traces=far)).session(1.0)


def test_energy_tank_with_another_period_than_the_clock_is_refused():
    """At half the period it would be refilled with twice the power."""
    tank = hvf.EnergyTank(1e-3, power=0.5, capacity=1.0)
    curve = hvf.circle(0.0477, 4.0)
    parts = {"field": hvf.Follow(curve, 300.0, 8.0), "haptic_map": hvf.Cylindrical(hvf.clips("walk"), around=curve)}
    hvf.Simulation(**parts, tank=tank)
    with pytest.raises(hvf.ParameterError, match=r"tank has a period of 0.001 s.*expected that of the clock, 0.0005 s"):
        hvf.Simulation(**parts, tank=tank, clock=hvf.Clock(servo_period=5e-4))
