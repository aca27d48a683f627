"""A study that is run: planned, continued where it was left, analysed."""

import hashlib
import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from rich.console import Console

from experiments.certify.kept_stability import kept_stability
from experiments.config.part import to_json
from experiments.files.json_text import json_text
from experiments.trials.analysis.statistics import Statistics
from experiments.trials.analysis.tidy import table, write_table
from experiments.trials.code_hash import code_hash
from experiments.trials.database import Database
from experiments.trials.drive import run_missing, warm
from experiments.trials.errors import StudyError
from experiments.trials.executors import executor
from experiments.trials.measures import MEASURES, OF_CONDITIONS, measures_of
from experiments.trials.plan import Trial, planned
from experiments.trials.recordings_place import check_place
from experiments.trials.run_trial import SHELF, Row
from experiments.trials.study_config import StudyConfig, read_toml, study_from
from experiments.trials.where import Where

DATABASE, SUMMARY, REPORT = "study.sqlite", "summary.json", "report.html"


@dataclass(frozen=True)
class StudyResult:
    """What a study found.

    Attributes
    ----------
    folder : Path
        That holds database, tables and report.
    table : pandas.DataFrame
        A row a trial, in the order of the plan.
    found : Statistics
        All contrasts.
    sentences : tuple of str
        What a skimming reader should know.
    ran, failed : int
        Trials that this call ran, and those of all that failed.
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
        """Sentences, counts and contrasts."""
        contrasts = [asdict(contrast) for contrast in self.found.contrasts]
        told = {"sentences": self.sentences, "trials": len(self.table), "ran": self.ran, "failed": self.failed}
        return json_text(told | {"contrasts": contrasts, "interactions": self.found.interactions})


@dataclass(frozen=True)
class Study:
    """Simulated people under the conditions of a design: who does what, how often, and what is measured.

    Parameters
    ----------
    config : StudyConfig
        The design.
    text : str
        Its file, as the report shows it; by default the design as JSON.
    """

    config: StudyConfig
    text: str = ""

    @staticmethod
    def load(path: str | Path) -> "Study":
        """The study in a TOML file.

        Raises
        ------
        SimError, ControllerError
            If it cannot be read, or says what a study has not.
        """
        file = Path(path)
        config = study_from(read_toml(file, "a study"), str(file))
        return Study(config, file.read_text(encoding="utf-8"))

    @staticmethod
    def of(**values: object) -> "Study":
        """The study of what its file would say, as keywords.

        Raises
        ------
        ControllerError
            If it says what a study has not.
        """
        return Study(study_from(values, "study"))

    def with_users(self, number: int | None = None, seed: int | None = None) -> "Study":
        """The same study with another number of users, or another seed of trials and population."""
        return replace(self, config=self.config.with_users(number, seed))

    @property
    def trials(self) -> tuple[Trial, ...]:
        """All trials, as they are planned; see `experiments.trials.plan.planned`."""
        return planned(self.config)

    def run(
        self, out: str | Path, threads: int | None = None, workers: int | None = None, cluster: str | None = None,
        console: Console | None = None,
    ) -> StudyResult:  # fmt: skip
        """Run what of the study has not run yet, and analyse it.

        Parameters
        ----------
        out : path
            Folder of database, tables and report. One that holds this study is continued.
        threads : int, optional
            Of this process; by default as many as there are processors.
        workers : int, optional
            Instead, processes of a local Dask cluster.
        cluster : str, optional
            Instead, the address of a Dask scheduler.
        console : Console, optional
            Where progress is shown; by default stderr.

        Raises
        ------
        ModelError, ControllerError, SimError, OSError
            If the study contradicts itself, or cannot go on; what was done is kept.
        """
        console, folder, where = (
            console or Console(stderr=True),
            Path(out),
            Where(threads=threads, workers=workers, cluster=cluster),
        )
        measures, trials = self._measures(), self.trials
        if self.config.recordings:
            check_place(self.config.recordings)
        with Database(folder / DATABASE, self._identity(), self.config.name, self._text()) as database:
            warm((trial.config for trial in trials), SHELF, console)
            with executor(where) as runs:
                ran = run_missing(trials, database, runs, self.config.recordings, console, _told(trials))
            planned_keys = {trial.key for trial in trials}
            rows = {row.key: row for row in database.rows() if row.key in planned_keys}
        frame = table(trials, rows, measures, self._margins(trials) if "margin_used" in measures else {})
        write_table(frame, folder)
        return self._report(folder, frame, rows, ran, console)

    def _report(self, folder: Path, frame: Any, rows: Mapping[str, Row], ran: int, console: Console) -> StudyResult:
        from experiments.trials.analysis.report import write_report  # pandas, statsmodels and matplotlib take seconds

        with console.status("analysing"):
            found, sentences = write_report(self.config, self._text(), self.trials, frame, folder / REPORT, _made(rows))
        failed = int(frame["state"].eq("failed").sum())
        result = StudyResult(folder, frame, found, sentences, ran, failed)
        (folder / SUMMARY).write_text(result.to_json() + "\n", encoding="utf-8")
        return result

    def _text(self) -> str:
        return self.text or to_json(self.config)

    def _identity(self) -> str:
        """Hash of what a study is, whatever its numbers of users and repetitions, and what is said of it."""
        users = replace(self.config.users, number=1)
        same = replace(
            self.config, users=users, repetitions=1, name="", question="", measures=(), recordings="",
            ease=StudyConfig.ease, cost=StudyConfig.cost,
        )  # fmt: skip
        return hashlib.sha256(to_json(same).encode()).hexdigest()[:32]

    def _measures(self) -> tuple[str, ...]:
        config = self.config
        kinds = {trial.config.figure.kind for trial in planned(replace(config, repetitions=1))}
        there = tuple(name for name in MEASURES if any(name in measures_of(kind) for kind in kinds))
        unasked = {StudyConfig.ease, StudyConfig.cost} - set(config.measures)  # a figure need not have the defaults
        for word, name in (("ease", config.ease), ("cost", config.cost)):
            if name in OF_CONDITIONS:
                raise StudyError(f"study {config.name!r}: {word} = {name!r} is of a condition; expected one of a trial")
        for name in (*config.measures, config.ease, config.cost):
            if name not in MEASURES:
                raise StudyError(f"study {config.name!r}: no measure {name!r}; there are {', '.join(MEASURES)}")
            if name not in there and name not in unasked:
                needed = MEASURES[name].figure
                raise StudyError(
                    f"study {config.name!r}: {name!r} needs a figure that is {needed}; expected figure = {needed!r}"
                )
        return tuple(
            name for name in there if not config.measures or name in (*config.measures, config.ease, config.cost)
        )

    def _margins(self, trials: Sequence[Trial]) -> dict[int, float]:
        """What of the stability margin each condition uses."""
        return {trial.meeting.number: kept_stability(trial.config).used for trial in _one_each(trials)}


def _one_each(trials: Sequence[Trial]) -> list[Trial]:
    """A trial of each condition."""
    return list({trial.meeting.number: trial for trial in trials}.values())


def _told(trials: Sequence[Trial]) -> dict[str, dict[str, object]]:
    """What a reader of the database is told of each trial."""
    told: dict[str, dict[str, object]] = {}
    for key, met, config in trials:
        place: dict[str, object] = {"user": met.user, "repetition": met.repetition, "position": met.position}
        told[key] = {**met.condition.levels, **place, "seed": config.seed}
    return told


def _made(rows: Mapping[str, Row]) -> str:
    processors = sorted({row.processor for row in rows.values()} - {""})
    spent = sum(row.seconds for row in rows.values())
    return (
        f"Made with code {code_hash()}, Python {platform.python_version()}, on {', '.join(processors)}: "
        f"{len(rows)} trials took {spent:.0f} s of processor time, {spent / max(1, len(rows)):.3f} s each."
        + (" More than one kind of processor: their last bits may differ." if len(processors) > 1 else "")
    )
