"""Several browsers watch, one drives."""

import pytest

from experiments.live import driving_browser
from experiments.live.driving_browser import DrivingBrowser


def test_first_active_client_drives_until_it_leaves():
    arbiter = DrivingBrowser()
    assert arbiter.client is None
    assert arbiter.may(4)
    assert not arbiter.may(7)
    assert arbiter.may(4)
    assert not arbiter.leave(7)
    assert arbiter.leave(4)
    assert arbiter.may(7)


def test_only_an_idle_driver_is_replaced(monkeypatch: pytest.MonkeyPatch):
    now = [100.0]
    monkeypatch.setattr(driving_browser.time, "monotonic", lambda: now[0])
    arbiter = DrivingBrowser()
    arbiter.may(1)
    now[0] += 5.0
    assert not arbiter.take_over(2)
    now[0] += driving_browser.MAX_IDLE_TIME
    assert arbiter.take_over(2)
    assert not arbiter.may(1)
