"""A live page in this process, and Debian's chromium that looks at it."""

import shutil
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.config.run_config import RunConfig
from experiments.live.page import Page
from sim.viewer.live_stage import FIELD_OF_VIEW, VIEWS, drawn_at

CHROMIUM = shutil.which("chromium")
ARGUMENTS = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]
PATIENCE = 240.0  # [s] for what takes a second on a machine that does nothing else


def needs_chromium() -> None:
    """Skip where there is no browser."""
    pytest.importorskip("playwright.sync_api", reason="needs Playwright for Python")
    if CHROMIUM is None:
        pytest.skip("needs Debian's chromium")


class Served:
    """A page that is served in a thread of this process."""

    def __init__(self, config: RunConfig, folder: Path):
        self.page = Page(config, folder, port=0, shadows=False)
        self.thread = threading.Thread(target=self.page.serve, daemon=True)
        self.thread.start()
        self.until(lambda: self.page.stage is not None, "the run is put together")

    @property
    def desk(self) -> Any:
        return self.page.desk

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.page.port}"

    def until(self, condition: Callable[[], bool], what: str, step: float = 0.05) -> None:
        end = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < end, f"not so after {PATIENCE:g} s: {what}; said: {self.page._said}"
            time.sleep(step)

    def close(self) -> None:
        self.page._closed.set()
        self.thread.join(10.0)
        self.page.close()


def on_screen(p_H: np.ndarray, width: int, height: int, view: str = "both") -> tuple[float, float]:
    """Where a point of the hand frame is seen, in pixels."""
    camera = VIEWS[view]
    eye, forward = np.array(camera.position), np.array(camera.look_at) - np.array(camera.position)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    up, way = np.cross(right, forward), drawn_at(p_H) - eye
    scale = 0.5 * height / np.tan(0.5 * FIELD_OF_VIEW) / (way @ forward)
    return 0.5 * width + scale * (way @ right), 0.5 * height - scale * (way @ up)
