"""Tuning of gains: search, constraint by certificates, storage, and the result."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import get_args

import pytest

pytest.importorskip("optuna")

import hvf
from controllers.certificates.loop import governed
from controllers.certificates.report import Verdict
from controllers.errors import ParameterError
from experiments.certify.cached_stability import Stability, cached_stability
from experiments.config.options import run_config
from experiments.config.paths import load_config
from experiments.trials.design.study_config import StudyError, Where
from experiments.trials.execution.database import Database
from experiments.trials.execution.executors import Threads
from experiments.trials.trial.run_trial import Row, Task
from experiments.tuning import search as searching
from experiments.tuning import tune as tuning_from_python
from experiments.tuning.panel import Panel
from experiments.tuning.search import Candidate, best_candidate, pareto_front, search, storage_of, violation_of
from experiments.tuning.tune import TunedSimulation, _study_name
from experiments.tuning.tune_config import Sampler, TuneConfig, check_tuning, read_tuning
from experiments.tuning.tuning import CHOSEN, run_tuning

EXAMPLES = Path(__file__).resolve().parents[3] / "examples/studies"
TUNING: dict[str, object] = {
    "name": "t", "run": {"figure": "none"}, "seconds": 0.5, "candidates": 11,
    "space": {"stiffness": {"low": 20.0, "high": 20000.0, "log": True}, "damping": {"low": 2.0, "high": 20.0}},
    "users": {"number": 2, "seed": 1}, "held_back": {"number": 3, "seed": 2},
}  # fmt: skip


def tuning(**values: object) -> TuneConfig:
    return TuneConfig(**(TUNING | values))  # pyright: ignore


@pytest.fixture
def certificates(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stability boundary at 5000 N/m, in place of certification, which takes seconds per candidate."""

    def verdict(config) -> Stability:
        margin = 5000.0 / config.mode.stiffness - 1.0
        return Stability("certified" if margin > 0.0 else "refuted", margin, "a boundary at 5000 N/m")

    monkeypatch.setattr(searching, "cached_stability", verdict)


def searched(config: TuneConfig, folder: Path, sampler: str = "tpe") -> list[Candidate]:
    with Database(folder / "tune.sqlite", "identity", config.name, "") as database:
        storage = storage_of(config.storage or folder / "journal")
        return search(config, storage, "identity", Panel(database, Threads(1)), sampler, lambda n: None)


@pytest.mark.usefixtures("certificates")
def test_refuted_candidates_are_never_simulated(tmp_path: Path) -> None:
    found = searched(tuning(), tmp_path)
    refused = [c for c in found if c.values["stiffness"] >= 5000.0]
    assert refused
    assert all(c.state == "refused" and c.objectives is None and c.verdict == "refuted" for c in refused)
    assert sum(c.state != "refused" for c in found) == 11


@pytest.mark.parametrize("name", get_args(Sampler))
def test_every_search_method_has_its_sampler_and_is_documented(name: str) -> None:
    assert searching.sampler_of(name, 1, 0) is not None
    assert f'"{name}"' in str(hvf.Search.__doc__)
    line = next(line for line in Path("docs/how-to/tuning.md").read_text().splitlines() if line.startswith("sampler ="))
    assert name in line


@pytest.mark.usefixtures("certificates")
@pytest.mark.parametrize("sampler", ["tpe", "random"])
@pytest.mark.slow
def test_resumed_search_equals_an_uninterrupted_one(tmp_path: Path, sampler: str) -> None:
    whole = searched(tuning(), tmp_path / "whole", sampler)
    searched(tuning(candidates=4), tmp_path / "stopped", sampler)
    _leave_an_unfinished_trial(tmp_path / "stopped")
    assert searched(tuning(), tmp_path / "stopped", sampler) == whole


@pytest.mark.usefixtures("certificates")
def test_search_by_changed_code_keeps_no_candidate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = searched(tuning(candidates=2), tmp_path)
    monkeypatch.setattr(searching, "code_hash", lambda module: "changed")
    (tmp_path / "tune.sqlite").unlink()
    assert searched(tuning(candidates=1), tmp_path) == before[:1]  # proposed and tried again


@pytest.mark.slow
@pytest.mark.usefixtures("certificates")
def test_objectives_use_the_tasks_that_provide_them(tmp_path: Path) -> None:
    trade = {"objectives": ["tracking_error", "expressiveness"], "run": {"figure": "kinematic"}, "candidates": 1}
    candidates = searched(tuning(tasks=["trace", "exaggerate"], **trade), tmp_path / "both")
    assert candidates[0].objectives is not None
    assert all(value > 0.0 for value in candidates[0].objectives)
    with pytest.raises(StudyError, match=r"no trial of its users has 'expressiveness'; expected tasks"):
        searched(tuning(**trade), tmp_path / "one")


class _Failing:
    """An executor whose second trial fails."""

    def rows(self, tasks: Iterable[Task]) -> Iterator[Row]:
        for k, task in enumerate(tasks):
            state, measures = ("failed", {}) if k == 1 else ("done", {"tracking_error": 1e-9})
            yield Row(task.key, state, "", measures, 0.0, "", "")


@pytest.mark.usefixtures("certificates")
def test_candidate_with_a_failed_trial_is_not_chosen(tmp_path: Path) -> None:
    with Database(tmp_path / "tune.sqlite", "identity", "t", "") as database:
        config, storage = tuning(candidates=1, prune=False), storage_of(tmp_path / "journal")
        found = search(config, storage, "identity", Panel(database, _Failing()), "random", lambda n: None)
    assert best_candidate(found, config.directions) is None
    assert found[-1].state == "given up"


@pytest.mark.usefixtures("certificates")
@pytest.mark.slow
def test_database_search_equals_journal_search_and_resumes(tmp_path: Path) -> None:
    whole, url = searched(tuning(candidates=5), tmp_path / "journal"), f"sqlite:///{tmp_path}/tune.db"
    searched(tuning(candidates=2, storage=url), tmp_path / "database")
    assert searched(tuning(candidates=5, storage=url), tmp_path / "database") == whole


@pytest.mark.parametrize("text", ["root:x:0:0\nme:x:1:1\n", "a line", "[1, 2]\n", "5\n", '{"a": 1}\n'])
def test_foreign_file_as_journal_is_refused_and_unchanged(text: str, tmp_path: Path) -> None:
    file = tmp_path / "mine"
    file.write_text(text)
    with pytest.raises(StudyError, match="mine: is no journal of a search, and is left as it is; expected a new file"):
        storage_of(file)
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]
    assert file.read_text() == text


def test_unreachable_storage_is_refused_in_one_line() -> None:
    for url in ("nosuch://host/base", "sqlite:////no/such/folder/tune.db"):
        with pytest.raises(StudyError, match="no storage for a search") as raised:
            storage_of(url)
        assert "\n" not in str(raised.value)


def test_pruned_candidate_has_no_objectives() -> None:
    import optuna

    study = optuna.create_study()
    trial = study.ask({"stiffness": optuna.distributions.FloatDistribution(1.0, 2.0)})
    for name, value in (("verdict", "certified"), ("margin", 2.0), ("violation", 0.0)):
        trial.set_user_attr(name, value)
    trial.report(0.1, 1)
    study.tell(trial, state=optuna.trial.TrialState.PRUNED)
    (found,) = searching.candidates_of(study)
    assert (found.state, found.objectives) == ("given up", None)


def _leave_an_unfinished_trial(folder: Path) -> None:
    import optuna

    storage = storage_of(folder / "journal")
    (name,) = optuna.get_all_study_names(storage)
    optuna.load_study(study_name=name, storage=storage).ask()


@pytest.mark.parametrize(
    ("verdict", "margin", "allow", "allowed"),
    [("refuted", -0.1, True, False), ("unknown", None, False, False), ("unknown", None, True, True),
     ("certified", 0.4, False, False), ("certified", 0.6, False, True)],
)  # fmt: skip
def test_constraint_follows_verdict_and_margin(verdict: str, margin: float | None, allow: bool, allowed: bool) -> None:
    config = tuning(allow_unknown=allow, least_margin=0.5)
    assert (violation_of(config, Stability(verdict, margin, "")) <= 0.0) == allowed  # pyright: ignore


def test_pareto_front_and_its_middle_choice() -> None:
    places = [(1.0, 9.0), (2.0, 3.0), (9.0, 1.0), (3.0, 4.0), (9.0, 9.0)]
    found = [Candidate({"k": float(i)}, place, "certified", 1.0, "tried") for i, place in enumerate(places)]
    assert [c.objectives for c in pareto_front(found, ["minimize", "minimize"])] == places[:3]
    best = best_candidate(found, ["minimize", "minimize"])
    assert best is not None
    assert best.objectives == (2.0, 3.0)
    assert [c.objectives for c in pareto_front(found, ["minimize", "maximize"])] == [(1.0, 9.0)]


def test_of_a_front_of_two_the_one_that_loses_less_of_the_range_is_chosen() -> None:
    # The second gives up a quarter of one range, the first most of the other.
    places = [(1.0, 5.0), (3.0, 9.0), (9.0, 4.0)]
    found = [Candidate({"k": float(i)}, place, "certified", 1.0, "tried") for i, place in enumerate(places)]
    for order in (found, found[::-1]):
        best = best_candidate(order, ["minimize", "maximize"])
        assert best is not None
        assert best.objectives == (3.0, 9.0)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"space": {}}, "empty space"),
        ({"space": {"stifness": {"low": 1.0, "high": 2.0}}}, "stifness is not known"),
        ({"space": {"stiffness": {"low": 2.0, "high": 1.0}}}, "is from 2 to 1"),
        ({"space": {"stiffness": {"low": 0.0, "high": 1.0, "log": True}}}, "above 0 with log|log of > 0"),
        ({"objectives": ["speed"]}, "no objective 'speed'"),
        ({"objectives": ["margin"]}, "no measure among its objectives"),
        ({"objectives": ["effort", "effort"]}, "an objective appears twice"),
        ({"tasks": ["trace", "fly"]}, "no user 'fly'"),
        ({"held_back": {"number": 3, "seed": 2, "does": "fly"}}, "no user 'fly'"),
        ({"objectives": ["expressiveness"]}, "kinematic"),
        ({"held_back": {"number": 3, "seed": 1}}, "same seed"),
        ({"sampler": "cma-es", "objectives": ["tracking_error", "effort"]}, "CMA-ES needs one objective"),
    ],
)
def test_contradictory_tuning_is_refused_in_one_line(values: dict[str, object], message: str) -> None:
    with pytest.raises((StudyError, ParameterError), match=message) as raised:
        check_tuning(tuning(**values))
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("name", ["tune", "trade"])
def test_example_tunings_can_be_read(name: str) -> None:
    assert read_tuning(EXAMPLES / f"{name}.toml").candidates >= 20


@pytest.mark.slow
def test_stability_of_lead_mode_is_unknown() -> None:
    assert cached_stability(run_config(mode="lead")).verdict == "unknown"


@pytest.mark.slow
def test_verdict_without_number_has_no_margin(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("HVF_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(governed, "governed_stability", lambda *given: Verdict("unknown", "no boundary was found"))
    found = cached_stability(run_config(figure="none"))
    assert (found.verdict, found.margin, found.reason) == ("unknown", None, "no boundary was found")


@pytest.mark.slow
def test_cached_verdict_equals_the_computed_one_and_follows_the_gain() -> None:
    soft, stiff = (cached_stability(run_config(stiffness=k, figure="none")) for k in (300.0, 1e5))
    assert (soft.verdict, stiff.verdict) == ("certified", "refuted")
    assert cached_stability(run_config(stiffness=300.0, figure="none")) == soft
    assert soft.margin is not None
    doubled = cached_stability(run_config(stiffness=600.0, figure="none"))
    assert doubled.used == pytest.approx(2.0 * soft.used, rel=1e-3)  # the critical gain is the same


@pytest.mark.slow
@pytest.mark.usefixtures("without_region")
def test_tuning_result_is_a_certified_run_configuration(tmp_path: Path) -> None:
    config = tuning(candidates=2, space={"stiffness": {"low": 50.0, "high": 2000.0, "log": True}})
    found = run_tuning(replace(config, prune=False), tmp_path, where=Where(threads=2))
    config_of_run = load_config(tmp_path / CHOSEN)
    assert config_of_run.mode.stiffness == found.values["stiffness"]  # pyright: ignore
    assert cached_stability(config_of_run).verdict == "certified"
    assert {c.contender for c in found.comparisons} == {"defaults", "random search", "half the critical gain"}
    assert "defaults" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_name_of_a_search_depends_on_all_that_its_cost_depends_on(monkeypatch: pytest.MonkeyPatch) -> None:
    curve, scale = hvf.circle(lap=2.0), 1.0

    def name(
        user: hvf.User | None = None, kind: str = "none", clips: tuple[str, ...] = ("walk",), seed: int = 1,
        cost: Callable[[hvf.Run], float] = lambda run: 1.0,
    ) -> str:  # fmt: skip
        sim = hvf.Simulation(
            field=hvf.Follow(curve, k_r=300, b_d=8), haptic_map=hvf.Cylindrical(hvf.clips(*clips), around=curve),
            figure=hvf.Figure(kind=kind),
        )  # fmt: skip
        users = (user or hvf.User(), *(hvf.User(person=person) for person in hvf.population(2, seed=seed)))
        return _study_name(sim, {"field.k_r": (100.0, 200.0)}, cost, users, 1.0, hvf.Search())

    def own(t: float, place: object, force: object) -> tuple[float, float, float]:
        return scale, 0.0, 0.0

    intent = hvf.User(person=hvf.persona("median"), intent=hvf.intents.Own(own))
    costs = (lambda run: sum(abs(x) for x in run.ticks["t"]), lambda run: sum(x * x for x in run.ticks["t"]))
    names = [
        name(), name(hvf.User(pushes=[hvf.Push(0.1, 0.2, 1.0)])), name(intent), name(kind="kinematic"),
        name(clips=("run",)), name(seed=2), *(name(cost=cost) for cost in costs),
    ]  # fmt: skip
    assert len(set(names)) == len(names)
    assert names[:3] == [name(), name(hvf.User(pushes=[hvf.Push(0.1, 0.2, 1.0)])), name(intent)]
    scale = 2.0
    assert name(intent) != names[2]
    monkeypatch.setattr(tuning_from_python, "code_hash", lambda module: "changed")
    assert name() != names[0]


@pytest.mark.slow
def test_python_search_resumes_only_its_own_candidates(tmp_path: Path) -> None:
    curve, search = hvf.circle(lap=2.0), hvf.Search(candidates=1, journal=tmp_path / "journal")
    walk, space = hvf.Cylindrical(hvf.clips("walk"), around=curve), {"field.k_r": (100.0, 101.0)}

    def found(damping: float, cost: Callable[[hvf.Run], float]) -> TunedSimulation:
        field = hvf.Follow(curve, k_r=300, b_d=damping).limited(8.0)
        sim = hvf.Simulation(field=field, haptic_map=walk, figure=hvf.Figure(kind="none"))
        return hvf.tune(sim, space, cost, seconds=0.2, search=search)

    first = found(8.0, lambda run: 1.0)
    assert found(8.0, lambda run: 1.0).costs == first.costs == (1.0,)
    assert found(8.0, lambda run: 2.0).costs == (2.0,)
    assert found(9.0, lambda run: 3.0 - 2.0).costs == (1.0,)
    storage = storage_of(tmp_path / "journal")
    assert len(storage.get_all_studies()) == 3


@pytest.mark.slow
def test_of_several_costs_those_nearest_to_the_least_of_each_are_chosen() -> None:
    curve, places = hvf.circle(radius=0.0477, lap=4.0), iter([(1.0, 5.0), (3.0, 1.0), (9.0, 6.0)])
    sim = hvf.Simulation(
        field=hvf.Follow(curve, k_r=300, b_d=8), haptic_map=hvf.Cylindrical(hvf.clips("walk"), around=curve),
        figure=hvf.Figure(kind="none"),
    )  # fmt: skip
    search = hvf.Search(candidates=3, costs=2, sampler="random")
    found = hvf.tune(sim, {"field.k_r": (50, 500)}, lambda run: next(places), seconds=0.05, search=search)
    assert found.costs == (3.0, 1.0)
    assert sorted(costs for _, costs in found.front) == [(1.0, 5.0), (3.0, 1.0)]
