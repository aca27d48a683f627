"""A take that no browser watches any more ends by itself."""

from typing import Any

import numpy as np
import pytest

from experiments.live.session import desk
from experiments.live.session.desk import UNATTENDED_TIMEOUT, Desk


def test_unwatched_take_is_ended_once(monkeypatch: pytest.MonkeyPatch) -> None:
    bare_desk: Any = Desk.__new__(Desk)
    messages, stops, now = list[str](), list[float](), [100.0]
    bare_desk._say, bare_desk.stop, bare_desk._watch_time, bare_desk.now = (
        messages.append,
        lambda: stops.append(now[0]),
        0.0,
        {"recording": np.ones(1)},
    )
    monkeypatch.setattr(desk.time, "monotonic", lambda: now[0])
    for browsers, seconds in ((1, 1.0), (0, UNATTENDED_TIMEOUT - 1.0), (1, 1.0), (0, UNATTENDED_TIMEOUT - 1.0)):
        now[0] += seconds
        bare_desk.watched(browsers)
    assert not stops
    now[0] += 2.0
    bare_desk.watched(0)
    bare_desk.watched(0)
    assert len(stops) == len(messages) == 1
    bare_desk.now["recording"][:] = 0.0
    now[0] += 2.0 * UNATTENDED_TIMEOUT
    bare_desk.watched(0)
    assert len(stops) == 1
