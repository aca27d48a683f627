"""Calls in processes of their own: what they keep is there afterwards, and one that fails takes none with it."""

from pathlib import Path

from sim.compilation.side_by_side import processors, side_by_side


def test_what_calls_keep_is_there_afterwards_and_a_failure_is_left_out(tmp_path: Path) -> None:
    folders = [tmp_path / name for name in ("a", "b", "missing/c", "d")]
    ended: list[int] = []
    side_by_side([(Path.mkdir, (folder,)) for folder in folders], ended.append)
    assert sorted(ended) == [0, 1, 3]
    assert [folder.is_dir() for folder in folders] == [True, True, False, True]


def test_what_a_call_prints_is_not_taken_for_a_number() -> None:
    ended: list[int] = []
    side_by_side([(print, ("7",)), (print, ("no number",))], ended.append)
    assert sorted(ended) == [0, 1]


def test_there_is_at_least_one_at_a_time() -> None:
    assert 1 <= processors() <= 4
