"""Where a search is kept, so that it goes on where it was stopped: a journal file, or a database of SQLAlchemy."""

from pathlib import Path

import optuna
from optuna.storages.journal import JournalFileBackend

from experiments.trials.errors import StudyError


def storage_of(where: str | Path) -> optuna.storages.BaseStorage:
    """Optuna's storage at a place.

    Parameters
    ----------
    where : str or Path
        File of a journal, or a URL such as ``sqlite:///tune.db`` or ``postgresql://user@host/base``.

    Raises
    ------
    StudyError
        If nothing answers there.
    """
    if "://" not in str(where):
        return optuna.storages.JournalStorage(JournalFileBackend(str(where)))
    try:
        return optuna.storages.RDBStorage(str(where))
    except Exception as error:  # of SQLAlchemy, of a driver that is not installed, of a server that does not answer
        said = str(error).strip().splitlines()[0]
        raise StudyError(
            f"{where}: no storage for a search ({said}); expected a URL of SQLAlchemy such as sqlite:///tune.db"
        ) from None
