"""Keys that move the hand: one step per press or key repeat."""

from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from experiments.live.panels import Acts
from experiments.live.session.desk import Desk
from geometry.arrays import Array

STEP = 0.003  # [m] per press; at about thirty key repeats per second this is 0.1 m/s
RELEASE_KEY = "H"
KEY_DIRECTIONS: dict[str, tuple[str, Array]] = {
    "J": ("Hand to the left", np.array([-1.0, 0.0, 0.0])),
    "L": ("Hand to the right", np.array([1.0, 0.0, 0.0])),
    "I": ("Hand away", np.array([0.0, 1.0, 0.0])),
    "K": ("Hand towards you", np.array([0.0, -1.0, 0.0])),
    "U": ("Hand up", np.array([0.0, 0.0, 1.0])),
    "O": ("Hand down", np.array([0.0, 0.0, -1.0])),
}
"""Label and direction in H of each key, as seen in the views; WASD, Q, E and the arrows move viser's camera."""


def add_hand_keys(gui: viser.GuiApi, desk: Desk, acts: Acts, pressed: Callable[[], bool]) -> None:
    """Let keys move the hand, which holds the stylus until `RELEASE_KEY`; the first arguments are `ClockPanel`'s.

    Parameters
    ----------
    pressed : callable
        Whether the switch is pressed.
    """

    def handler(direction: Array) -> Callable[[Any], None]:
        return lambda event: desk.hold((desk.target if desk.holds else desk.now["p"]) + STEP * direction, pressed())

    for key, (label, direction) in KEY_DIRECTIONS.items():
        gui.add_command(label, hotkey=key).on_trigger(acts(handler(direction)))  # pyright: ignore[reportArgumentType]
    gui.add_command("Let go of the stylus", hotkey=RELEASE_KEY).on_trigger(acts(lambda event: desk.let_go()))
