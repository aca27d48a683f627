"""The trials of a study as one tidy table: a row per trial, a column per factor and per measure."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from experiments.trials.design.plan import Trial
from experiments.trials.design.study_config import StudyError
from experiments.trials.trial.measures import CONDITION_MEASURES
from experiments.trials.trial.run_trial import Row
from geometry.whole_files import atomic_file, write_text

TABLE_CSV, TABLE_PARQUET = "trials.csv", "trials.parquet"
_INSTALL_HINT = "studies are analysed with pandas, pyarrow and statsmodels: pip install 'haptic-vector-fields[study]'"


def trial_table(
    trials: Sequence[Trial], rows: Mapping[str, Row], measures: Sequence[str], margins: Mapping[int, float]
) -> Any:
    """The table as a pandas data frame, in the order of the plan; worker and time of a trial are not in it.

    Parameters
    ----------
    trials : sequence of Trial
        Planned trials.
    rows : mapping of str to Row
        Rows of the trials that have run, by key.
    measures : sequence of str
        Names of the columns.
    margins : mapping of int to float
        `margin_used` by number of the condition.

    Raises
    ------
    StudyError
        If a trial has not run, or pandas is not installed.
    """
    try:
        import pandas as pd
    except ImportError:
        raise StudyError(_INSTALL_HINT) from None
    missing = [trial for trial in trials if trial.key not in rows]
    if missing:
        raise StudyError(f"{len(missing)} of {len(trials)} trials have not run yet; start the study again to go on")
    records: list[dict[str, object]] = []
    for trial in trials:
        design, row = trial.design, rows[trial.key]
        values = {name: row.measures.get(name, float("nan")) for name in measures}
        if row.state == "done":
            values |= {
                name: margins.get(design.number, float("nan")) for name in CONDITION_MEASURES if name in measures
            }
        record: dict[str, object] = {"key": trial.key, "user": design.user, **design.condition.levels}
        record |= {"repetition": design.repetition, "position": design.position, "seed": trial.config.seed}
        record |= {"state": row.state, "reason": row.reason, **values}
        records.append(record)
    return pd.DataFrame.from_records(records)


def write_table(frame: Any, folder: Path) -> None:
    """Write the table as Parquet and as CSV."""
    try:
        with atomic_file(folder / TABLE_PARQUET) as file:
            frame.to_parquet(file, index=False)
    except ImportError:
        raise StudyError(_INSTALL_HINT) from None
    write_text(folder / TABLE_CSV, frame.to_csv(index=False))
