"""Panel of the live page for time (pause, step, pace, reset, looking back) and for the stylus switch and grip."""

from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from experiments.config.modes import StretchThenFollow
from experiments.live.panels import Acts
from experiments.live.session.desk import HISTORY_DURATION, Desk
from geometry.arrays import Array

PLAYBACK_RATES = {"real time": 1.0, "1/2": 0.5, "1/4": 0.25, "1/10": 0.1}


class ClockPanel:
    """Buttons of the clock and of the hand.

    Parameters
    ----------
    gui : viser.GuiApi
        GUI to which the buttons are added.
    desk : Desk
        State and actions of the page.
    acts : callable
        Wraps every event handler; see `Page.acts`.
    """

    def __init__(self, gui: viser.GuiApi, desk: Desk, acts: Acts):
        self._desk = desk
        self._grab = gui.add_checkbox(
            "Grab and bend", False, visible=False,
            hint="The stylus's switch: with it, or with shift, dragging grabs the curve and bends it.",
        )  # fmt: skip
        self._hold_on = gui.add_checkbox("Hold on", False, hint="Hold the stylus when the mouse releases the ball.")
        self._perform = gui.add_button("Perform the bent curve", visible=False, icon=viser.Icon.PLAYER_PLAY)
        self._time = gui.add_button_group("Time", ("Pause", "Step", "Reset"))
        self._edit = gui.add_button_group("Edit", ("Undo", "Redo"))
        self._pace = gui.add_dropdown("Pace", tuple(PLAYBACK_RATES))
        self._look_back = gui.add_slider(
            "Look back [s]", -HISTORY_DURATION, 0.0, 0.1, 0.0,
            hint="The present is at the right; time is paused while you look back.",
        )  # fmt: skip
        self._resume = gui.add_button("Resume from there", visible=False)
        self._rearm = gui.add_button("Re-arm", visible=False, color="red", hint="The force ramps up from zero.")
        self._grab.on_update(acts(lambda event: desk.press(self._grab.value)))
        self._hold_on.on_update(acts(lambda event: None if self._hold_on.value else desk.let_go()))
        self._perform.on_click(acts(lambda event: desk.perform(not self._is_performing)))
        self._time.on_click(acts(lambda event: self._on_time()))
        self._edit.on_click(acts(lambda event: desk.undo() if self._edit.value == "Undo" else desk.redo()))
        self._pace.on_update(acts(lambda event: desk.pace(PLAYBACK_RATES[self._pace.value])))
        self._look_back.on_update(acts(lambda event: desk.pause(True)))
        self._resume.on_click(acts(lambda event: self._go_on_from_past()))
        self._rearm.on_click(acts(lambda event: desk.rearm()))
        keys: dict[str, tuple[Any, Callable[[Any], None]]] = {
            "Pause or resume": ("space", lambda event: desk.pause(not desk.paused)),
            "Step": ("N", lambda event: desk.step()),
            "Reset": ("R", lambda event: desk.reset()),
            "Undo": ("Z", lambda event: desk.undo()),
            "Redo": ("Y", lambda event: desk.redo()),
            "Grab or let go": ("G", lambda event: self._toggle_grab()),
        }
        for label, (key, action) in keys.items():
            gui.add_command(label, hotkey=key).on_trigger(acts(action))

    @property
    def pressed(self) -> bool:
        """Whether the switch is pressed while the hand holds the stylus."""
        return self._grab.value

    @property
    def keeps(self) -> bool:
        """Whether the hand keeps holding the stylus when the mouse lets go."""
        return self._hold_on.value

    @property
    def seconds_ago(self) -> float:
        """Time by which the view looks back [s]."""
        return -self._look_back.value

    def write(self) -> None:
        """Update the buttons from the state of the run."""
        desk = self._desk
        self._resume.visible = self.seconds_ago > 0.0
        self._rearm.visible = bool(desk.now["fault"][0] != 0.0)
        built = desk.built
        self._grab.visible = built is not None and built.bends
        self._perform.visible = built is not None and isinstance(built.config.mode, StretchThenFollow)
        self._perform.label = "Bend it again" if self._is_performing else "Perform the bent curve"

    @property
    def _is_performing(self) -> bool:
        return bool(self._desk.now["performs"][0] > 0.0)

    def _toggle_grab(self) -> None:
        self._grab.value = not self._grab.value
        self._desk.press(self._grab.value)

    def _on_time(self) -> None:
        self._look_back.value = 0.0
        if self._time.value == "Pause":
            self._desk.pause(not self._desk.paused)
        elif self._time.value == "Step":
            self._desk.step()
        else:
            self._desk.reset()

    def _go_on_from_past(self) -> None:
        self._desk.go_back(self.seconds_ago)
        self._look_back.value = 0.0
        self._desk.pause(False)


KEY_STEP = 0.003  # [m] per press; at about thirty key repeats per second this is 0.1 m/s
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
        return lambda event: desk.hold((desk.target if desk.holds else desk.now["p"]) + KEY_STEP * direction, pressed())

    for key, (label, direction) in KEY_DIRECTIONS.items():
        gui.add_command(label, hotkey=key).on_trigger(acts(handler(direction)))  # pyright: ignore[reportArgumentType]
    gui.add_command("Let go of the stylus", hotkey=RELEASE_KEY).on_trigger(acts(lambda event: desk.let_go()))
