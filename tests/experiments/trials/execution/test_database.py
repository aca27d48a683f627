"""The database of a study's trials."""

import sqlite3
from pathlib import Path

import pytest

from experiments.trials.design.study_config import StudyError
from experiments.trials.execution.database import Database
from experiments.trials.trial.run_trial import Row


def opened(path: Path, identity: str = "a") -> Database:
    return Database(path, identity, "study", "text")


def row(key: str, value: float = 1.0) -> Row:
    return Row(key, "done", "", {"effort": value, "sparc": float("nan")}, 0.5, "here", "processor")


def test_rows_round_trip_exactly(tmp_path: Path) -> None:
    with opened(tmp_path / "s.sqlite") as database:
        database.add(row("k", 0.1 + 0.2), {"user": 3})
    with opened(tmp_path / "s.sqlite") as database:
        (back,) = database.rows()
    assert back.measures["effort"] == 0.1 + 0.2
    assert back.measures["sparc"] != back.measures["sparc"]
    assert back[:3] == ("k", "done", "")


@pytest.mark.parametrize(
    "change", ["measures = '{bad'", "measures = '[1]'", """measures = '{"effort": "much"}'""", "state = 'odd'"]
)
def test_damaged_row_is_named(tmp_path: Path, change: str) -> None:
    with opened(tmp_path / "s.sqlite") as database:
        database.add(row("k"), {"user": 3})
    plain = sqlite3.connect(tmp_path / "s.sqlite", isolation_level=None)
    plain.execute(f"UPDATE trials SET {change}")
    plain.close()
    with opened(tmp_path / "s.sqlite") as database, pytest.raises(StudyError, match=r"row 'k'.* is damaged .* delete"):
        list(database.rows())


def test_table_has_the_documented_schema(tmp_path: Path) -> None:
    with opened(tmp_path / "s.sqlite") as database:
        database.add(row("k"), {"user": 3})
    plain = sqlite3.connect(tmp_path / "s.sqlite")
    assert plain.execute("PRAGMA journal_mode").fetchone() == ("wal",)
    assert plain.execute("SELECT key, json_extract(what, '$.user') FROM trials").fetchone() == ("k", 3)
    plain.close()


def test_second_driver_is_refused_and_the_first_continues(tmp_path: Path) -> None:
    with opened(tmp_path / "s.sqlite") as first:
        with pytest.raises(StudyError, match="another hvf is writing it"):
            opened(tmp_path / "s.sqlite")
        first.add(row("k"), {})
    with opened(tmp_path / "s.sqlite") as again:
        assert again.keys() == {"k"}


def test_full_disk_is_reported_and_keeps_the_rows(tmp_path: Path) -> None:
    with opened(tmp_path / "s.sqlite") as database:
        database.add(row("first"), {})
        pages = database._db.execute("PRAGMA page_count").fetchone()[0]
        database._db.execute(f"PRAGMA max_page_count = {pages + 2}")  # SQLite refuses further pages, as on a full disk
        with pytest.raises(StudyError, match="the disk is full; every trial so far is kept"):
            database.add(row("large"), {"padding": "x" * 40_000})
    with opened(tmp_path / "s.sqlite") as again:
        assert "first" in again.keys()  # noqa: SIM118 - not a mapping


@pytest.mark.parametrize("change", ["version", "study", "other", "none"])
def test_foreign_database_is_refused_and_unchanged(tmp_path: Path, change: str) -> None:
    path = tmp_path / "s.sqlite"
    if change == "none":
        path.write_bytes(b"no database at all, but long enough to be taken for a file" * 4)
    elif change == "other":
        sqlite3.connect(path).execute("CREATE TABLE mine (x)")
    else:
        with opened(path) as database:
            database.add(row("k"), {})
        if change == "version":
            plain = sqlite3.connect(path)
            plain.execute("PRAGMA user_version = 99")
            plain.close()
    before = path.read_bytes()
    messages = {
        "version": "of version 99",
        "study": "holds another study",
        "other": "something else",
        "none": "not a data",
    }
    with pytest.raises(StudyError, match=messages[change]):
        opened(path, "b" if change == "study" else "a")
    assert path.read_bytes()[:64] == before[:64]
    if change in ("version", "study"):
        plain = sqlite3.connect(path)
        assert plain.execute("SELECT count(*) FROM trials").fetchone() == (1,)
        plain.close()
