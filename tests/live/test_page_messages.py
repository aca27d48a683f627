"""Messages of the live page: none twice, and none that is out of date."""

import threading
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from experiments.live.driving_browser import DrivingBrowser
from experiments.live.page import Page
from experiments.live.panels.status import status_html
from sim.errors import SimError


def page() -> Any:
    """A page without server and processes."""
    shown: Any = Page.__new__(Page)
    shown.driver, shown._messages, shown._lock, shown._lines = (
        DrivingBrowser(),
        [],
        threading.RLock(),
        SimpleNamespace(content=""),
    )
    return shown


def test_repeated_message_is_shown_once_and_last() -> None:
    shown = page()
    for line in ("Nothing to undo.", "another", "Nothing to undo."):
        shown.say(line)
    assert shown._messages == ["another", "Nothing to undo."]
    assert shown._lines.content.count("Nothing") == 1


def test_message_disappears_once_its_field_is_valid_again() -> None:
    shown, wrong = page(), [True]

    def set_value(event: Any) -> None:
        if wrong[0]:
            raise SimError("stiffness is -5")

    field, event = shown.acts(set_value), SimpleNamespace(client_id=1, client=None)
    shown.say("before")
    field(event)
    shown.say("after")
    assert shown._messages == ["before", "stiffness is -5", "after"]
    wrong[0] = False
    field(event)
    assert shown._messages == ["before", "after"]


@pytest.mark.parametrize(("paused", "holds"), [(True, True), (True, False), (False, True)])
def test_status_tells_who_holds_during_pause_how_to_continue(paused: bool, holds: bool) -> None:
    now = {"cost": np.zeros(2)} | {name: np.zeros(1) for name in ("t", "pace", "fault")}
    desk: Any = SimpleNamespace(paused=paused, holds=holds, records=False)
    assert ("Press space" in status_html(now, 1, "", desk)) == (paused and holds)
