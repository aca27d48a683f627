"""A person in front of the live page: Debian's chromium, Playwright's mouse."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.config.words import run_config
from experiments.live.gate import Gate
from models.mocap.library import load
from tests.live.browser import ARGUMENTS, CHROMIUM, PATIENCE, Served, needs_chromium, on_screen

pytestmark = pytest.mark.processes

WIDTH, HEIGHT = 900, 520
TOKEN = "0123456789abcdef"


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    needs_chromium()
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def served(chromium: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    it = Served(run_config(mode="stretch", figure="kinematic", seconds=3600.0), tmp_path_factory.mktemp("live"))
    yield it
    it.close()


@pytest.fixture(scope="module")
def tab(chromium: Any, served: Served) -> Iterator[Any]:
    page = chromium.new_page(viewport={"width": WIDTH, "height": HEIGHT})
    page.set_default_timeout(1e3 * PATIENCE)
    page.goto(served.address)
    page.get_by_role("button", name="Pause").wait_for()
    yield page
    if not page.is_closed():
        page.close()


def kept(tab: Any, folder: Path, name: str) -> None:
    """Keep a picture of the page for who looks."""
    tab.screenshot(path=folder / f"{name}.png")


def drawn(tab: Any, served: Served) -> None:
    """Wait until the browser has drawn a few pictures of a scene that stands."""
    tab.evaluate(
        "new Promise(done => { let n = 0; const f = () => ++n > 3 ? done(0) : requestAnimationFrame(f); f() })"
    )


def test_the_hand_is_dragged_the_arrow_grows_and_the_curve_is_bent(tab: Any, served: Served, tmp_path: Path) -> None:
    desk = served.desk
    tab.get_by_text("Grab (press the switch)").wait_for()
    desk.pause(True)
    tab.wait_for_timeout(4000.0)
    pose, x, y = desk.now["reference"].copy(), *on_screen(desk.now["p"], WIDTH, HEIGHT)
    tab.mouse.move(x, y)
    tab.keyboard.down("Shift")
    tab.mouse.down()
    for k in range(6):
        tab.mouse.move(x, y - 6.0 * k)
        drawn(tab, served)
    served.until(lambda: desk.holds, "the stylus is held")
    place = desk.now["p"].copy()
    desk.pause(False)
    served.until(lambda: desk.now["p"][2] - place[2] > 0.004, "it comes along")
    assert np.linalg.norm(desk.now["user"]) > 0.2
    stage = served.page.stage
    assert stage is not None
    served.until(lambda: bool(stage._arrows["user"].visible), "the arrow of the hand is drawn")
    assert np.abs(desk.now["reference"] - pose).max() > 1e-3
    kept(tab, tmp_path, "dragged")
    tab.mouse.up()
    tab.keyboard.up("Shift")
    served.until(lambda: desk.now["bends"][0] == 1.0, "the curve is bent")
    tab.get_by_role("button", name="Undo").first.click()
    served.until(lambda: desk.now["bends"][0] == 0.0, "the bend is undone")


def test_a_gain_is_moved_until_its_verdict_turns_red(tab: Any, served: Served, tmp_path: Path) -> None:
    tab.get_by_role("tab", name="Gains").click()
    tab.locator(".verdict-certified").first.wait_for()
    field = tab.locator("input[type=text]:visible").first
    field.fill("11000")
    field.press("Enter")
    tab.locator(".verdict-refuted").first.wait_for()
    kept(tab, tmp_path, "red")
    assert served.desk.config.mode.seek == 11000.0
    served.desk.undo()
    tab.locator(".verdict-refuted").first.wait_for(state="detached")


def test_a_take_is_recorded_and_its_bvh_downloaded(tab: Any, served: Served, tmp_path: Path) -> None:
    tab.get_by_role("tab", name="Takes").click()
    tab.get_by_role("button", name="Record", exact=True).click()
    served.until(lambda: served.desk.now["recording"][0] > 1.0, "it is recorded")
    tab.get_by_role("button", name="Stop").click()
    served.until(lambda: served.desk.takes() == ("take 1",), "it is kept")
    tab.wait_for_timeout(1000.0)
    with tab.expect_download() as download:
        tab.get_by_role("button", name="BVH", exact=True).click()
    download.value.save_as(tmp_path / "edited.bvh")
    assert load(tmp_path / "edited.bvh").clip.duration > 0.8


def test_an_upload_that_is_no_motion_is_answered_in_the_page(tab: Any, served: Served) -> None:
    tab.get_by_role("tab", name="Clips").click()
    with tab.expect_file_chooser() as chooser:
        tab.get_by_role("button", name="Upload a motion").click()
    chooser.value.set_files(
        [{"name": "broken.bvh", "mimeType": "text/plain", "buffer": b"HIERARCHY\nROOT x\n{ oh }\n"}]
    )
    tab.get_by_text("broken.bvh", exact=False).last.wait_for()
    served.until(lambda: any("broken.bvh" in line for line in served.page._said), "it is said")


def test_a_tab_that_is_closed_ends_nothing_and_another_one_drives(
    chromium: Any, tab: Any, served: Served, tmp_path: Path
) -> None:
    served.desk.hold(served.desk.now["p"], False)
    tab.close()
    served.until(lambda: served.page.driver.client is None, "the driver has left")
    assert not served.desk.holds
    before = float(served.desk.now["t"][0])
    phone = chromium.new_page(viewport={"width": 390, "height": 780})
    phone.set_default_timeout(1e3 * PATIENCE)
    phone.goto(served.address)
    phone.get_by_role("button", name="Reset").wait_for()
    kept(phone, tmp_path, "phone")
    served.until(lambda: float(served.desk.now["t"][0]) > before, "time went on")
    phone.get_by_role("button", name="Reset").click()
    served.until(lambda: float(served.desk.now["t"][0]) < before, "the other one drives")
    phone.close()


def test_a_wrong_token_is_refused_and_the_right_one_opens_the_page(chromium: Any, served: Served) -> None:
    gate = Gate("127.0.0.1", 0, served.page.port, TOKEN)
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
