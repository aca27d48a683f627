"""The ball by which the stylus is taken: it is dragged with the mouse, in the plane of the screen."""

from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from controllers.state import Array
from sim.viewer.live_stage import drawn_at, taken_at
from sim.viewer.palette import USER, rgb

Dragged = Callable[[Any, Array, bool], None]
"""Called with viser's event, the place of the hand in H [m], shape (3,), and whether shift is held."""

RADIUS = 0.12  # drawn [m]: it covers the magnified gimbal, and is large enough for a finger


class HandBall:
    """A ball at the stylus, or where a hand means to have it.

    Parameters
    ----------
    scene : viser.SceneApi
        In which it is drawn.

    Attributes
    ----------
    dragged : bool
        Whether a mouse has it.
    """

    def __init__(self, scene: viser.SceneApi):
        self._ball = scene.add_icosphere("/hand", RADIUS, color=rgb(USER), cast_shadow=False)
        self._offset = np.zeros(3)
        self.dragged = False

    def on_drag(self, told: Dragged) -> None:
        """Tell of every drag; with the left button, and with shift besides."""
        for modifier in (None, "shift"):
            self._ball.on_drag("left", modifier=modifier)(self._listener(told, modifier is not None))

    def rest(self, p_H: Array) -> None:
        """Lie at a point of the hand frame [m], shape (3,)."""
        self._ball.position = drawn_at(p_H)

    def _listener(self, told: Dragged, shift: bool) -> Any:
        # Asynchronous, so that the phases of a drag come in their order.
        async def listen(event: Any) -> None:
            if event.phase == "start":
                self._offset = np.asarray(self._ball.position) - np.asarray(event.start_position)
            place = np.asarray(event.end_position) + self._offset
            self.dragged = event.phase != "end"
            if self.dragged:
                self._ball.position = place
            told(event, taken_at(place), shift)

        return listen
