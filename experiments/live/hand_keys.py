"""Keys that move the hand: a step a press, and the repeats of a key that is held."""

from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from controllers.state import Array
from experiments.live.clock_panel import Acts
from experiments.live.desk import Desk

STEP = 0.003  # [m] of a press; a keyboard repeats some thirty times a second, which makes 0.1 m/s
LETS_GO = "H"
WAYS: dict[str, tuple[str, Array]] = {
    "J": ("Hand to the left", np.array([-1.0, 0.0, 0.0])),
    "L": ("Hand to the right", np.array([1.0, 0.0, 0.0])),
    "I": ("Hand away", np.array([0.0, 1.0, 0.0])),
    "K": ("Hand towards you", np.array([0.0, -1.0, 0.0])),
    "U": ("Hand up", np.array([0.0, 0.0, 1.0])),
    "O": ("Hand down", np.array([0.0, 0.0, -1.0])),
}
"""What a key does, and its direction in H, as the views have it; WASD, Q, E and the arrows move viser's camera."""


def add_hand_keys(gui: viser.GuiApi, desk: Desk, acts: Acts, pressed: Callable[[], bool]) -> None:
    """Let keys move the hand; it keeps the stylus until `LETS_GO`. Arguments as in `ClockPanel`.

    Parameters
    ----------
    pressed : callable
        Whether the switch is pressed.
    """

    def moves(way: Array) -> Callable[[Any], None]:
        return lambda event: desk.hold((desk.target if desk.holds else desk.now["p"]) + STEP * way, pressed())

    for key, (label, way) in WAYS.items():
        gui.add_command(label, hotkey=key).on_trigger(acts(moves(way)))  # pyright: ignore[reportArgumentType]
    gui.add_command("Let go of the stylus", hotkey=LETS_GO).on_trigger(acts(lambda event: desk.let_go()))
