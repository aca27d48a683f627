"""Studies run in this process: tables, resumption, failures, and refused settings."""

import json
import math
from pathlib import Path

import pytest

from controllers.errors import ParameterError
from experiments.config.options import run_config
from experiments.config.part import to_json
from experiments.results.measures import smoothness
from experiments.trials.design.study_config import StudyError
from experiments.trials.execution.database import Database
from experiments.trials.study import DATABASE, REPORT, SUMMARY, Study
from experiments.trials.trial import run_trial
from experiments.trials.trial.run_trial import MapCache, Row, Task, perform_trial
from sim.compilation.sources import reached_code
from sim.recording.recorder import DiskFull
from sim.recording.recording import Recording

pandas = pytest.importorskip("pandas")
pytest.importorskip("statsmodels")


def small_study(**values: object) -> Study:
    defaults: dict[str, object] = {
        "name": "small", "seconds": 0.5, "run": {"figure": "none"}, "factors": {"stiffness": [100, 300]},
        "users": {"number": 3}, "cost": "effort", "measures": ["tracking_error", "effort", "sparc"],
    }  # fmt: skip
    return Study.of(**(defaults | values))


@pytest.mark.slow
def test_study_table_is_independent_of_threads_and_resumption(tmp_path: Path) -> None:
    one = small_study().run(tmp_path / "one", threads=1)
    small_study().with_users(number=2).run(tmp_path / "grown", threads=2)
    grown = small_study().run(tmp_path / "grown", threads=2)
    assert (one.ran, grown.ran, one.failed) == (6, 2, 0)
    tables = [(tmp_path / name / "trials.csv").read_bytes() for name in ("one", "grown")]
    assert tables[0] == tables[1]
    assert small_study().run(tmp_path / "one").ran == 0
    assert pandas.read_parquet(tmp_path / "one" / "trials.parquet").equals(one.table)
    assert one.table["user"].value_counts().to_dict() == {0: 2, 1: 2, 2: 2}
    page = (tmp_path / "one" / REPORT).read_text(encoding="utf-8")
    assert "The median trial" in page
    assert "The worst trial" in page
    assert all(sentence in page for sentence in one.sentences)
    assert json.loads((tmp_path / "one" / SUMMARY).read_text())["trials"] == 6


def test_folder_with_another_study_is_refused(tmp_path: Path) -> None:
    changed, whole = small_study(factors={"stiffness": [100, 400]}), small_study()
    Database(tmp_path / DATABASE, whole._identity(), "small", "").close()
    with pytest.raises(StudyError, match="holds another study"):
        changed.run(tmp_path, threads=1)
    assert small_study(repetitions=3, name="larger").with_users(number=9)._identity() == whole._identity()


@pytest.mark.parametrize(
    ("fewer", "message"),
    [({"users": {"number": 2}}, "with 3 users.*those of 2 would"), ({"repetitions": 1}, "with 2 repetitions.*of 1")],
)
def test_fewer_users_or_repetitions_than_stored_are_refused(
    tmp_path: Path, fewer: dict[str, object], message: str
) -> None:
    whole = small_study(repetitions=2)
    trial = whole.trials[0]
    with Database(tmp_path / DATABASE, whole._identity(), "small", "") as database:
        database.add(Row(trial.key, "failed", "", {}, 0.0, "", ""), {"user": 2, "repetition": 1})
    with pytest.raises(StudyError, match=message):
        small_study(**({"repetitions": 2} | fewer)).run(tmp_path, threads=1)
    assert {path.name for path in tmp_path.iterdir()} <= {DATABASE, "study.lock"}


def test_failing_trial_is_a_row_with_its_reason(tmp_path: Path) -> None:
    # A curve that the Phantom does not reach is known only when the run is wired up.
    factors = {"around": {"near": {"radius": 0.0477}, "far": {"radius": 0.4}}}
    study = small_study(factors=factors, users={"number": 2})
    trials = study.trials
    rows = [perform_trial(Task(trial.key, to_json(trial.config)), MapCache()) for trial in trials]
    states = {trial.design.condition.levels["around"]: row.state for trial, row in zip(trials, rows, strict=True)}
    assert states == {"near": "done", "far": "failed"}
    assert all("reach" in row.reason or "stops" in row.reason for row in rows if row.state == "failed")


def test_measures_of_tracing_and_exaggerating_tasks() -> None:
    task = {"trace": {"user": "trace"}, "exaggerate": {"user": "exaggerate"}}
    study = small_study(factors={"task": task}, users={"number": 1}, run={"figure": "kinematic"}, measures=[])
    rows = {t.design.condition.levels["task"]: perform_trial(Task(t.key, to_json(t.config))) for t in study.trials}
    assert {row.state for row in rows.values()} == {"done"}
    for task, nothing, something in (
        ("trace", "expressiveness", "tracking_error"),
        ("exaggerate", "tracking_error", "expressiveness"),
    ):
        assert math.isnan(rows[task].measures[nothing])
        assert rows[task].measures[something] > 0.0


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), DiskFull("run.h5: No space left")])
def test_machine_error_is_raised_not_recorded(error: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    trial = small_study().trials[0]

    def full(*_: object) -> Row:
        raise error

    monkeypatch.setattr(run_trial, "_simulate", full)
    with pytest.raises(type(error), match="No space left"):
        perform_trial(Task(trial.key, to_json(trial.config)))


def test_shared_maps_do_not_change_the_measures() -> None:
    trials = small_study().trials[:3]
    cache = MapCache()
    shared = [perform_trial(Task(t.key, to_json(t.config)), cache).measures for t in trials]
    alone = [perform_trial(Task(t.key, to_json(t.config)), MapCache()).measures for t in trials]
    assert shared == alone


def test_maps_are_shared_among_trials_whose_field_flows_alike() -> None:
    """The legs of a map are chosen for hands that are pushed off as its field lets them move."""
    keys = [
        run_trial._map_key(run_config(map="composite", clips=("walk", "angry", "cheer"), **words))
        for words in ({}, {"flow": "parallel"}, {"flow": "parallel", "damping": 9.0}, {"flow": "curve"})
    ]
    assert keys[0] == keys[1] == keys[2] != keys[3]
    assert keys[3] == run_trial._map_key(run_config(mode="bunny", map="composite", clips=("walk", "angry", "cheer")))


def test_recordings_are_stored_at_the_given_url(tmp_path: Path) -> None:
    pytest.importorskip("fsspec")
    trial = small_study().trials[0]
    (tmp_path / "kept").mkdir()
    row = perform_trial(Task(trial.key, to_json(trial.config), f"file://{tmp_path}/kept"))
    with Recording(tmp_path / "kept" / f"{trial.key}.h5") as recording:
        assert recording.complete
        assert len(recording.channel("ticks", "t")) == 500
    assert row.measures == perform_trial(Task(trial.key, to_json(trial.config))).measures


def test_invalid_recordings_url_is_refused_before_the_first_trial(tmp_path: Path) -> None:
    pytest.importorskip("fsspec")
    with pytest.raises(StudyError, match=r"recordings = 'nosuch://x'.*a folder, or a URL"):
        small_study(recordings="nosuch://x").run(tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_condition_measure_is_refused_as_ease(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="ease = 'margin_used' is of a condition"):
        small_study(ease="margin_used", measures=[]).run(tmp_path / "out")


def test_trial_key_covers_the_smoothness_code() -> None:
    assert smoothness.__name__ in reached_code("experiments.trials.trial.run_trial")


@pytest.mark.parametrize(
    ("threads", "workers", "cluster", "message"),
    [(2, 2, None, "threads and workers contradict"), (0, None, None, "threads is 0"), (None, 0, None, "workers is 0")],
)
def test_contradictory_executors_are_refused_without_output(
    tmp_path: Path, threads: int | None, workers: int | None, cluster: str | None, message: str
) -> None:
    with pytest.raises(ParameterError, match=message):
        small_study().run(tmp_path / "out", threads, workers, cluster)
    assert not (tmp_path / "out").exists()
