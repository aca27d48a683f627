"""Pictures sent to browsers: all of them arrive, and a slow browser does not delay another one."""

from collections.abc import Iterator

import pytest

from experiments.config.options import run_config
from tests.live.browser import ServedPage
from tests.live.watcher import sent_and_drawn, start_watcher

pytestmark = pytest.mark.processes

SECONDS = 4.0  # of watching


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServedPage]:
    page = ServedPage(run_config(mode="follow", figure="kinematic", seconds=3600.0), tmp_path_factory.mktemp("live"))
    yield page
    page.close()


def test_every_drawn_picture_is_sent_at_most_60_per_second(served: ServedPage) -> None:
    sent, drawn = sent_and_drawn(served.page, SECONDS)
    print(f"{drawn:.1f} pictures/s drawn, {sent:.1f} sent")
    assert sent > 0.9 * drawn
    assert drawn < 61.0


def test_stalled_browser_does_not_delay_another_one(served: ServedPage) -> None:
    _, before = sent_and_drawn(served.page, SECONDS)
    stalled = start_watcher(served.page.port, 60.0, stalled=True)
    try:
        sent, drawn = sent_and_drawn(served.page, SECONDS)
        assert stalled.poll() is None
    finally:
        stalled.terminate()
        stalled.wait()
    print(f"{before:.1f} pictures/s without, {drawn:.1f} with it, {sent:.1f} sent")
    assert sent > 0.9 * drawn
    assert drawn > 0.5 * before
