"""Takes on the page: recorded, named, downloaded."""

from typing import Any

import mujoco
import viser

from experiments.live.clock_panel import Acts
from experiments.live.desk import Desk
from experiments.live.run_panel import configuration_text
from experiments.results.folder import EDITED, RECORDING


class TakesPanel:
    """The list of takes and what is done with them; further arguments as in `ClockPanel`.

    Parameters
    ----------
    scene : viser.SceneApi
        In which takes are shown.
    """

    def __init__(self, gui: viser.GuiApi, desk: Desk, acts: Acts, scene: viser.SceneApi):
        self._desk, self._scene = desk, scene
        self._name = gui.add_text("Name", "take 1")
        self._record = gui.add_button("Record", icon=viser.Icon.PLAYER_RECORD, color="red")
        self._list = gui.add_dropdown("Take", ("none",))
        self._get = gui.add_button_group("Download", ("BVH", "Recording", "Configuration"))
        self._record.on_click(acts(lambda event: self._on_record()))
        self._get.on_click(acts(self._on_get))

    def stage_set(self, model: mujoco.MjModel) -> None:
        """There is another scene."""

    def draw(self) -> None:
        """Draw what is shown of takes."""

    def write(self) -> None:
        """Show how it is."""
        self._record.label = "Stop" if self._desk.records else "Record"
        names = self._desk.takes() or ("none",)
        if tuple(self._list.options) != names:
            self._list.options = names
            self._list.value = names[-1]

    def _on_record(self) -> None:
        if self._desk.records:
            self._desk.stop()
        else:
            self._desk.record(self._name.value)
            self._name.value = next_name(self._name.value)

    def _on_get(self, event: Any) -> None:
        kind, name = self._get.value, str(self._list.value)
        if kind == "Configuration":
            content, called = configuration_text(self._desk.config).encode(), "config.json"
        else:
            file = self._desk.take(name) / (EDITED if kind == "BVH" else RECORDING)
            content, called = file.read_bytes(), f"{name}.bvh" if kind == "BVH" else f"{name}.h5"
        event.client.send_file_download(called, content, save_immediately=True)


def next_name(name: str) -> str:
    """A name with the next number: "take 2" after "take 1"."""
    stem = name.rstrip("0123456789")
    number = name[len(stem) :]
    return f"{stem}{int(number) + 1}" if number else f"{name} 2"
