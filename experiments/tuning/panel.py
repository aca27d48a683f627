"""Evaluation of candidates by a panel of simulated users; every trial is run once and stored."""

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from experiments.config.part import to_json
from experiments.config.run_config import RunConfig, User
from experiments.setups.parts.lap import with_lap
from experiments.trials.design.plan import trial_key
from experiments.trials.design.study_config import StudyError, Users
from experiments.trials.execution.database import Database
from experiments.trials.execution.drive import Executor
from experiments.trials.trial.run_trial import Row, Task
from experiments.tuning.tune_config import MARGIN, TuneConfig
from geometry.arrays import Array
from sim.users.person.population import population


def panel_runs(config: TuneConfig, candidate: RunConfig, users: Users) -> list[list[RunConfig]]:
    """Runs of a candidate by user; all candidates have the same seeds, so that only their values differ."""
    runs: list[list[RunConfig]] = []
    candidate = replace(candidate, map=with_lap(candidate.map))  # once, for motion files are read for it
    for number, person in enumerate(population(users.number, users.seed)):
        user_runs: list[RunConfig] = []
        for k, task in enumerate(config.tasks or (users.does,)):
            user = User(does=task, person=person)  # pyright: ignore[reportArgumentType]
            for repetition in range(config.repetitions):
                entropy = (config.seed, users.seed, number, k * config.repetitions + repetition)
                seed = int(np.random.SeedSequence(entropy).generate_state(1, np.uint32)[0])
                user_runs.append(replace(candidate, user=user, seed=seed))
        runs.append(user_runs)
    return runs


class Panel:
    """Runs trials of candidates; trials that are in the database are not run again.

    Parameters
    ----------
    database : Database
        Stores the rows of the trials.
    executor : Executor
        Runs the trials.
    """

    def __init__(self, database: Database, executor: Executor):
        self._database, self._executor = database, executor
        self._rows = {row.key: row for row in database.rows()}

    def objectives(self, config: TuneConfig, runs: Sequence[Sequence[RunConfig]], margin: float | None) -> Array:
        """Objectives by user, shape (users, objectives): the mean over a user's trials that have the measure.

        Infinite if one of the user's trials failed, which excludes the candidate.

        Raises
        ------
        StudyError
            If no trial has one of the measures.
        """
        keys = [[trial_key(run) for run in user_runs] for user_runs in runs]
        run_by_key = dict(zip(itertools.chain(*keys), itertools.chain(*runs), strict=True))
        missing = [Task(key, to_json(run)) for key, run in run_by_key.items() if key not in self._rows]
        for row in self._executor.rows(missing) if missing else ():
            self._database.add(row, {})
            self._rows[row.key] = row
        by_user = [[self._rows[key] for key in user_keys] for user_keys in keys]
        values = np.array([[_mean_objective(rows, name, margin) for name in config.objectives] for rows in by_user])
        absent = [name for k, name in enumerate(config.objectives) if np.all(np.isnan(values[:, k]))]
        if absent:
            raise StudyError(
                f"tuning {config.name!r}: no trial of its users has {absent[0]!r}; expected tasks that have it, such "
                "as tasks = ['trace', 'exaggerate']"
            )
        return values


def _mean_objective(rows: Sequence[Row], objective: str, margin: float | None) -> float:
    if objective == MARGIN:
        return margin or 0.0
    if any(row.state == "failed" for row in rows):
        return float("inf")
    values = np.array([row.measures.get(objective, np.nan) for row in rows])
    values = values[np.isfinite(values)]
    return float(np.mean(values)) if len(values) else float("nan")
