"""The hand moved by a SpaceMouse: it starts at the stylus, follows the cap, and lets go at rest."""

import numpy as np
import pytest

from experiments.live import cap_hand
from experiments.live.cap_hand import RELEASE_DELAY, CapHand
from sim.devices.spacemouse import MAX_SPEED, SpaceMouse
from tests.devices.hand_made import Cap, Clock

STYLUS = np.array([0.03, -0.01, 0.02])


@pytest.fixture
def hand(monkeypatch: pytest.MonkeyPatch) -> tuple[CapHand, Cap, Clock]:
    cap, clock = Cap(), Clock()
    monkeypatch.setattr(cap_hand.time, "monotonic", lambda: clock.now)
    return CapHand(SpaceMouse(cap, "SpaceNavigator", "test", lambda: clock.now)), cap, clock


def test_cap_at_rest_holds_nothing(hand: tuple[CapHand, Cap, Clock]) -> None:
    on_cap, _, _ = hand
    assert on_cap.wish(STYLUS) is None


def test_pushed_cap_moves_the_hand_and_rest_releases_it(hand: tuple[CapHand, Cap, Clock]) -> None:
    on_cap, cap, clock = hand
    on_cap.wish(STYLUS)
    cap.push(0, 0, -350)  # lifted all the way
    for _ in range(11):
        clock.now += 0.02
        wish = on_cap.wish(STYLUS)
    assert wish is not None
    target, pressed = wish
    np.testing.assert_allclose(target - STYLUS, [0.0, 0.0, 0.2 * MAX_SPEED], atol=0.03 * MAX_SPEED)
    assert not pressed
    cap.push(0, 0, 0)
    on_cap.wish(STYLUS)
    clock.now += 0.5 * RELEASE_DELAY
    assert on_cap.wish(STYLUS) is not None  # a short rest is none
    clock.now += 2.0 * RELEASE_DELAY
    assert on_cap.wish(STYLUS) is None


def test_first_button_is_the_switch(hand: tuple[CapHand, Cap, Clock]) -> None:
    on_cap, cap, clock = hand
    cap.queue.append(b"\x03\x01")
    clock.now += 0.02
    wish = on_cap.wish(STYLUS)
    assert wish is not None
    assert wish[1]


def test_missing_spacemouse_is_not_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cap_hand, "list_devices", lambda: [])
    assert cap_hand.open_cap_hand() == (None, "")
