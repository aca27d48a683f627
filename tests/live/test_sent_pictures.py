"""Pictures that the page sends: each of them arrives, and nobody's slowness keeps them from others."""

from collections.abc import Iterator

import pytest

from experiments.config.words import run_config
from tests.live.browser import Served
from tests.live.watcher import sent_and_drawn, watching

pytestmark = pytest.mark.processes

SECONDS = 4.0  # of watching


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    it = Served(run_config(mode="follow", figure="kinematic", seconds=3600.0), tmp_path_factory.mktemp("live"))
    yield it
    it.close()


def test_every_drawn_picture_is_sent_at_most_60_per_second(served: Served) -> None:
    sent, drawn = sent_and_drawn(served.page, SECONDS)
    print(f"{drawn:.1f} pictures/s drawn, {sent:.1f} sent")
    assert sent > 0.9 * drawn
    assert drawn < 61.0


def test_stalled_browser_does_not_delay_another_one(served: Served) -> None:
    _, before = sent_and_drawn(served.page, SECONDS)
    stalled = watching(served.page.port, 60.0, stalled=True)
    try:
        sent, drawn = sent_and_drawn(served.page, SECONDS)
        assert stalled.poll() is None
    finally:
        stalled.terminate()
        stalled.wait()
    print(f"{before:.1f} pictures/s without, {drawn:.1f} with it, {sent:.1f} sent")
    assert sent > 0.9 * drawn
    assert drawn > 0.5 * before
