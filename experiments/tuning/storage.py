"""Storage of a search, from which it can be continued: a journal file, or a database through SQLAlchemy."""

import json
from pathlib import Path

import optuna
from optuna.storages.journal import JournalFileBackend

from experiments.trials.design.study_config import StudyError


def storage_of(where: str | Path) -> optuna.storages.BaseStorage:
    """Optuna's storage in a file or at a URL.

    Parameters
    ----------
    where : str or Path
        File of a journal, or a URL such as ``sqlite:///tune.db`` or ``postgresql://user@host/base``.

    Raises
    ------
    StudyError
        If the file cannot be written or is something else, or the database cannot be reached.
    """
    if "://" not in str(where):
        try:
            with open(where, "a+b") as file:
                file.seek(0)
                first_line = file.readline()
            if first_line and "op_code" not in json.loads(first_line):  # Optuna takes any single line for unfinished
                raise ValueError
            return optuna.storages.JournalStorage(JournalFileBackend(str(where)))
        except OSError as error:
            raise StudyError(f"{where}: {error.strerror}; expected a file that can be written") from None
        except (ValueError, TypeError, KeyError):
            raise StudyError(
                f"{where}: is no journal of a search, and is left as it is; expected a new file, or that of a search"
            ) from None
    try:
        return optuna.storages.RDBStorage(str(where))
    except Exception as error:  # from SQLAlchemy, a driver that is not installed, or a server that does not answer
        message = str(error).strip().splitlines()[0]
        raise StudyError(
            f"{where}: no storage for a search ({message}); expected a URL of SQLAlchemy such as sqlite:///tune.db"
        ) from None
