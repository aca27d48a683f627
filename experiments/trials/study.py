"""Runs a study: plans its trials, continues where it was interrupted, and analyses the results."""

import hashlib
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rich.console import Console

from controllers.checks import check_field_types, check_kind
from experiments.certify.cached_stability import cached_stability
from experiments.config.keywords import with_keyword_messages
from experiments.config.part import to_json
from experiments.config.paths import relative_to
from experiments.files.given_path import given_path
from experiments.files.json_text import json_text
from experiments.trials.analysis.statistics import Statistics
from experiments.trials.analysis.trial_table import TABLE_CSV, TABLE_PARQUET, trial_table, write_table
from experiments.trials.design.plan import Trial, code_hash, plan_trials
from experiments.trials.design.study_config import StudyConfig, StudyError, Where, parse_study, read_toml
from experiments.trials.execution.database import Database
from experiments.trials.execution.drive import check_writable, compile_and_make_maps, run_missing
from experiments.trials.execution.executors import executor
from experiments.trials.trial.measures import CONDITION_MEASURES, MEASURES, measures_of
from experiments.trials.trial.run_trial import Row
from geometry.whole_files import write_text

DATABASE, SUMMARY, REPORT = "study.sqlite", "summary.json", "report.html"


@dataclass(frozen=True)
class StudyResult:
    """Results of a study.

    Attributes
    ----------
    folder : Path
        Folder of database, tables and report.
    table : pandas.DataFrame
        Table with a row per trial, in the order of the plan.
    found : Statistics
        All contrasts.
    sentences : tuple of str
        Main results, for a skimming reader.
    ran, failed : int
        Number of trials that this call ran, and number of failed trials in the whole study.
    """

    folder: Path
    table: Any
    found: Statistics
    sentences: tuple[str, ...]
    ran: int
    failed: int

    def __str__(self) -> str:
        return "\n".join(self.sentences)

    def to_json(self) -> str:
        """Sentences, counts, contrasts and interactions as JSON."""
        summary = {"sentences": self.sentences, "trials": len(self.table), "ran": self.ran, "failed": self.failed}
        return json_text(summary | {"contrasts": self.found.contrasts, "interactions": self.found.interactions})


@dataclass(frozen=True)
class Study:
    """A user study with simulated people: who does what under which conditions, how often, and what is measured.

    Parameters
    ----------
    config : StudyConfig
        The design.
    text : str
        Text of its file, as the report shows it; by default the design as JSON.
    """

    config: StudyConfig
    text: str = ""

    def __post_init__(self) -> None:
        check_field_types(self)

    @staticmethod
    def load(path: str | Path) -> "Study":
        """The study in a TOML file.

        Raises
        ------
        SimError, ControllerError
            If it cannot be read, or contains an unknown entry.
        """
        file = given_path("path", path)
        config = parse_study(read_toml(file, "a study"), str(file)).with_paths(relative_to(file.parent))
        return Study(config, file.read_text(encoding="utf-8-sig"))

    @staticmethod
    def of(**values: object) -> "Study":
        """The study given by the entries of its file as keywords.

        Raises
        ------
        ControllerError
            If there is an unknown entry.
        """
        return Study(parse_study(values, "study"))

    def with_users(self, number: int | None = None, seed: int | None = None) -> "Study":
        """The same study with another number of users, or another seed of trials and population."""
        return replace(self, config=self.config.with_users(number, seed))

    @property
    def trials(self) -> tuple[Trial, ...]:
        """All planned trials; see `experiments.trials.design.plan.plan_trials`."""
        return plan_trials(self.config)

    @with_keyword_messages()
    def run(
        self, out: str | Path, threads: int | None = None, workers: int | None = None, cluster: str | None = None,
        console: Console | None = None,
    ) -> StudyResult:  # fmt: skip
        """Run the trials that have not been run yet, and analyse the study.

        Parameters
        ----------
        out : path
            Folder of database, tables and report; if it holds this study, the study is continued.
        threads : int, optional
            Number of threads of this process; by default the number of processors.
        workers : int, optional
            Run on this number of processes of a local Dask cluster instead.
        cluster : str, optional
            Run on the workers of the Dask scheduler at this address instead.
        console : Console, optional
            Where progress is shown; by default stderr.

        Raises
        ------
        HvfError, OSError
            If the study contradicts itself, cannot go on, or has fewer users or repetitions than the folder; completed
            trials are kept.
        """
        folder, where = given_path("out", out), Where(threads=threads, workers=workers, cluster=cluster)
        check_kind("console", console, Console | None)
        console = console or Console(stderr=True)
        measures, trials = self._measures(), self.trials
        if self.config.recordings:
            check_writable(self.config.recordings)
        _check_folder(folder)
        with Database(folder / DATABASE, self._identity(), self.config.name, self._text()) as database:
            self._refuse_fewer(folder, database)
            compile_and_make_maps((trial.config for trial in trials), console)
            with executor(where) as pool:
                ran = run_missing(trials, database, pool, self.config.recordings, console, _descriptions(trials))
            planned_keys = {trial.key for trial in trials}
            rows = {row.key: row for row in database.rows() if row.key in planned_keys}
        frame = trial_table(trials, rows, measures, self._margins(trials) if "margin_used" in measures else {})
        write_table(frame, folder)
        return self._report(folder, frame, rows, ran, console)

    def _report(self, folder: Path, frame: Any, rows: Mapping[str, Row], ran: int, console: Console) -> StudyResult:
        from experiments.trials.analysis.report import write_report  # pandas, statsmodels and matplotlib take seconds

        with console.status("analysing"):
            found, sentences = write_report(
                self.config, self._text(), self.trials, frame, folder / REPORT, _provenance(rows)
            )
        failed = int(frame["state"].eq("failed").sum())
        result = StudyResult(folder, frame, found, sentences, ran, failed)
        write_text(folder / SUMMARY, result.to_json() + "\n")
        return result

    def _refuse_fewer(self, folder: Path, database: Database) -> None:
        """Refuse fewer users or repetitions than the folder has: its tables and report would lose trials."""
        requested = {"user": self.config.users.number, "repetition": self.config.repetitions}
        for name, number in requested.items():
            saved = database.most(name) + 1
            if saved > number:
                raise StudyError(
                    f"{folder}: holds this study with {saved} {name}s, whose tables and report those of {number} would "
                    f"replace; expected {saved} {name}s or more, or another --out"
                )

    def _text(self) -> str:
        return self.text or to_json(self.config)

    def _identity(self) -> str:
        """Hash of the study without its numbers of users and repetitions, name, question, measures and recordings."""
        users = replace(self.config.users, number=1)
        comparable = replace(
            self.config, users=users, repetitions=1, name="", question="", measures=(), recordings="",
            ease=StudyConfig.ease, cost=StudyConfig.cost,
        )  # fmt: skip
        return hashlib.sha256(to_json(comparable).encode()).hexdigest()[:32]

    def _measures(self) -> tuple[str, ...]:
        config = self.config
        kinds = {trial.config.figure.kind for trial in plan_trials(replace(config, repetitions=1))}
        available = tuple(name for name in MEASURES if any(name in measures_of(kind) for kind in kinds))
        roles = (("ease", config.ease), ("cost", config.cost))
        chosen = {name for role, name in roles if name != getattr(StudyConfig, role)}  # a figure may lack the defaults
        for role, name in roles:
            if name in CONDITION_MEASURES:
                raise StudyError(f"study {config.name!r}: {role} = {name!r} is of a condition; expected one of a trial")
        for name in (*config.measures, config.ease, config.cost):
            if name not in MEASURES:
                raise StudyError(f"study {config.name!r}: no measure {name!r}; there are {', '.join(MEASURES)}")
            if name not in available and name in {*config.measures, *chosen}:
                needed = MEASURES[name].figure
                raise StudyError(
                    f"study {config.name!r}: {name!r} needs a figure that is {needed}; expected figure = {needed!r}"
                )
        return tuple(
            name for name in available if not config.measures or name in (*config.measures, config.ease, config.cost)
        )

    def _margins(self, trials: Sequence[Trial]) -> dict[int, float]:
        """Share of the stability margin that each condition uses, by number of the condition."""
        one_each = {trial.design.number: trial.config for trial in trials}
        return {number: cached_stability(config).used for number, config in one_each.items()}


def _check_folder(folder: Path) -> None:
    """Refuse a folder that has no database of a study but files with the names that a study writes."""
    names = (REPORT, SUMMARY, TABLE_PARQUET, TABLE_CSV)
    existing = [] if (folder / DATABASE).exists() else [name for name in names if (folder / name).exists()]
    if existing:
        raise StudyError(f"{folder}: holds {', '.join(existing)}, not of a study; choose another --out")


def _descriptions(trials: Sequence[Trial]) -> dict[str, dict[str, object]]:
    """Descriptions of the trials for readers of the database, by key."""
    descriptions: dict[str, dict[str, object]] = {}
    for key, met, config in trials:
        place: dict[str, object] = {"user": met.user, "repetition": met.repetition, "position": met.position}
        descriptions[key] = {**met.condition.levels, **place, "seed": config.seed}
    return descriptions


def _provenance(rows: Mapping[str, Row]) -> str:
    processors = sorted({row.processor for row in rows.values()} - {""})
    seconds = sum(row.seconds for row in rows.values())
    return (
        f"Made with code {code_hash()}, Python {platform.python_version()}, on {', '.join(processors)}: "
        f"{len(rows)} trials took {seconds:.0f} s of processor time, {seconds / max(1, len(rows)):.3f} s each."
        + (" More than one kind of processor: their last bits may differ." if len(processors) > 1 else "")
    )
