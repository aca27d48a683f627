"""A live page served by this process, and Debian's chromium to use it."""

import contextlib
import math
import os
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from experiments.config.run_config import RunConfig
from experiments.live.page import Page
from sim.viewer.live_stage import drawn_at
from sim.viewer.views import FIELD_OF_VIEW, VIEWS, camera_of, screen_axes

CHROMIUM = shutil.which("chromium")
ARGUMENTS = [
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--no-sandbox",
    "--disable-dev-shm-usage",
]
PATIENCE = 240.0  # [s] for what takes a second on a machine that does nothing else
WIDTH, HEIGHT = 900, 520
SCREENSHOT_FOLDER = os.environ.get("HVF_SCREENSHOTS", "")
"""Folder for screenshots; none are saved if it is empty."""


def new_tab(browser: Any, address: str, width: int = WIDTH, height: int = HEIGHT) -> Any:
    """A tab that shows the page."""
    page = browser.new_page(viewport={"width": width, "height": height})
    page.set_default_timeout(1e3 * PATIENCE)
    page.goto(address)
    page.get_by_role("button", name="Pause").wait_for()
    return page


def save_screenshot(tab: Any, name: str) -> None:
    """Save a screenshot of the page, if the environment names a folder."""
    if SCREENSHOT_FOLDER:
        tab.screenshot(path=Path(SCREENSHOT_FOLDER) / f"{name}.png")


def choose(tab: Any, label: str, option: str) -> None:
    """Choose from a list."""
    tab.get_by_label(label, exact=True).first.click()
    tab.get_by_role("option", name=option, exact=True).click()


def control_beside(tab: Any, label: str) -> Any:
    """The input control beside a label."""
    return tab.get_by_text(label, exact=True).first.locator("xpath=ancestor::*[.//input][1]")


def fill(tab: Any, label: str, value: str) -> None:
    """Type into the field beside a label."""
    typed = control_beside(tab, label).locator("input:visible")
    typed.fill(value)
    typed.press("Enter")


@contextlib.contextmanager
def drag(
    tab: Any, where: Callable[[], tuple[float, float]], by: tuple[float, float], patience: float = PATIENCE
) -> Iterator[None]:
    """Drag the object at a position by so many pixels; the button is released at the end of the context."""
    x, y = _hover_draggable(tab, where, patience)
    tab.mouse.down()
    _wait_for_frame(tab)
    for share in (0.3, 1.0):
        tab.mouse.move(x + share * by[0], y + share * by[1])
        _wait_for_frame(tab)
    try:
        yield
    finally:
        tab.mouse.up()


def _hover_draggable(tab: Any, where: Callable[[], tuple[float, float]], patience: float) -> tuple[float, float]:
    """Move the mouse to a position until the cursor shows a draggable object; that position."""
    end, k = time.monotonic() + patience, 0
    while True:
        x, y = where()
        tab.mouse.move(x + k % 2, y)  # the page looks for objects only when the mouse moves
        _wait_for_frame(tab)
        if tab.evaluate("[...document.querySelectorAll('canvas')].some(one => one.style.cursor === 'pointer')"):
            return x + k % 2, y
        assert time.monotonic() < end, f"nothing to be dragged at {x:.0f}, {y:.0f} after {patience:g} s"
        k += 1


def _wait_for_frame(tab: Any) -> None:
    """Wait until the browser has drawn another frame."""
    tab.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")


class ServedPage:
    """A page that is served in a thread of this process."""

    def __init__(self, config: RunConfig, folder: Path):
        self.page = Page(config, folder, port=0, shadows=False)
        self.thread = threading.Thread(target=self.page.serve, daemon=True)
        self.thread.start()
        self.assert_until(
            lambda: self.page.stage is not None, "the run is compiled and put together", patience=4.0 * PATIENCE
        )

    @property
    def desk(self) -> Any:
        return self.page.desk

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.page.port}"

    def assert_until(
        self, condition: Callable[[], bool], what: str, step: float = 0.05, patience: float = PATIENCE
    ) -> None:
        end = time.monotonic() + patience
        while not condition():
            assert self.thread.is_alive(), f"the page has ended before: {what}"
            assert time.monotonic() < end, f"not so after {patience:g} s: {what}; said: {self.page._messages}"
            time.sleep(step)

    def settled(self) -> dict[str, np.ndarray]:
        """The displayed state once the simulated time has stopped."""
        self.assert_until(lambda: self.desk.paused, "time is stopped")
        seen = [math.nan]

        def still() -> bool:
            seen.append(float(self.desk.now["t"][0]))
            return seen[-1] == seen[-2]

        self.assert_until(still, "time stands still", step=0.3)  # [s], of blocks of 8 ms
        return self.desk.now

    def close(self) -> None:
        self.page._closed.set()
        self.thread.join(10.0)
        self.page.close()


def on_screen(p_H: np.ndarray, height: int = HEIGHT) -> tuple[float, float]:
    """Pixel position of a point of the hand frame in a tab of some height."""
    camera = camera_of(VIEWS["both"], WIDTH, height)
    forward = camera.look_at - camera.position
    forward /= np.linalg.norm(forward)
    right, up = screen_axes(forward)
    offset = drawn_at(p_H) - camera.position
    scale = 0.5 * height / np.tan(0.5 * FIELD_OF_VIEW) / (offset @ forward)
    return 0.5 * WIDTH + scale * (offset @ right), 0.5 * height - scale * (offset @ up)
