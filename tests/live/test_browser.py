"""The live page in Debian's chromium, used by Playwright's mouse and keyboard."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.config.options import run_config
from experiments.live.access_gate import AccessGate
from experiments.live.cap_hand import CapHand
from experiments.live.panels.clock_panel import KEY_STEP
from experiments.live.session.desk import MAX_UPLOAD_BYTES
from models.mocap.library import load
from sim.devices.spacemouse import SpaceMouse
from sim.recording.recording import Recording
from sim.viewer.live_stage import LiveStage
from tests.captures import MOCAP, needs_mocap
from tests.devices.hand_made import Cap
from tests.live.browser import PATIENCE, ServedPage, choose, drag, new_tab, on_screen, save_screenshot

pytestmark = pytest.mark.processes

TOKEN = "0123456789abcdef"
CAPTURE = MOCAP / "xia" / "strutting_01_000.bvh"  # prepared in seconds


@pytest.fixture(scope="module")
def served(chromium: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServedPage]:
    config = run_config(mode="stretch", figure="kinematic", cutoff=149.0, seconds=3600.0)
    page = ServedPage(config, tmp_path_factory.mktemp("live"))
    yield page
    page.close()


@pytest.fixture(scope="module")
def tab(chromium: Any, served: ServedPage) -> Iterator[Any]:
    page = new_tab(chromium, served.address)
    yield page
    if not page.is_closed():
        page.close()


@pytest.fixture(autouse=True)
def resume(served: ServedPage) -> Iterator[None]:
    """Release the stylus and resume time, whatever the previous test left."""
    served.desk.let_go()
    served.desk.pause(False)
    yield
    served.page.say("—")


def arrow_of(stage: LiveStage) -> float:
    """Drawn length of the hand's arrow [m], 0 where none is drawn."""
    shaft = np.diff(stage._arrows["user"].points[0], axis=0)
    return float(np.linalg.norm(shaft)) if stage._arrows["user"].visible else 0.0


def test_dragged_hand_moves_the_figure_and_lengthens_the_force_arrow(tab: Any, served: ServedPage) -> None:
    desk, stage = served.desk, served.page.stage
    assert stage is not None
    desk.pause(True)
    drawn = served.settled()
    pose, place = drawn["reference"].copy(), drawn["p"].copy()
    assert arrow_of(stage) == 0.0
    with drag(tab, lambda: on_screen(place), (0, -60)):
        served.assert_until(lambda: desk.holds, "the stylus is held")
        desk.pause(False)
        served.assert_until(lambda: desk.now["p"][2] - place[2] > 0.004, "it comes along")
        served.assert_until(lambda: arrow_of(stage) > 0.05, "the arrow of the hand has grown")
        served.assert_until(
            lambda: float(np.abs(desk.now["reference"] - pose).max()) > 1e-3, "the figure's pose changes"
        )
        save_screenshot(tab, "dragged")
    served.assert_until(lambda: not desk.holds, "it is let go")


def test_curve_is_bent_and_the_bend_undone(tab: Any, served: ServedPage) -> None:
    desk = served.desk
    served.assert_until(lambda: desk.now["distance"][0] < 0.001, "the stylus is on the curve")
    desk.pause(True)
    place = served.settled()["p"].copy()
    tab.keyboard.down("Shift")
    with drag(tab, lambda: on_screen(place), (0, -60)):
        served.assert_until(lambda: desk.holds, "the stylus is held")
        desk.pause(False)
        served.assert_until(lambda: desk.now["p"][2] - place[2] > 0.01, "it comes along")
        save_screenshot(tab, "bending")
    tab.keyboard.up("Shift")
    served.assert_until(lambda: desk.now["bends"][0] == 1.0, "the curve is bent")
    bent = desk.now["course"].copy()
    tab.get_by_role("button", name="Undo").first.click()
    served.assert_until(lambda: desk.now["bends"][0] == 0.0, "the bend is undone")
    served.assert_until(lambda: float(np.abs(desk.now["course"] - bent).max()) > 0.005, "the curve is where it was")
    tab.get_by_role("button", name="Redo").first.click()
    served.assert_until(lambda: desk.now["bends"][0] == 1.0, "the bend is done again")
    tab.get_by_role("button", name="Undo").first.click()
    served.assert_until(lambda: desk.now["bends"][0] == 0.0, "and undone")


def test_keys_move_and_release_the_hand(tab: Any, served: ServedPage) -> None:
    desk = served.desk
    desk.pause(True)
    place = served.settled()["p"].copy()
    for key in "LLLUU":
        tab.keyboard.press(key.lower())
    served.assert_until(lambda: desk.holds and desk.target[2] > place[2] + 1.5 * KEY_STEP, "the keys have arrived")
    np.testing.assert_allclose(desk.target - place, [3 * KEY_STEP, 0.0, 2 * KEY_STEP], atol=1e-9)
    desk.pause(False)
    served.assert_until(lambda: float(np.linalg.norm(desk.now["user"])) > 0.2, "the hand pulls")
    tab.keyboard.press("h")
    served.assert_until(lambda: not desk.holds, "it is let go")


def test_spacemouse_moves_the_hand_while_pushed(tab: Any, served: ServedPage) -> None:
    desk, cap = served.desk, Cap()
    served.page._cap = CapHand(SpaceMouse(cap, "SpaceNavigator", "test"))
    cap.push(0, 0, -200)  # the cap is lifted
    place = desk.now["p"][2]
    served.assert_until(lambda: desk.holds and desk.target[2] > place + 0.01, "the hand goes up")
    cap.push(0, 0, 0)
    served.assert_until(lambda: not desk.holds, "it is let go")
    cap.plugged = False
    served.assert_until(lambda: served.page._cap is None, "it is gone")
    tab.get_by_text("The SpaceMouse was disconnected.").wait_for()


def test_gain_moved_beyond_stability_turns_its_verdict_red(tab: Any, served: ServedPage) -> None:
    tab.get_by_role("tab", name="Gains").click()
    tab.locator(".verdict-certified").first.wait_for()
    save_screenshot(tab, "green")
    field = tab.locator("input[type=text]:visible").first
    field.fill("11000")
    field.press("Enter")
    tab.locator(".verdict-refuted").first.wait_for()
    save_screenshot(tab, "red")
    assert served.desk.config.mode.seek == 11000.0
    tab.get_by_role("tab", name="Play").click()
    tab.get_by_role("button", name="Undo").first.click()
    served.assert_until(lambda: served.desk.config.mode.seek < 11000.0, "the gain is back")
    tab.get_by_role("tab", name="Gains").click()
    tab.locator(".verdict-refuted").first.wait_for(state="detached")


def record(tab: Any, served: ServedPage, name: str, seconds: float = 1.5) -> None:
    tab.get_by_role("button", name="Record", exact=True).click()
    served.assert_until(lambda: bool(served.desk.now["recording"][0] > seconds), "it is recorded")
    tab.get_by_role("button", name="Stop").click()
    served.assert_until(lambda: name in served.desk.takes(), "it is kept")


def downloaded(tab: Any, button: str, path: Path) -> Path:
    with tab.expect_download() as download:
        tab.get_by_role("button", name=button, exact=True).click()
    download.value.save_as(path)
    return path


def test_takes_are_recorded_downloaded_compared_and_mixed(tab: Any, served: ServedPage, tmp_path: Path) -> None:
    tab.get_by_role("tab", name="Takes").click()
    record(tab, served, "take 1")
    served.desk.hold(served.desk.now["p"] + np.array([0.0, 0.0, 0.03]), False)
    record(tab, served, "take 2")
    served.desk.let_go()
    served.assert_until(lambda: served.page._takes._list.value == "take 2", "it is chosen")
    assert load(downloaded(tab, "BVH", tmp_path / "edited.bvh")).clip.duration > 1.0
    with Recording(downloaded(tab, "Recording", tmp_path / "recording.h5")) as recording:
        assert recording.channel("ticks", "t")[-1] > 1.0
    assert '"stretch"' in downloaded(tab, "Configuration", tmp_path / "config.json").read_text()
    tab.get_by_text("Compare and mix").click()
    tab.get_by_label("Show both").click()
    served.assert_until(lambda: served.page._takes.compares, "both are shown")
    tab.get_by_text("take 1:").first.wait_for()
    tab.wait_for_timeout(500.0)
    save_screenshot(tab, "compared")
    served.page._takes._region_slider.value = (0.2, 1.2)
    tab.get_by_role("button", name="Take over").click()
    tab.get_by_text("0.2 to 1.2 s from take 1").wait_for()
    mix = load(downloaded(tab, "Download the mix as BVH", tmp_path / "mix.bvh")).clip
    alone = load(tmp_path / "edited.bvh").clip
    assert mix.poses.shape == alone.poses.shape
    changed = np.abs(mix.poses - alone.poses).max(axis=1) > 1e-3
    assert changed[35]
    assert not changed[:10].any()
    tab.get_by_role("button", name="Undo").last.click()
    tab.get_by_text("no regions").wait_for()
    tab.get_by_label("Show both").click()
    served.assert_until(lambda: not served.page._takes.compares, "the default animation is back")


def test_mode_is_switched_on_the_same_device(tab: Any, served: ServedPage) -> None:
    tab.get_by_role("tab", name="Play").click()
    choose(tab, "Mode", "follow")
    tab.get_by_role("button", name="Run this").click()
    served.assert_until(lambda: served.desk.built.config.mode.kind == "follow", "it runs")
    assert served.desk.built.config.device.cutoff == 149.0
    tab.get_by_label("Grab and bend").wait_for(state="detached")
    save_screenshot(tab, "follow")


def upload(tab: Any, file: Any) -> None:
    tab.get_by_role("tab", name="Clips").click()
    with tab.expect_file_chooser() as chooser:
        tab.get_by_role("button", name="Upload a motion").click()
    chooser.value.set_files(file)


def test_upload_of_invalid_motion_is_answered_in_the_page(tab: Any, served: ServedPage) -> None:
    upload(tab, {"name": "broken.bvh", "mimeType": "text/plain", "buffer": b"HIERARCHY\nROOT x\n{ oh }\n"})
    tab.get_by_text("broken.bvh:3: found 'oh'", exact=False).last.wait_for()
    served.assert_until(lambda: served.desk.preparing is None, "the next one can come")
    save_screenshot(tab, "refused")


def test_upload_beyond_the_size_limit_is_answered_in_the_page(tab: Any, served: ServedPage, tmp_path: Path) -> None:
    large = tmp_path / "large.bvh"
    large.write_bytes(b"HIERARCHY\n" + b" " * (MAX_UPLOAD_BYTES + 500_000))
    upload(tab, large)
    tab.get_by_text("large.bvh has 30.5 MB", exact=False).last.wait_for()
    assert not (served.desk.folder / "uploads" / "large.bvh").exists()


@needs_mocap
def test_capture_is_uploaded_prepared_and_driven(tab: Any, served: ServedPage) -> None:
    served.desk.pause(True)  # without a graphics card, drawing competes with preparation
    upload(tab, CAPTURE)
    tab.get_by_text("Preparing", exact=False).first.wait_for()
    served.assert_until(lambda: CAPTURE.stem in served.desk.clips, "it is prepared", patience=4.0 * PATIENCE)
    served.desk.pause(False)
    tab.get_by_role("tab", name="Play").click()
    tab.get_by_role("button", name="Run this").click()
    served.assert_until(lambda: CAPTURE.stem in str(served.desk.built.config.map.clips), "it runs")
    before = float(served.desk.now["t"][0])
    served.assert_until(lambda: float(served.desk.now["t"][0]) > before + 0.5, "time goes on")
    served.desk.hold(served.desk.now["p"] + np.array([0.0, 0.0, 0.02]), False)
    served.assert_until(lambda: float(np.linalg.norm(served.desk.now["user"])) > 0.2, "it is driven")
    save_screenshot(tab, "own-motion")


def test_closed_tab_leaves_the_run_and_a_phone_takes_over(chromium: Any, tab: Any, served: ServedPage) -> None:
    served.desk.hold(served.desk.now["p"], False)
    tab.close()
    served.assert_until(lambda: served.page.driver.client is None, "the driver has left")
    assert not served.desk.holds
    before = float(served.desk.now["t"][0])
    phone = new_tab(chromium, served.address, width=390, height=780)
    served.assert_until(lambda: float(served.desk.now["t"][0]) > before, "time went on")
    phone.wait_for_timeout(2000.0)
    save_screenshot(phone, "phone")
    phone.get_by_role("button", name="Reset").click()
    served.assert_until(lambda: float(served.desk.now["t"][0]) < before, "the other one drives")
    phone.close()


def test_only_the_right_token_opens_the_page(chromium: Any, served: ServedPage) -> None:
    gate = AccessGate("127.0.0.1", 0, served.page.port, TOKEN)
    context = chromium.new_context()
    try:
        page = context.new_page()
        page.set_default_timeout(1e3 * PATIENCE)
        answered = page.goto(f"http://127.0.0.1:{gate.port}/?token=wrong")
        assert answered is not None
        assert answered.status == 403
        page.goto(f"http://127.0.0.1:{gate.port}/?token={TOKEN}")
        page.get_by_role("button", name="Reset").wait_for()  # the panels come through the web socket
        assert "token" not in page.url
    finally:
        context.close()
        gate.close()
