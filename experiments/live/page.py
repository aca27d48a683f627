"""The live page: a 3D scene in which the stylus is dragged, with panels beside it. See docs/how-to/live.md."""

import contextlib
import html
import io
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import viser

from experiments.config.maps import RiverClips
from experiments.config.run_config import RunConfig
from experiments.live.cap_hand import open_cap_hand
from experiments.live.driving_browser import DrivingBrowser
from experiments.live.panels.clock_panel import ClockPanel, add_hand_keys
from experiments.live.panels.gains_panel import GainsPanel
from experiments.live.panels.plots import Plots
from experiments.live.panels.run_panel import RunPanel, UploadsPanel
from experiments.live.panels.status import FIRST_STEPS, status_html
from experiments.live.panels.takes_panel import TakesPanel
from experiments.live.session.desk import Desk
from experiments.live.session.messages import SLICE_SIDE
from geometry.arrays import Array
from geometry.errors import HvfError
from models.world.scene import SceneConfig
from sim.devices.driver import DriverFault
from sim.viewer.hand_ball import HandBall
from sim.viewer.live_stage import LiveStage, light
from sim.viewer.shown import COURSE_POINTS, Moment, courses
from sim.viewer.views import VIEWS, add_view_buttons, is_phone, open_with, window_of
from sim.world.world import World

MIN_FRAME_INTERVAL = 1.0 / 60.0  # [s] shortest time between two frames
MAX_CPU_FRACTION = 0.5  # share of a core that drawing may take; a slower machine draws fewer frames
POLL_INTERVAL = 0.2  # [s] between two updates of texts and plots
N_MESSAGES = 4  # number of most recent messages that are shown


class Page:
    """The page, served to browsers; `serve` draws it until it is closed.

    Parameters
    ----------
    config : RunConfig
        Configuration of the first run.
    folder : Path
        Folder of takes and clips.
    port : int
        Port on 127.0.0.1; if it is in use, the next free one is taken, and for 0 any free one.
    shadows : bool
        Whether shadows are drawn; without a graphics card the page is much faster without them.
    """

    def __init__(self, config: RunConfig, folder: Path, port: int = 8080, shadows: bool = True):
        self.desk, self.driver = Desk(folder, self.say), DrivingBrowser()
        self._messages: list[str] = []
        self._closed, self._lock = threading.Event(), threading.RLock()
        with contextlib.redirect_stdout(io.StringIO()):  # the command prints the address of the gate instead
            self.server = viser.ViserServer(host="127.0.0.1", port=port, label="haptic vector fields", verbose=False)
        self.server.gui.configure_theme(control_width="medium", show_logo=False, show_share_button=False)
        self.stage: LiveStage | None = None
        self._ball: HandBall | None = None
        self._drawn_builds, self._drawn_curve, self._drawn_moment = 0, -1.0, (-1.0, -1.0)
        self.pictures = 0
        self._add_panels(config, shadows)
        # Workspace and stage; on a phone only the workspace, above the panel.
        open_with(self.server, lambda client: VIEWS["workspace" if is_phone(*window_of(client.camera)) else "both"])
        self.server.on_client_disconnect(self._on_disconnect)
        self._cap, message = open_cap_hand()
        if message:
            self.say(message)
        self.desk.build(config)

    @property
    def port(self) -> int:
        """Port on which the page is served."""
        return self.server.get_port()

    def say(self, line: str) -> None:
        """Show a line to all browsers; a line that is already shown moves to the end."""
        self._show_messages([*(one for one in self._messages if one != line), line][-N_MESSAGES:])

    def _show_messages(self, messages: list[str]) -> None:
        self._messages = messages
        if hasattr(self, "_lines"):
            lines = (f'<p style="margin:.15rem .75rem">{html.escape(one)}</p>' for one in self._messages)
            self._lines.content = f'<div style="font-size:.8rem;padding-bottom:.6rem">{"".join(lines)}</div>'

    def acts(self, does: Callable[[Any], None]) -> Callable[[Any], None]:
        """Wrap an event handler: it runs for the driving browser only, between two frames, and shows errors.

        Its messages are removed when it runs again.
        """
        own_messages: list[str] = []

        def handle(event: Any) -> None:
            if event.client_id is None:
                return  # the value was set by the page itself, not by a browser
            if not self.driver.may(event.client_id):
                if event.client is not None:
                    event.client.add_notification(
                        "Somebody else drives", "You watch. Press “Drive” when they have done nothing for ten seconds.",
                        auto_close_seconds=4.0,
                    )  # fmt: skip
                return
            with self._lock:
                before = [one for one in self._messages if one not in own_messages]
                self._show_messages(before)
                try:
                    does(event)
                except (HvfError, OSError) as error:
                    self.say(str(error))
                own_messages[:] = [one for one in self._messages if one not in before]

        return handle

    def _add_panels(self, config: RunConfig, shadows: bool) -> None:
        gui = self.server.gui
        self._status = gui.add_html("")
        self._progress = gui.add_progress_bar(0.0, visible=False)
        self._lines = gui.add_html("")
        tabs = gui.add_tab_group()
        with tabs.add_tab("Play", viser.Icon.HAND_STOP):
            self._clock = ClockPanel(gui, self.desk, self.acts)
            self._run = RunPanel(gui, self.desk, self.acts, config)
            self._add_view_controls(shadows)
        with tabs.add_tab("Gains", viser.Icon.ADJUSTMENTS):
            self._gains = GainsPanel(gui, self.desk, self.acts)
        with tabs.add_tab("Takes", viser.Icon.PLAYER_RECORD):
            self._takes = TakesPanel(gui, self.desk, self.acts, self.server.scene)
        with tabs.add_tab("Clips", viser.Icon.UPLOAD):
            self._uploads = UploadsPanel(gui, self.desk, self.acts)
        with gui.add_folder("Curves", expand_by_default=False):
            self._plots = Plots(gui)
        with gui.add_folder("First steps", expand_by_default=False):
            gui.add_markdown(FIRST_STEPS)
        add_hand_keys(gui, self.desk, self.acts, lambda: self._clock.pressed)

    def _add_view_controls(self, shadows: bool) -> None:
        gui = self.server.gui
        add_view_buttons(gui)
        drive = gui.add_button("Drive", icon=viser.Icon.STEERING_WHEEL, hint="Several may watch, one drives.")
        self._field = gui.add_checkbox("Field arrows", True, hint="On the horizontal plane through the stylus.")
        self._shadows = gui.add_checkbox("Shadows", shadows, hint="Off, the page is faster without a graphics card.")
        self.desk.look(True)

        @drive.on_click
        def _(event: Any) -> None:
            self.say("Another browser drives now." if self.driver.take_over(event.client_id) else "Somebody drives.")

        self._shadows.on_update(self.acts(lambda event: light(self.server.scene, self._shadows.value)))
        self._field.on_update(self.acts(lambda event: self.desk.look(self._field.value)))

    def _on_disconnect(self, client: viser.ClientHandle) -> None:
        if self.driver.leave(client.client_id):
            self.desk.let_go()

    def serve(self) -> None:
        """Draw until `close` is called, or the servo's process ends."""
        last_update, due = 0.0, 0.0
        while not self._closed.is_set():
            begin = time.perf_counter()
            with self._lock:  # viser calls event handlers in other threads
                self.desk.poll()
                if self.desk.builds != self._drawn_builds:
                    self._set_stage()
                self._move_by_cap()
                self._draw()
                if begin - last_update > POLL_INTERVAL:
                    last_update = begin
                    self._update_panels()
            now = time.perf_counter()
            due = max(due + MIN_FRAME_INTERVAL, begin + (now - begin) / MAX_CPU_FRACTION)
            self._closed.wait(max(due - now, 1e-3))

    def close(self) -> None:
        """Stop serving and end all processes."""
        self._closed.set()
        if self._cap is not None:
            self._cap.close()
        self.desk.close()
        with contextlib.redirect_stdout(io.StringIO()):
            self.server.stop()

    def _set_stage(self) -> None:
        built, self._drawn_builds = self.desk.built, self.desk.builds
        assert built is not None
        stature, mass, servo_period, physics_step = (float(n) for n in np.asarray(built.drawn["scene"]))
        world = World(SceneConfig(stature, mass, servo_period, physics_step), built.config.figure.kind)
        self.server.scene.reset()
        light(self.server.scene, self._shadows.value)
        kinematic = built.config.figure.kind == "kinematic"
        self.stage = LiveStage(
            self.server.scene, world.full_model(), courses(built.drawn), float(np.asarray(built.drawn["tube_radius"])),
            "animation h(p)" if kinematic else "physical figure",
            "animation h(p)" if isinstance(built.config.map, RiverClips) else "default animation",
        )  # fmt: skip
        self._ball = HandBall(self.server.scene)
        self._ball.on_drag(self._on_drag)
        self._takes.stage_set(world.full_model())
        self._drawn_curve, self._drawn_moment = -1.0, (-1.0, -1.0)
        self._run.show(built)
        self._gains.rebuild()

    def _on_drag(self, event: Any, target: Array, shift: bool) -> None:
        if not self.driver.may(event.client_id):
            return
        if event.phase == "end" and not self._clock.keeps:
            self.desk.let_go()
        else:
            self.desk.hold(target, shift or self._clock.pressed)

    def _move_by_cap(self) -> None:
        """Let a connected SpaceMouse move the hand while no mouse drags it."""
        if self._cap is None or self._ball is None or self._ball.dragged:
            return
        was_holding = self._cap.holds
        try:
            wish = self._cap.wish(self.desk.now["p"])
        except DriverFault:
            self._cap, wish = None, None
            self.say("The SpaceMouse was disconnected.")
        if wish is not None:
            self.desk.hold(wish[0], wish[1] or self._clock.pressed)
        elif was_holding and not self._clock.keeps:
            self.desk.let_go()

    def _draw(self) -> None:
        stage, ball, desk = self.stage, self._ball, self.desk
        now = desk.at(self._clock.seconds_ago)
        moment = float(now["t"][0]), float(now["curve"][0])
        if stage is None or ball is None or (moment == self._drawn_moment and not self._takes.compares):
            return
        self._drawn_moment = moment
        self.pictures += 1
        nq = stage.configuration_size
        with self.server.atomic():
            shown = (now[name] for name in ("ghost", "p", "force", "user", "target"))
            stage.show(Moment(float(now["t"][0]), now["qpos"][:nq], *shown))
            if now["curve"][0] != self._drawn_curve and desk.built is not None and desk.built.bends:
                self._drawn_curve = now["curve"][0]
                stage.draw_course(0, now["course"].reshape(COURSE_POINTS, 3))
            arrows = now["slice"].reshape(SLICE_SIDE**2, 6)
            stage.draw_slice(arrows[:, :3] if self._field.value else arrows[:0, :3], arrows[:, 3:])
            if not ball.dragged:
                ball.rest(desk.target if desk.holds else now["p"])
            stage.shows_ghost(not self._takes.compares)
            self._takes.draw()
        self.server.flush()  # otherwise viser waits 1/60 s after its last transmission and drops frames

    def _update_panels(self) -> None:
        desk = self.desk
        now, progress = desk.now, desk.progress
        desk.watched(len(self.server.get_clients()))
        self._progress.visible = progress is not None
        if progress is not None:
            self._progress.value = 100.0 * progress.share
        self._status.content = status_html(now, self.driver.client, "" if progress is None else progress.text, desk)
        self._clock.write()
        self._gains.write()
        self._takes.write()
        self._uploads.write()
        self._run.write()
        self._plots.write(desk.history)
