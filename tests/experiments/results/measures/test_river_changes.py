"""Switches between rivers in a recording: each is found once, at its first tick."""

from pathlib import Path

import numpy as np

from experiments.results.measures import changes
from experiments.results.measures.changes import LOST, RiverChange, river_changes
from sim.recording.recorder import Group, Recorder
from sim.recording.recording import Recording

# The fifth and the last but one interval are too short to count.
RIVER = np.repeat([-1.0, 0.0, -1.0, 0.0, 2.0, 1.0, -1.0, 2.0, 0.0, 1.0], [30, 50, 40, 60, 20, 70, 20, 80, 39, 90])


def _recorded(path: Path, names: bool) -> Recording:
    static: dict[str, str] = {"river_names": "level\nwave\nhigh"} if names else {}
    with Recorder(path, {}, 0, {"ticks": Group(1000.0, {"t": (), "river": ()})}, static) as recorder:
        recorder.append("ticks", {"t": np.arange(len(RIVER)) / 1000.0, "river": RIVER})
    return Recording(path)


def test_changes_are_found_at_their_first_tick_for_any_block_size(tmp_path: Path, monkeypatch) -> None:
    expected = (
        RiverChange(0.2, "level", "wave"), RiverChange(0.29, "wave", "high"), RiverChange(0.409, "high", "wave"),
    )  # fmt: skip
    with _recorded(tmp_path / "run.h5", True) as recording:
        for rows in (1, 2, 7, 70, 1000):
            monkeypatch.setattr(changes, "ROWS", rows)
            assert river_changes(recording) == expected
    assert expected[0].line() == "t = 0.20 s: level → wave"


def test_field_without_rivers_has_no_changes(tmp_path: Path) -> None:
    with _recorded(tmp_path / "run.h5", False) as recording:
        assert river_changes(recording) == ()


def test_hand_that_no_river_has_until_the_end_is_told(tmp_path: Path) -> None:
    """Rivers that the governor gates let a hand go that is pushed out of one, if it is too slow for the others."""
    for seconds, told in ((0.9, ()), (1.5, (RiverChange(0.4, "wave", LOST),))):
        path = tmp_path / f"{seconds}.h5"
        river = np.repeat([1.0, -1.0], [400, round(1000 * seconds)])
        group, static = Group(1000.0, {"t": (), "river": ()}), {"river_names": "level\nwave\nhigh"}
        with Recorder(path, {}, 0, {"ticks": group}, static) as recorder:
            recorder.append("ticks", {"t": np.arange(len(river)) / 1000.0, "river": river})
        with Recording(path) as recording:
            assert river_changes(recording) == told
