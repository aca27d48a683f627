"""What a panel of users makes of a candidate: trials that are run once, and kept."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from controllers.state import Array
from experiments.config.part import to_json
from experiments.config.run_config import RunConfig, User
from experiments.trials.database import Database
from experiments.trials.drive import Executor
from experiments.trials.participants import participants
from experiments.trials.plan import key_of
from experiments.trials.run_trial import Row, Task
from experiments.trials.study_config import Users


def panel_runs(config: RunConfig, users: Users, repetitions: int, seed: int) -> list[list[RunConfig]]:
    """Runs of a candidate by user, with the same seeds for every candidate: what differs between them is theirs."""
    runs: list[list[RunConfig]] = []
    for number, person in enumerate(participants(users)):
        user = User(does=users.does, person=person)  # pyright: ignore[reportArgumentType]
        seeds = [np.random.SeedSequence((seed, users.seed, number, k)) for k in range(repetitions)]
        runs.append([replace(config, user=user, seed=int(s.generate_state(1, np.uint32)[0])) for s in seeds])
    return runs


class Panel:
    """Runs trials of candidates, each once: what the database has is not run again.

    Parameters
    ----------
    database : Database
        That keeps their rows.
    executor : Executor
        That runs them.
    """

    def __init__(self, database: Database, executor: Executor):
        self._database, self._executor = database, executor
        self._rows = {row.key: row for row in database.rows()}

    def measured(self, runs: Iterable[RunConfig], measures: Sequence[str]) -> Array:
        """Measures of runs, shape (runs, measures); NaN of one that failed."""
        wanted = {key_of(config): config for config in runs}
        missing = [Task(key, to_json(config)) for key, config in wanted.items() if key not in self._rows]
        for row in self._executor.rows(missing) if missing else ():
            self._database.add(row, {})
            self._rows[row.key] = row
        return np.array([_numbers(self._rows[key], measures) for key in wanted])


def _numbers(row: Row, measures: Sequence[str]) -> list[float]:
    return [row.measures.get(name, float("nan")) for name in measures]
