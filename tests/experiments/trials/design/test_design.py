"""Designs of studies: orders, groups, trial keys, and refused designs."""

from collections import Counter
from itertools import pairwise
from pathlib import Path

import pytest

from controllers.errors import ParameterError
from experiments.config.maps import Circle, Cylindrical
from experiments.setups.parts.clips import load_clips
from experiments.trials.design.design import balanced_latin_square, conditions, design_trials
from experiments.trials.design.plan import file_digest, plan_trials
from experiments.trials.design.study_config import StudyError, parse_study, read_toml
from experiments.trials.study import Study
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip
from models.mocap.readers.own_bvh import write_bvh

EXAMPLES = sorted((Path(__file__).resolve().parents[4] / "examples/studies").glob("*.toml"))


def study(**values: object):
    return parse_study({"name": "s", "factors": {"stiffness": [100, 300]}} | values, "study")


@pytest.mark.parametrize("n", range(2, 9))
def test_order_is_balanced_in_positions_and_sequences(n: int) -> None:
    rows = balanced_latin_square(n)
    places = Counter((place, condition) for row in rows for place, condition in enumerate(row))
    follows = Counter(pair for row in rows for pair in pairwise(row))
    assert set(places.values()) == {len(rows) // n}
    assert len(places) == n * n
    assert set(follows.values()) == {len(rows) // n}
    assert len(follows) == n * (n - 1)


def test_within_users_every_user_meets_every_condition() -> None:
    design = study(factors={"stiffness": [1, 2, 3], "damping": [4, 5]}, repetitions=2, users={"number": 7})
    met = design_trials(design)
    assert len(conditions(design)) == 6
    assert set(Counter((m.user, m.number) for m in met).values()) == {2}
    assert all(sorted(m.position for m in met if m.user == user) == list(range(12)) for user in range(7))


def test_between_users_groups_are_equal_with_one_level_each() -> None:
    design = study(factors={"stiffness": [1, 2], "damping": [4, 5, 6]}, between=["damping"], users={"number": 9})
    levels = {
        user: {m.condition.levels["damping"] for m in design_trials(design) if m.user == user} for user in range(9)
    }
    assert all(len(met) == 1 for met in levels.values())
    assert set(Counter(next(iter(met)) for met in levels.values()).values()) == {3}


def test_more_users_keep_the_trials_of_earlier_ones() -> None:
    few, many = (plan_trials(study(users={"number": number})) for number in (3, 5))
    assert [trial.key for trial in few] == [trial.key for trial in many[: len(few)]]
    assert len({trial.key for trial in many}) == len(many)


def test_people_lead_in_lead_mode() -> None:
    design = study(factors={"leash": [0.05, 0.1]}, run={"mode": "lead", "figure": "kinematic"})
    assert {trial.config.user.does for trial in plan_trials(design)} == {"lead"}


def test_trial_key_depends_on_device_file_content(tmp_path: Path) -> None:
    file, keys = tmp_path / "device.json", set[str]()
    for content in ("{}", '{"identified": {}}'):
        file.write_text(content, encoding="utf-8")
        file_digest.cache_clear()
        keys.add(plan_trials(study(run={"device_file": str(file)}))[0].key)
    assert len(keys) == 2


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"factors": {}}, "has no factors"),
        ({"factors": {"stiffness": []}}, "'stiffness' has no levels"),
        ({"factors": {"stiffness": [1]}}, "has one level"),
        ({"factors": {"stifness": [1, 2]}}, "stifness is not known"),
        ({"factors": {"stiffness": [-1, 2]}}, "stiffness is "),
        ({"factors": {"map": ["cylindrical", "spherical"]}}, "spherical"),
        ({"factors": {"guidance": {"none": {}, "river": {"mode": "flood"}}}}, "flood"),
        ({"factors": {"stiffness": [1, 2], "k": {"a": {"stiffness": 3}, "b": {"damping": 1}}}}, "both set 'stiffness'"),
        ({"factors": {"gain": {"a": {"stiffness": 3}, "b": {"stiffness": 3.0}}}}, "are the same"),
        ({"factors": {"user": ["trace", "exaggerate"]}}, "'user' has the name of another column"),
        ({"factors": {"effort": {"a": {"stiffness": 3}, "b": {"stiffness": 4}}}}, "'effort' has the name of another"),
        ({"users": {"does": "fly"}}, "no user 'fly'"),
        ({"between": ["map"]}, "no factor 'map'"),
        ({"between": ["stiffness"], "users": {"number": 1}}, "2 groups between users and 1 users"),
        ({"repetitions": 10**11}, "100000000000 repetitions are too many; expected at most 1000000 trials"),
        ({"factors": {f"f{k}": {str(n): {} for n in range(10)} for k in range(12)}}, "1000000000000 conditions"),
        (
            {"factors": {"stiffness": [100, 200]}, "run": {"stiffness": 300}},
            "stiffness = 300, which every condition replaces",
        ),
        ({"run": {"seconds": 3}}, "sets 'seconds' as an option of its runs"),
        ({"factors": {"clips": {"a": {"clips": ["gone.bvh"]}, "b": {"clips": ["walk"]}}}}, "gone.bvh"),
        ({"factors": {"arm": {"a": {"device_file": "gone.json"}, "b": {"device_file": "no.json"}}}}, "gone.json"),
    ],
)  # fmt: skip
def test_contradictory_design_is_refused_in_one_line(values: dict[str, object], message: str) -> None:
    with pytest.raises(StudyError, match=message) as raised:
        plan_trials(study(**values))
    assert "\n" not in str(raised.value)


def test_lap_that_motion_files_choose_is_in_the_plan_and_found_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_bvh(embedded("jump"), tmp_path / "leap.bvh")
    loads: list[tuple[str, ...]] = []

    def load(names: tuple[str, ...], raw: bool) -> tuple[tuple[Clip, ...], tuple[str, ...]]:
        loads.append(names)
        return load_clips(names, raw)

    monkeypatch.setattr("experiments.setups.parts.clips.load_clips", load)
    trials = plan_trials(study(run={"clips": [str(tmp_path / "leap.bvh")]}, repetitions=3))
    assert len(trials) > len(loads) == 2  # one for each condition
    assert {trial.config.map for trial in trials} == {Cylindrical(clips=loads[0], around=Circle(lap=4.8))}


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"repetitions": 0}, "repetitions is "),
        ({"order": "random"}, "order is "),
        ({"subjects": 3}, "subjects"),
        ({"factors": "map"}, "factors is 'map'"),
        ({"factors": {"map": {"a": 3, "b": 4}}}, "factors.map.a is 3"),
        ({"users": 3}, "users is 3"),
        ({"between": "map"}, "between is 'map'"),
    ],
)
def test_unknown_or_invalid_study_value_is_refused_by_name(values: dict[str, object], message: str) -> None:
    with pytest.raises(ParameterError, match=message) as raised:
        study(**values)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("levels", "message"),
    [([1, 2, 1], "has level 1 twice"), (3, "'stiffness' is 3; expected a list of values, or a table of levels")],
)
def test_invalid_or_duplicate_levels_are_refused(levels: object, message: str) -> None:
    with pytest.raises(StudyError, match=message):
        study(factors={"stiffness": levels})


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"measures": ["speed"]}, "no measure 'speed'"),
        ({"run": {"figure": "none"}, "measures": ["fell"]}, "physical"),
        ({"run": {"figure": "none"}, "cost": "fell"}, "physical"),
        ({"run": {"figure": "none"}, "ease": "expressiveness"}, "kinematic"),
    ],
)
def test_unavailable_measure_is_refused(values: dict[str, object], message: str) -> None:
    with pytest.raises(StudyError, match=message):
        Study(study(**values)).run("nowhere")


@pytest.mark.parametrize("path", [p for p in EXAMPLES if "space" not in p.read_text()], ids=lambda path: path.stem)
def test_example_studies_can_be_planned(path: Path) -> None:
    assert plan_trials(parse_study(read_toml(path, "a study"), str(path)))


def test_study_saved_on_windows_is_the_same(tmp_path: Path) -> None:
    quick, file = next(path for path in EXAMPLES if path.stem == "quick"), tmp_path / "quick.toml"
    with file.open("w", encoding="utf-8-sig", newline="\r\n") as windows:
        windows.write(quick.read_text(encoding="utf-8"))
    assert Study.load(file) == Study.load(quick)


def test_invalid_toml_is_refused_with_its_line(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text("name = ]\n", encoding="utf-8")
    with pytest.raises(StudyError, match="line 1"):
        read_toml(tmp_path / "s.toml", "a study")
    with pytest.raises(StudyError, match="No such file"):
        read_toml(tmp_path / "gone.toml", "a study")
