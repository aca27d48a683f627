"""The desk of the live page, without a browser: its processes, and every action of a user."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from experiments.config.options import run_config
from experiments.live.session.desk import MAX_UPLOAD_BYTES, Desk
from models.mocap.library import embedded, load
from models.mocap.readers.own_bvh import write_bvh
from sim.errors import SimError
from tests.captures import MOCAP, needs_mocap

PATIENCE = 300.0  # [s] for what takes a second or two on a machine that does nothing else

pytestmark = pytest.mark.processes


class LoggingDesk(Desk):
    """A desk that stores its messages."""

    def __init__(self, folder: Path):
        self.messages: list[str] = []
        super().__init__(folder, self.messages.append)

    def until(self, condition: Callable[[], bool], state: str, patience: float = PATIENCE) -> None:
        end = time.monotonic() + patience
        while not condition():
            assert time.monotonic() < end, f"not so after {patience:g} s: {state}; messages: {self.messages}"
            self.poll()
            time.sleep(0.01)


@pytest.fixture(scope="module")
def desk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LoggingDesk]:
    logging_desk = LoggingDesk(tmp_path_factory.mktemp("live"))
    logging_desk.build(run_config(mode="stretch", figure="kinematic", seconds=3600.0))
    logging_desk.until(lambda: logging_desk.built is not None, "the run is put together")
    yield logging_desk
    logging_desk.record("under way")
    logging_desk.until(lambda: logging_desk.now["recording"][0] > 0.8, "a take is under way")
    logging_desk.close()
    assert not logging_desk.engine.alive
    assert load(logging_desk.take("under way") / "edited.bvh").clip.duration > 0.7  # closing the page saves it


def time_of(desk: LoggingDesk) -> float:
    return float(desk.now["t"][0])


def test_time_runs_pauses_and_steps(desk: LoggingDesk) -> None:
    desk.until(lambda: time_of(desk) > 0.5, "time goes")
    desk.pause(True)
    desk.until(lambda: desk.paused, "it is paused")
    time.sleep(0.1)
    desk.poll()
    stands = time_of(desk)
    time.sleep(0.2)
    desk.poll()
    assert time_of(desk) == stands
    desk.step()
    desk.until(lambda: time_of(desk) > stands, "a step passes")
    time.sleep(0.1)
    desk.poll()
    assert time_of(desk) == pytest.approx(stands + 0.008)
    desk.pause(False)


def test_bend_is_undone_and_redone(desk: LoggingDesk) -> None:
    desk.until(lambda: len(desk.history) > 5, "something is remembered")
    place = desk.now["p"].copy()
    desk.hold(place + np.array([0.0, 0.0, 0.02]), pressed=True)
    desk.until(lambda: desk.now["p"][2] - place[2] > 0.01, "the stylus comes along")
    assert np.linalg.norm(desk.now["user"]) > 0.2
    desk.let_go()
    desk.until(lambda: desk.now["bends"][0] == 1.0, "the curve is bent")
    course = desk.now["course"].copy()
    desk.undo()
    desk.until(lambda: desk.now["bends"][0] == 0.0, "the bend is undone")
    desk.until(lambda: not np.array_equal(desk.now["course"], course), "the page is shown the curve")
    desk.redo()
    desk.until(lambda: desk.now["bends"][0] == 1.0, "it is made again")


def test_gain_changes_and_undo_update_the_verdict(desk: LoggingDesk) -> None:
    desk.until(lambda: bool(desk.verdict) and not desk.checking, "the first verdict")
    assert {v.stability.verdict for v in desk.verdict} == {"certified"}
    for seek in (9000.0, 11000.0):
        desk.set_gain("seek", seek)
    desk.until(lambda: desk.verdict[0].stability.verdict == "refuted", "the verdict turns red")
    assert "11000" in desk.verdict[0].stability.reason
    desk.undo()  # one movement of a slider is one undo step
    assert desk.config is not None
    assert desk.config.mode.seek == 150.0
    desk.until(lambda: desk.verdict[0].stability.verdict == "certified", "and green again")


def test_take_is_recorded_and_its_animation_loads(desk: LoggingDesk) -> None:
    with pytest.raises(SimError, match="cannot be named"):
        desk.record("../elsewhere")
    desk.record("take 1")
    desk.until(lambda: desk.now["recording"][0] > 0.8, "it is recorded")
    desk.stop()
    desk.until(lambda: desk.takes() == ("take 1",), "it is kept")
    desk.until(lambda: not desk.records, "it has ended")
    assert load(desk.take("take 1") / "edited.bvh").clip.duration > 0.7
    with pytest.raises(SimError, match="there is a take"):
        desk.record("take 1")


def test_run_continues_from_an_earlier_state(desk: LoggingDesk) -> None:
    desk.until(lambda: len(desk.history) > 60, "two seconds are remembered")
    back = desk.at(1.0)
    assert time_of(desk) - float(back["t"][0]) == pytest.approx(1.0, abs=0.2)
    before = time_of(desk)
    desk.go_back(1.0)
    desk.until(lambda: time_of(desk) < before - 0.5, "time is earlier")
    desk.reset()
    desk.until(lambda: time_of(desk) < 0.5, "it begins again")


def test_reset_while_paused_shows_the_stylus_on_its_curve(desk: LoggingDesk) -> None:
    desk.pause(True)
    desk.until(lambda: desk.paused, "it is paused")
    desk.reset()
    desk.until(lambda: 0.0 < time_of(desk) < 0.1, "it is at the beginning")
    assert np.linalg.norm(desk.now["p"][:2]) == pytest.approx(0.0477, abs=2e-3)
    stands = time_of(desk)
    desk.step()
    desk.until(lambda: time_of(desk) > stands, "a step passes")
    desk.pause(False)


def test_uploads_are_prepared_or_refused_in_one_line(desk: LoggingDesk, tmp_path: Path) -> None:
    with pytest.raises(SimError, match="expected at most 30 MB"):
        desk.upload("large.bvh", bytes(MAX_UPLOAD_BYTES + 1))
    with pytest.raises(SimError, match="no motion file"):
        desk.upload("picture.png", b"")
    desk.upload("../../broken.bvh", b"HIERARCHY\nROOT nobody\n{ oh }\n")
    with pytest.raises(SimError, match="one file at a time"):
        desk.upload("second.bvh", b"")
    desk.until(lambda: desk.preparing is None, "the broken one is answered")
    assert desk.messages[-1].startswith("broken.bvh")
    assert "\n" not in desk.messages[-1]
    assert str(desk.folder) not in desk.messages[-1]
    write_bvh(embedded("cheer"), tmp_path / "own.bvh")
    desk.upload("own.bvh", (tmp_path / "own.bvh").read_bytes())
    desk.until(lambda: "own" in desk.clips, "one's own is taken")
    desk.build(run_config(map="cylindrical", clips=(str(desk.clips["own"]),), figure="kinematic", seconds=3600.0))
    builds = desk.builds
    desk.until(lambda: desk.builds > builds, "and driven")
    assert desk.built is not None
    assert "own" in str(desk.built.drawn["title"])


def test_failed_build_is_reported_and_the_run_continues(desk: LoggingDesk) -> None:
    builds = desk.builds
    desk.build(run_config(map="cylindrical", clips=("nobody.bvh",), figure="kinematic"))
    desk.until(lambda: "nobody.bvh" in desk.messages[-1], "it is reported")
    assert desk.builds == builds
    before = time_of(desk)
    desk.until(lambda: time_of(desk) > before, "time goes on")


@needs_mocap
def test_asf_and_amc_upload_is_prepared_and_driven(desk: LoggingDesk) -> None:
    for name in ("02.asf", "02_03.amc"):
        desk.upload(name, (MOCAP / "cmu_amc" / name).read_bytes())
    desk.until(lambda: desk.preparing is None, "it is prepared", patience=4.0 * PATIENCE)
    assert "02_03" in desk.clips, desk.messages[-1]
    builds = desk.builds
    desk.build(run_config(map="cylindrical", clips=(str(desk.clips["02_03"]),), figure="kinematic", seconds=3600.0))
    desk.until(lambda: desk.builds > builds, "it is driven")
    before = desk.now["reference"].copy()
    desk.until(lambda: float(np.abs(desk.now["reference"] - before).max()) > 0.01, "the figure moves")
