"""Does a page that is open, dragged and reloaded cost the servo anything? ``make live-load``: two minutes with it.

Stretches with and without a browser take turns, so that what else goes on on the machine falls on both. Of each the
99th percentile of the processor time of a tick is taken (of blocks of 8), and how much of real time the engine kept;
what is printed is the ratio of the medians over the stretches, of which an argument says how many.
"""

import contextlib
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from experiments.config.options import run_config
from tests.live.browser import ARGUMENTS, CHROMIUM, ServedPage, drag, new_tab, on_screen
from tests.live.watcher import sent_and_drawn

WITH_PAGE, ALONE, STRETCHES = 24.0, 15.0, 5  # [s] of a stretch with the page and without, and how many of either
REMEMBERED = 9.0  # [s] that the engine's percentiles go back: a little more than 1000 blocks of 8 ms
LIMIT = 1.10
LAP = 16.0  # [s]: slow enough for a mouse to catch the stylus a few frames late


class Stretch(NamedTuple):
    """99th percentile and median of the processor time of a tick [s], share of real time, pictures drawn [1/s]."""

    most: float
    middle: float
    pace: float
    pictures: float


def measured(served: ServedPage, seconds: float, doing: Callable[[], None]) -> Stretch:
    """Costs of a stretch of time during which an action is repeated."""
    begin, t, pictures = time.monotonic(), float(served.desk.now["t"][0]), served.page.pictures
    costs: list[np.ndarray] = []
    while time.monotonic() - begin < seconds or not costs:
        doing()
        if time.monotonic() - begin > REMEMBERED:
            costs.append(served.desk.now["cost"].copy())
    middle, most = np.median(costs, axis=0)
    passed = time.monotonic() - begin
    pace = (float(served.desk.now["t"][0]) - t) / passed
    return Stretch(float(most), float(middle), pace, (served.page.pictures - pictures) / passed)


def measured_with_page(served: ServedPage, browser: Any, took_hold: list[bool]) -> Stretch:
    """The same with a page that is dragged and reloaded; `took_hold` records which drags caught the stylus."""
    tab = new_tab(browser, served.address)

    def doing() -> None:
        for way in ((40, -30), (-40, 30)):
            # The ball moves on between the look at it and the press: a drag that misses turns the view.
            with contextlib.suppress(AssertionError), drag(tab, lambda: on_screen(served.desk.now["p"]), way, 3.0):
                took_hold.append(False)
                served.assert_until(lambda: served.desk.holds, "the stylus is held", patience=5.0)
                took_hold[-1] = True
                time.sleep(0.5)
        tab.reload()
        tab.get_by_role("button", name="Pause").wait_for()

    try:
        return measured(served, WITH_PAGE, doing)
    finally:
        tab.close()


def main() -> int:
    """Measure, and tell whether the ratio is within `LIMIT`."""
    from playwright.sync_api import sync_playwright

    served = ServedPage(run_config(mode="follow", lap=LAP, seconds=86400.0), Path(tempfile.mkdtemp()))
    stretches = int(sys.argv[1]) if len(sys.argv) > 1 else STRETCHES
    alone: list[Stretch] = []
    took_hold: list[bool] = []
    with_page: list[Stretch] = []
    try:
        sent, drawn = sent_and_drawn(served.page, ALONE)
        print(f"to a browser that needs no time to draw: {sent:.1f} of {drawn:.1f} pictures a second", flush=True)
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
            for _ in range(stretches):
                alone.append(measured(served, ALONE, lambda: time.sleep(0.25)))
                with_page.append(measured_with_page(served, browser, took_hold))
                for name, (most, middle, pace, pictures) in (("alone", alone[-1]), ("with the page", with_page[-1])):
                    print(
                        f"{name:14s} p99 {1e6 * most:6.0f} µs, median {1e6 * middle:5.0f} µs, pace {pace:.2f}, "
                        f"{pictures:.0f} pictures/s",
                        flush=True,
                    )
            browser.close()
    finally:
        served.close()
    ratio = np.median(with_page, axis=0) / np.median(alone, axis=0)
    print(f"{sum(took_hold)} of {len(took_hold)} drags took hold of the stylus")
    print(
        f"with the page / alone: p99 {ratio[0]:.3f}, median {ratio[1]:.3f}, pace {ratio[2]:.3f}; limit of p99 {LIMIT}"
    )
    return 0 if ratio[0] <= LIMIT and any(took_hold) else 1


if __name__ == "__main__":
    sys.exit(main())
