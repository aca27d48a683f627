"""The database of a study: one SQLite file with a row per trial, which survives a kill at any moment."""

import fcntl
import json
import math
import os
import sqlite3
from collections.abc import Generator, Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Self, get_args

from experiments.trials.design.study_config import StudyError
from experiments.trials.trial.run_trial import Row, State

SCHEMA = 1
_APPLICATION_ID = 0x48564654  # "HVFT": application id, by which SQLite and `file` identify the file
_TABLES = """
CREATE TABLE study (identity TEXT NOT NULL, name TEXT NOT NULL, text TEXT NOT NULL);
CREATE TABLE trials (
    key TEXT PRIMARY KEY, state TEXT NOT NULL, reason TEXT NOT NULL, measures TEXT NOT NULL, what TEXT NOT NULL,
    seconds REAL NOT NULL, worker TEXT NOT NULL, processor TEXT NOT NULL, finished TEXT NOT NULL
) WITHOUT ROWID;
"""


class Database:
    """Rows of a study's trials by key; one driver at a time may write, any process may read.

    Use as a context manager. Every row is a transaction in SQLite's write-ahead log: no added row is lost by a kill.

    Parameters
    ----------
    path : Path
        File; created with its folder if it is missing.
    identity : str
        Hash of the study without its numbers of users and repetitions.
    name, text : str
        Name of the study and text of its file, for readers of the database.

    Raises
    ------
    StudyError
        If the file is not such a database, belongs to another study or version, or is being written by another driver.
    """

    def __init__(self, path: Path, identity: str, name: str, text: str):
        self._path = path
        path.parent.mkdir(parents=True, exist_ok=True)
        self._lock = _acquire_lock(path.with_suffix(".lock"), path)
        try:
            with self._translated_errors():
                self._db = sqlite3.connect(path, isolation_level=None)
                self._open_study(identity, name, text)
        except BaseException:
            os.close(self._lock)
            raise

    def _open_study(self, identity: str, name: str, text: str) -> None:
        if not self._db.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]:
            self._db.execute("PRAGMA journal_mode = WAL")  # a persistent setting of the file
            self._db.executescript(
                f"BEGIN; {_TABLES} PRAGMA application_id = {_APPLICATION_ID}; PRAGMA user_version = {SCHEMA}; COMMIT;"
            )
        application_id, version = (
            self._db.execute(f"PRAGMA {what}").fetchone()[0] for what in ("application_id", "user_version")
        )
        if application_id != _APPLICATION_ID:
            raise StudyError(
                f"{self._path}: a database of something else; expected one of `hvf trials`, or another --out"
            )
        if version != SCHEMA:
            raise StudyError(
                f"{self._path}: of version {version} of the database, this program writes {SCHEMA}; go on with the "
                "program that began it, or give another --out"
            )
        self._db.execute("PRAGMA synchronous = NORMAL")
        stored = self._db.execute("SELECT identity, name FROM study").fetchone()
        if stored is None:
            self._db.execute("INSERT INTO study VALUES (?, ?, ?)", (identity, name, text))
        elif stored[0] != identity:
            raise StudyError(
                f"{self._path}: holds another study, {stored[1]!r}, or this one before it was changed; give another "
                "--out, or the study as it is in the database (table study, column text)"
            )

    def add(self, row: Row, what: Mapping[str, object]) -> None:
        """Store a row; `what` describes the trial for readers of the database.

        Raises
        ------
        StudyError
            If the disk is full.
        """
        finite = {name: value if math.isfinite(value) else None for name, value in row.measures.items()}
        now = datetime.now(UTC).isoformat(timespec="seconds")
        values = (
            row.key, row.state, row.reason, json.dumps(finite), json.dumps(what), row.seconds, row.worker,
            row.processor, now,
        )  # fmt: skip
        with self._translated_errors():
            self._db.execute("INSERT OR REPLACE INTO trials VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", values)

    def rows(self) -> Iterator[Row]:
        """All rows, in the order of their keys.

        Raises
        ------
        StudyError
            If a row was changed so that it cannot be read.
        """
        columns = "key, state, reason, measures, seconds, worker, processor"
        with self._translated_errors():
            for key, state, reason, measures, *rest in self._db.execute(f"SELECT {columns} FROM trials ORDER BY key"):
                try:
                    read = {n: math.nan if value is None else float(value) for n, value in json.loads(measures).items()}
                    if state not in get_args(State):
                        raise ValueError(f"state {state!r}")
                except (AttributeError, TypeError, ValueError) as error:
                    raise StudyError(
                        f"{self._path}: row {key!r} of the table trials is damaged ({error}); "
                        "delete it, and the trial is run again"
                    ) from None
                yield Row(key, state, reason, read, *rest)

    def keys(self) -> set[str]:
        """Keys of all rows."""
        with self._translated_errors():
            return {key for (key,) in self._db.execute("SELECT key FROM trials")}

    def most(self, name: str) -> int:
        """Largest value of a number in the descriptions of the trials; −1 if no trial has it."""
        with self._translated_errors():
            largest = self._db.execute("SELECT max(json_extract(what, '$.' || ?)) FROM trials", (name,)).fetchone()[0]
            return -1 if largest is None else int(largest)

    def close(self) -> None:
        """Close the file and release its lock for other drivers."""
        self._db.close()
        os.close(self._lock)

    @contextmanager
    def _translated_errors(self) -> Generator[None]:
        """Raise SQLite's errors as a `StudyError` of one line."""
        try:
            yield
        except sqlite3.Error as error:
            cause = str(error)
            advice = "expected a database of `hvf trials`; give another --out"
            if "full" in cause:
                cause, advice = "the disk is full", "every trial so far is kept; make room, and start it again to go on"
            elif "locked" in cause:
                advice = "another program is writing it; close that, and start it again to go on"
            raise StudyError(f"{self._path}: {cause}; {advice}") from None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _acquire_lock(path: Path, database: Path) -> int:
    """Lock a file, and return its descriptor; the system releases the lock when the process ends in any way."""
    handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        holder = os.read(handle, 64).decode(errors="replace").strip()
        os.close(handle)
        raise StudyError(
            f"{database}: another hvf is writing it (process {holder or 'unknown'}); wait for it, or give another --out"
        ) from None
    os.ftruncate(handle, 0)
    os.pwrite(handle, str(os.getpid()).encode(), 0)
    return handle
