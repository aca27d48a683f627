"""A person in a configuration: by name on the command line, written out in the file, invalid ones refused."""

from dataclasses import replace
from pathlib import Path
from typing import get_args

import pytest

import hvf
from controllers.errors import ParameterError
from experiments.cli import main
from experiments.config.options import options_of, run_config, with_options
from experiments.config.part import from_json, to_json
from experiments.config.run_config import Does, RunConfig
from experiments.setups.parts.hands import intent_of
from experiments.studies.user_laws.report import lines, user_laws
from sim.errors import SimError
from sim.users.intents import Bend, Exaggerate, Press
from sim.users.person.person import Person
from sim.users.person.population import population


def test_named_person_is_written_out_in_the_file() -> None:
    config = run_config(person="novice", user="trace")
    assert config.user.person == hvf.persona("novice")
    assert from_json(RunConfig, to_json(config), "here") == config
    assert run_config(**options_of(config)) == config  # pyright: ignore[reportArgumentType]


def test_changed_configuration_keeps_or_replaces_the_person() -> None:
    config = run_config(person="7:2")
    assert with_options(config, {"seconds": 3.0}).user.person == population(3, 7)[2]
    assert with_options(config, {"person": "elder"}).user.person == hvf.persona("elder")


def test_default_user_has_no_person() -> None:
    assert run_config().user.person is None


@pytest.mark.parametrize("does", [kind for kind in get_args(Does) if kind not in ("turn", "lead")])
def test_every_kind_of_hand_has_an_intent_of_a_person_and_a_line_in_the_docs(does: str) -> None:
    intent = type(intent_of(run_config(user=does, person="median").user)).__name__
    page = Path("docs/explanation/simulated-users.md").read_text(encoding="utf-8")
    assert does == "push" or f"| {does} | `{intent}` |" in page


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"person": "nobody"}, "median, expert"),
        ({"user": "exaggerate"}, "add a person"),
        ({"user": "turn", "person": "median"}, "does not turn"),
        ({"user": "fly", "person": "median"}, "no user"),
    ],
)
def test_inapplicable_person_options_are_refused(words: dict[str, object], message: str) -> None:
    with pytest.raises((ParameterError, SimError), match=message):
        run_config(**words)  # pyright: ignore[reportArgumentType]


def test_invalid_person_number_in_file_is_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = to_json(run_config(person="median")).replace('"visual_delay": 0.2', '"visual_delay": -0.2')
    (tmp_path / "config.json").write_text(text)
    assert main(["run", "--config", str(tmp_path / "config.json"), "--out", str(tmp_path / "out")]) == 2
    stderr = capsys.readouterr().err
    assert "visual_delay" in stderr
    assert "expected 0.15 to 0.25 s" in stderr
    assert stderr.count("\n") == 1


def test_user_actions_map_to_person_intents() -> None:
    user = run_config(person="median", user="exaggerate").user
    assert isinstance(intent_of(user), Exaggerate)
    assert isinstance(intent_of(replace(user, does="push", pushes=(hvf.Push(1.0, 1.0, 2.0),))), Press)
    assert isinstance(
        intent_of(replace(user, does="relaxed", grabs=(hvf.Grab(1.0, (0, 0, 0), place=(0, 0, 0)),))), Bend
    )


def test_intent_without_person_is_refused() -> None:
    user = hvf.User(intent=hvf.intents.Trace())
    with pytest.raises(ParameterError, match="person"):
        user.hand(hvf.circle(), 1.0, 1)


def test_unknown_user_law_is_refused_with_the_known_names(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="fitts, scatter"):
        user_laws(2, 1, ("gravity",))
    assert main(["users", "--people", "0", "--out", str(tmp_path)]) == 2
    assert lines([])[0].split() == ["here", "published", "source"]


def test_single_person_parameter_can_be_replaced() -> None:
    person = replace(hvf.persona("median"), grip=4.0)
    assert isinstance(person, Person)
    assert person.grip == 4.0
