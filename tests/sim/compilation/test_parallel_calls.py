"""Calls in separate processes: their side effects remain, and a failing call does not affect others."""

from pathlib import Path

from sim.compilation.workers import processors, run_in_workers


def test_side_effects_of_calls_remain_and_failed_calls_are_left_out(tmp_path: Path) -> None:
    folders = [tmp_path / name for name in ("a", "b", "missing/c", "d")]
    ended: list[int] = []
    run_in_workers([(Path.mkdir, (folder,)) for folder in folders], ended.append)
    assert sorted(ended) == [0, 1, 3]
    assert [folder.is_dir() for folder in folders] == [True, True, False, True]


def test_printed_numbers_are_not_taken_for_call_indices() -> None:
    ended: list[int] = []
    run_in_workers([(print, ("7",)), (print, ("no number",))], ended.append)
    assert sorted(ended) == [0, 1]


def test_process_count_is_between_one_and_four() -> None:
    assert 1 <= processors() <= 4
