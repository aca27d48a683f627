"""The page of a run in a browser: plot cursor and replay, zoom, and the width of a phone."""

import time
from pathlib import Path
from typing import Any

import pytest

from experiments.cli import main
from tests.live.browser import PATIENCE, save_screenshot

pytestmark = pytest.mark.processes


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run") / "follow"
    assert main(["run", "--figure", "kinematic", "--seconds", "4", "--out", str(folder)]) == 0
    return folder / "report.html"


def opened(browser: Any, report: Path, width: int, height: int) -> tuple[Any, Any]:
    """The page in a tab, and its replay, once it is there."""
    page = browser.new_page(viewport={"width": width, "height": height})
    page.set_default_timeout(1e3 * PATIENCE)
    page.goto(report.as_uri())
    replay = page.frame_locator("iframe[title='Replay in 3D']")
    replay.locator("[role=slider]").first.wait_for(state="attached")
    return page, replay


def seconds_shown(page: Any) -> float:
    """Time of the values shown by the first plot [s]; -1 before there are any."""
    text = page.locator(".over-time output").first.text_content()
    return float(text.split(" s:")[0]) if text else -1.0


def until_beyond(page: Any, seconds: float) -> None:
    end = time.monotonic() + PATIENCE
    while seconds_shown(page) <= seconds:
        assert time.monotonic() < end, f"the line stands at {seconds_shown(page)} s"
        page.wait_for_timeout(100.0)


def test_plot_cursor_follows_the_replay_and_plots_zoom(chromium: Any, report: Path) -> None:
    page, replay = opened(chromium, report, 700, 800)
    until_beyond(page, 0.2)  # it plays by itself
    until_beyond(page, seconds_shown(page))
    replay.locator("button").first.dispatch_event("click")  # paused, for drawing it takes a processor
    save_screenshot(page, "report")
    plot = page.locator("canvas.plot").first
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    right, middle, y = box["x"] + box["width"] - 12, box["x"] + 0.5 * box["width"], box["y"] + 40
    page.mouse.move(right, y)
    whole = seconds_shown(page)
    assert whole == pytest.approx(4.0, abs=0.1)
    page.mouse.move(middle, y)
    page.mouse.wheel(0, -1000)
    page.mouse.move(right, y)
    assert 2.0 < seconds_shown(page) < 3.2  # the window is 0.22 as wide, about the middle
    save_screenshot(page, "report-zoomed")
    page.get_by_role("button", name="all", exact=True).click()
    page.mouse.move(right, y)
    assert seconds_shown(page) == pytest.approx(whole, abs=0.02)
    page.close()


def test_run_page_fits_a_phone(chromium: Any, report: Path) -> None:
    phone, replay = opened(chromium, report, 390, 780)
    replay.locator("button").first.dispatch_event("click")
    assert phone.evaluate("document.documentElement.scrollWidth") <= 390
    save_screenshot(phone, "report-phone")
    phone.close()
