"""The ball with which a person drags the stylus by mouse, in the plane of the screen."""

from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from geometry.arrays import Array
from sim.viewer.live_stage import drawn_at, workspace_position
from sim.viewer.palette import USER, rgb

Dragged = Callable[[Any, Array, bool], None]
"""Called with viser's event, the hand's position in H [m], shape (3,), and whether shift is pressed."""

RADIUS = 0.12  # [m] in the scene: covers the magnified gimbal, and is large enough for a finger


class HandBall:
    """A ball at the stylus or, while it is dragged, at the hand's intended position.

    Parameters
    ----------
    scene : viser.SceneApi
        Scene in which it is drawn.

    Attributes
    ----------
    dragged : bool
        Whether it is being dragged.
    """

    def __init__(self, scene: viser.SceneApi):
        self._ball = scene.add_icosphere("/hand", RADIUS, color=rgb(USER), cast_shadow=False)
        self._offset = np.zeros(3)
        self.dragged = False

    def on_drag(self, callback: Dragged) -> None:
        """Set the callback of drags with the left button, without and with shift."""
        for modifier in (None, "shift"):
            self._ball.on_drag("left", modifier=modifier)(self._listener(callback, modifier is not None))

    def rest(self, p_H: Array) -> None:
        """Put the ball at a point of the hand frame [m], shape (3,)."""
        self._ball.position = drawn_at(p_H)

    def _listener(self, callback: Dragged, shift: bool) -> Any:
        # Asynchronous, so that the phases of a drag are handled in order.
        async def listen(event: Any) -> None:
            if event.phase == "start":
                self._offset = np.asarray(self._ball.position) - np.asarray(event.start_position)
            position = np.asarray(event.end_position) + self._offset
            self.dragged = event.phase != "end"
            if self.dragged:
                self._ball.position = position
            callback(event, workspace_position(position), shift)

        return listen
