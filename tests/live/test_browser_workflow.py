"""The animator's workflow in a browser: bend, perform, look back, record and compare takes."""

import time
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest

from experiments.config.options import run_config
from experiments.live import driving_browser
from experiments.live.session.take_mix import FPS, TakeData
from geometry.arrays import Array
from sim.recording.recording import Recording
from sim.viewer.actor import Actor
from sim.viewer.live_stage import GHOST_AT
from tests.live.browser import ServedPage, choose, control_beside, drag, fill, new_tab, on_screen, save_screenshot

pytestmark = pytest.mark.processes


@pytest.fixture(scope="module")
def served(chromium: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServedPage]:
    config = run_config(mode="stretch-then-follow", figure="kinematic", seconds=3600.0)
    page = ServedPage(config, tmp_path_factory.mktemp("live"))
    yield page
    page.close()


@pytest.fixture(scope="module")
def tab(chromium: Any, served: ServedPage) -> Iterator[Any]:
    page = new_tab(chromium, served.address, height=720)
    yield page
    page.close()


@pytest.fixture(autouse=True)
def resume(served: ServedPage) -> None:
    served.desk.let_go()
    served.desk.pause(False)


def button(tab: Any, name: str) -> Any:
    return tab.get_by_role("button", name=name, exact=True).first


def drawn_positions(actor: Actor) -> Array:
    """Where an actor's bodies are drawn [m], shape (n, 3)."""
    return np.array([frame.position for frame in actor._frames.values()])


def body_positions(served: ServedPage, pose: Array, at: Array) -> Array:
    """Where the bodies of the figure are in a pose (75,) [m]."""
    stage = served.page.stage
    assert stage is not None
    data = mujoco.MjData(stage._model)
    data.qpos[stage._root : stage._root + len(pose)] = pose
    mujoco.mj_kinematics(stage._model, data)
    return data.xpos[list(stage._figure._frames)] + at


def test_curve_is_bent_with_the_page_switch_and_performed(tab: Any, served: ServedPage) -> None:
    desk = served.desk
    desk.pause(True)
    place = served.settled()["p"].copy()
    tab.get_by_label("Grab and bend").check()
    with drag(tab, lambda: on_screen(place, height=720), (0, -60)):
        served.assert_until(lambda: desk.holds, "the stylus is held")
        desk.pause(False)
        served.assert_until(lambda: desk.now["p"][2] - place[2] > 0.01, "it comes along")
    served.assert_until(lambda: desk.now["bends"][0] == 1.0, "the curve is bent")
    tab.get_by_label("Grab and bend").uncheck()
    button(tab, "Perform the bent curve").click()
    served.assert_until(lambda: desk.now["performs"][0] > 0.0, "it is performed")
    high = float(desk.now["course"].reshape(-1, 3)[:, 2].max())
    served.assert_until(lambda: desk.now["p"][2] > 0.7 * high, "the stylus goes up where the curve was bent up")
    save_screenshot(tab, "performed")
    button(tab, "Bend it again").click()
    served.assert_until(lambda: desk.now["performs"][0] == 0.0, "it can be bent again")


def test_keys_control_time_undo_and_switch(tab: Any, served: ServedPage) -> None:
    desk = served.desk
    tab.get_by_text("First steps").first.click()  # a key belongs to the page, not to a field
    for key, paused in ((" ", True), (" ", False), (" ", True)):
        tab.keyboard.press(key)
        served.assert_until(lambda paused=paused: desk.paused is paused, "space stops time, and lets it go on")
    stands = float(served.settled()["t"][0])
    tab.keyboard.press("n")
    served.assert_until(lambda: float(desk.now["t"][0]) == pytest.approx(stands + 0.008), "N steps")
    tab.keyboard.press("z")
    served.assert_until(lambda: desk.now["bends"][0] == 0.0, "Z undoes the bend")
    tab.keyboard.press("y")
    served.assert_until(lambda: desk.now["bends"][0] == 1.0, "Y does it again")
    tab.keyboard.press("g")
    served.assert_until(lambda: served.page._clock.pressed, "G presses the switch")
    tab.keyboard.press("g")
    served.assert_until(lambda: not served.page._clock.pressed, "and lets it go")
    tab.keyboard.press("r")
    served.assert_until(lambda: float(desk.now["t"][0]) < stands, "R resets")
    tab.keyboard.press(" ")
    served.assert_until(lambda: not desk.paused, "and time goes on")


def test_pace_setting_slows_time(tab: Any, served: ServedPage) -> None:
    choose(tab, "Pace", "1/10")
    served.assert_until(lambda: 0.0 < served.desk.now["pace"][0] < 0.12, "a tenth of real time")
    choose(tab, "Pace", "real time")
    served.assert_until(lambda: served.desk.now["pace"][0] > 0.12, "and faster again")


def record(tab: Any, served: ServedPage, name: str, seconds: float) -> None:
    fill(tab, "Name", name)
    served.assert_until(lambda: served.page._takes._name.value == name, "the name has come")
    button(tab, "Record").click()
    served.assert_until(lambda: bool(served.desk.now["recording"][0] > seconds), "it is recorded")
    button(tab, "Stop").click()
    served.assert_until(lambda: name in served.desk.takes() and not served.desk.records, "it is kept")


def test_takes_are_named_and_invalid_names_answered(tab: Any, served: ServedPage) -> None:
    desk = served.desk
    button(tab, "Perform the bent curve").click()
    served.assert_until(lambda: desk.now["performs"][0] > 0.0, "it is performed")
    tab.get_by_role("tab", name="Takes").click()
    record(tab, served, "shy", 2.0)
    desk.pause(True)
    place = served.settled()["p"].copy()
    with drag(tab, lambda: on_screen(place, height=720), (0, -40)):
        served.assert_until(lambda: desk.holds, "the stylus is held")
        desk.pause(False)
        desk.record("proud")  # by the desk, for the mouse holds the hand
        served.assert_until(lambda: bool(desk.now["recording"][0] > 2.0), "it is recorded")
        desk.stop()
    served.assert_until(lambda: desk.takes() == ("proud", "shy") and not desk.records, "both are kept")
    for wrong, message in (("../elsewhere", "cannot be named"), ("shy", "there is a take 'shy' already")):
        fill(tab, "Name", wrong)
        served.assert_until(lambda wrong=wrong: served.page._takes._name.value == wrong, "the name has come")
        button(tab, "Record").click()
        tab.get_by_text(message, exact=False).last.wait_for()
    assert not desk.records


def test_two_takes_are_overlaid(tab: Any, served: ServedPage) -> None:
    takes = served.page._takes
    served.assert_until(lambda: "shy" in takes._list.options and "proud" in takes._list.options, "they are offered")
    choose(tab, "Take", "proud")
    served.assert_until(lambda: takes._list.value == "proud", "one is chosen")
    tab.get_by_text("Compare and mix").click()
    choose(tab, "With", "shy")
    served.assert_until(lambda: takes._other.value == "shy", "and the other one")
    tab.get_by_label("Show both").check()
    served.assert_until(lambda: takes.compares, "both are shown")
    for name in ("proud", "shy"):
        tab.get_by_text(f"{name}:").first.wait_for()
    save_screenshot(tab, "two-takes")
    pair = [TakeData.of(served.desk.take(name)) for name in ("proud", "shy")]
    ghosts = takes._ghosts
    assert ghosts is not None
    assert len(ghosts._paths) == 2
    for ghost, take in zip(ghosts._ghosts, pair, strict=True):
        seen = drawn_positions(ghost)
        everywhere = [float(np.abs(body_positions(served, pose, GHOST_AT) - seen).max()) for pose in take.poses]
        assert min(everywhere) < 1e-6, take.name  # a frame of the take, and of no other
    t, first, second = takes._plot.data
    np.testing.assert_allclose(t[: len(pair[1].force)], np.arange(len(pair[1].force)) / FPS)
    np.testing.assert_allclose(first[: len(pair[0].force)], pair[0].force)
    np.testing.assert_allclose(second[: len(pair[1].force)], pair[1].force)
    tab.get_by_label("Show both").uncheck()
    served.assert_until(lambda: not takes.compares, "the default animation is back")


def test_events_between_pictures_are_handled(served: ServedPage) -> None:
    page, takes = served.page, served.page._takes
    event = SimpleNamespace(client_id=page.driver.client, client=None)

    def flip(_: Any) -> None:
        takes._compare.value = not takes._compare.value
        takes._on_compare()

    for _ in range(16):
        page.acts(flip)(event)
        time.sleep(0.01)
    served.assert_until(lambda: not takes.compares, "the page is there, and shows the default animation")


def test_timeline_is_scrubbed_to_the_past_and_back(tab: Any, served: ServedPage) -> None:
    desk, stage = served.desk, served.page.stage
    assert stage is not None
    tab.get_by_role("tab", name="Takes").click()
    begin = float(desk.now["t"][0])
    record(tab, served, "looked at", 2.5)
    tab.get_by_role("tab", name="Play").click()
    box = control_beside(tab, "Look back [s]").get_by_role("slider").bounding_box()
    x, y = box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"]
    tab.mouse.move(x, y)
    tab.mouse.down()
    tab.mouse.move(x - 4.0, y)
    tab.mouse.move(x - 6.0, y)
    served.assert_until(lambda: desk.paused and served.page._clock.seconds_ago > 1.0, "one looks back")
    tab.mouse.up()
    t = served.settled()["t"][0] - served.page._clock.seconds_ago
    served.assert_until(lambda: abs(stage._t - t) < 0.06, "the picture is of then")
    save_screenshot(tab, "looked-back")
    with Recording(desk.take("looked at") / "run.h5") as recording:
        times = recording.channel("frames", "t")[:]
        poses = recording.channel("frames", "reference")[:]
    assert begin <= stage._t <= begin + float(times[-1]) + 3.0
    seen = drawn_positions(stage._figure)
    distances = np.array([float(np.abs(body_positions(served, pose, np.zeros(3)) - seen).max()) for pose in poses[::4]])
    assert distances.min() < 5e-3
    now = float(np.abs(body_positions(served, desk.now["reference"], np.zeros(3)) - seen).max())
    assert now > 5.0 * distances.min()
    tab.mouse.move(x - 6.0, y)
    tab.mouse.down()
    tab.mouse.move(x, y)
    tab.mouse.move(x + 30.0, y)
    tab.mouse.up()
    served.assert_until(lambda: served.page._clock.seconds_ago == 0.0, "now is at the right")
    served.assert_until(lambda: stage._t == float(desk.now["t"][0]), "the picture is of now")
    button(tab, "Pause").click()
    before = float(desk.now["t"][0])
    served.assert_until(lambda: stage._t > before + 0.2, "and goes on")


def test_run_continues_from_the_displayed_past(tab: Any, served: ServedPage) -> None:
    desk = served.desk
    tab.get_by_role("tab", name="Play").click()
    served.assert_until(lambda: float(desk.now["t"][0]) > 3.0, "there is something to look back to")
    fill(tab, "Look back [s]", "-2")
    served.assert_until(lambda: served.page._clock.seconds_ago == 2.0, "one looks back")
    before = float(served.settled()["t"][0])
    button(tab, "Resume from there").click()
    served.assert_until(lambda: float(desk.now["t"][0]) < before - 1.5, "time is earlier")
    served.assert_until(lambda: not desk.paused and served.page._clock.seconds_ago == 0.0, "and goes on")


def test_curves_are_plotted_live(tab: Any, served: ServedPage) -> None:
    tab.get_by_text("Curves", exact=True).first.click()
    plots = tab.locator(".u-over")
    plots.first.wait_for()
    assert plots.count() >= 3
    plots.first.scroll_into_view_if_needed()
    before = float(served.page._plots._force.data[0][-1])
    served.assert_until(lambda: float(served.page._plots._force.data[0][-1]) > before, "they go on")
    save_screenshot(tab, "curves")
    tab.get_by_text("Curves", exact=True).first.click()


def test_second_browser_watches_and_takes_over_an_idle_driver(
    chromium: Any, tab: Any, served: ServedPage, monkeypatch: pytest.MonkeyPatch
) -> None:
    desk, arbiter = served.desk, served.page.driver
    tab.get_by_role("tab", name="Play").click()
    button(tab, "Reset").click()
    served.assert_until(lambda: arbiter.client is not None, "somebody drives")
    first = arbiter.client
    other = new_tab(chromium, served.address)
    try:
        other.get_by_text(f"browser {first} drives").wait_for()  # it watches
        before = float(desk.now["t"][0])
        button(other, "Reset").click()
        other.get_by_text("Somebody else drives").first.wait_for()
        served.assert_until(lambda: float(desk.now["t"][0]) > before, "time goes on")
        button(tab, "Step").click()
        button(other, "Drive").click()
        other.get_by_text("Somebody drives.").last.wait_for()
        assert arbiter.client == first
        monkeypatch.setattr(driving_browser, "MAX_IDLE_TIME", 0.0)
        button(other, "Drive").click()
        served.assert_until(lambda: arbiter.client not in (None, first), "the other one drives")
        button(other, "Reset").click()
        served.assert_until(lambda: float(desk.now["t"][0]) < before, "and what it does counts")
    finally:
        other.close()
    served.assert_until(lambda: arbiter.client is None, "nobody drives")
