"""Several browsers watch, one drives."""

import pytest

from experiments.live import driver
from experiments.live.driver import Driver


def test_first_active_client_drives_until_it_leaves():
    who = Driver()
    assert who.client is None
    assert who.may(4)
    assert not who.may(7)
    assert who.may(4)
    assert not who.leave(7)
    assert who.leave(4)
    assert who.may(7)


def test_only_an_idle_driver_is_replaced(monkeypatch: pytest.MonkeyPatch):
    now = [100.0]
    monkeypatch.setattr(driver.time, "monotonic", lambda: now[0])
    who = Driver()
    who.may(1)
    now[0] += 5.0
    assert not who.take_over(2)
    now[0] += driver.IDLE
    assert who.take_over(2)
    assert not who.may(1)
