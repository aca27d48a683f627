"""A browser page that shows a running simulation: the live stage, a clock, and a choice of views."""

import html
import time
from collections.abc import Sequence

import mujoco
import numpy as np
import viser

from sim.viewer.live_stage import LiveStage, light
from sim.viewer.shown import Course, Moment
from sim.viewer.views import VIEWS, add_view_buttons, open_with

_MAX_FPS = 30.0  # frames sent per second


class LivePage:
    """A page served to browsers on this machine; viser prints its address.

    Parameters
    ----------
    model : mujoco.MjModel
        The world, with the body that follows the hand; not stepped here.
    drawn : sequence of Course
        The curves.
    radius : float
        Radius of the tube around each curve [m], 0 for none.
    body : {"physical", "kinematic", "none", "robot"}
        Kind of figure, or a robot arm; beside a physical figure the animation is shown as a ghost.
    port : int
        Port; if it is in use, the next free one is taken.
    """

    def __init__(
        self, model: mujoco.MjModel, drawn: Sequence[Course], radius: float, body: str = "physical",
        port: int = 8080,
    ):  # fmt: skip
        self._server = viser.ViserServer(host="127.0.0.1", port=port, label="haptic vector fields")
        self._server.gui.configure_theme(show_logo=False, show_share_button=False)
        self._clock = self._server.gui.add_html("")
        add_view_buttons(self._server.gui)
        ghost = "animation h(p)" if body == "physical" else ""
        name = {"physical": "physical figure", "robot": "robot arm"}.get(body, "animation h(p)")
        self._stage = LiveStage(self._server.scene, model, drawn, radius, name, ghost)
        self._stage.draw_slice(np.zeros((0, 3)), np.zeros((0, 3)))
        light(self._server.scene)
        open_with(self._server, lambda client: VIEWS["both"])
        self._last_shown_time = 0.0

    def show(self, shown: Moment, notes: Sequence[str] = ()) -> None:
        """Show a moment with notes below its time, at most 30 times a second; other calls are ignored."""
        now = time.monotonic()
        if now - self._last_shown_time < 1 / _MAX_FPS:
            return
        self._last_shown_time = now
        with self._server.atomic():
            note_lines = "".join(f"<br>{html.escape(note)}" for note in notes)
            self._clock.content = f'<p style="margin:.3rem .75rem"><b>{shown.t:.2f} s</b>{note_lines}</p>'
            self._stage.show(shown)

    def close(self) -> None:
        """Stop serving."""
        self._server.stop()
