"""Arguments of `hvf` functions with a wrong type or value are refused at the call, by name."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

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
