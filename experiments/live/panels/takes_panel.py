"""Panel of the live page for takes: record, name, compare, mix and download."""

import tempfile
import time
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import viser

from controllers.errors import ParameterError
from experiments.config.part import to_json
from experiments.live.panels import Acts
from experiments.live.session.desk import Desk
from experiments.live.session.take_mix import FPS, Region, TakeData, mixed
from experiments.results.folder import EDITED, RECORDING
from geometry.arrays import Array, rms
from models.mocap.motion.clip import Clip
from models.mocap.readers.own_bvh import write_bvh
from sim.viewer.take_ghosts import COLORS, TakeGhosts

NONE = "none"


class TakesPanel:
    """The list of takes and its actions; other arguments as in `ClockPanel`.

    Parameters
    ----------
    scene : viser.SceneApi
        Scene in which takes are shown.
    """

    def __init__(self, gui: viser.GuiApi, desk: Desk, acts: Acts, scene: viser.SceneApi):
        self._desk, self._scene = desk, scene
        self._model: mujoco.MjModel | None = None
        self._ghosts: TakeGhosts | None = None
        self._poses: tuple[Array, ...] = ()
        self._regions: list[Region] = []
        self._lines: dict[str, str] = {}
        self._name = gui.add_text("Name", "take 1")
        self._record = gui.add_button("Record", icon=viser.Icon.PLAYER_RECORD, color="red")
        self._list: viser.GuiDropdownHandle[Any] = gui.add_dropdown("Take", (NONE,))
        self._download = gui.add_button_group("Download", ("BVH", "Recording", "Configuration"))
        with gui.add_folder("Compare and mix", expand_by_default=False):
            self._other: viser.GuiDropdownHandle[Any] = gui.add_dropdown("With", (NONE,))
            self._compare = gui.add_checkbox(
                "Show both", False, hint="In place of the default animation; the first as mixed."
            )
            self._legend = gui.add_html("")
            self._plot = gui.add_uplot(
                (np.zeros(2), np.zeros(2), np.zeros(2)),
                ({"label": "t [s]"}, *({"label": str(k), "stroke": c, "width": 2} for k, c in enumerate(COLORS[:2]))),
                title="Force [N]", height=140, scales={"x": {"time": False}}, visible=False,
            )  # fmt: skip
            self._region_slider = gui.add_multi_slider(
                "Region [s]", 0.0, 10.0, 0.1, (1.0, 3.0), hint="Part of the take that the other one replaces."
            )
            self._mix = gui.add_button_group("Mix", ("Take over", "Undo"))
            self._export = gui.add_button("Download the mix as BVH", icon=viser.Icon.DOWNLOAD)
            self._regions_line = gui.add_html("")
        self._record.on_click(acts(lambda event: self._on_record()))
        self._download.on_click(acts(self._on_download))
        self._compare.on_update(acts(lambda event: self._on_compare()))
        self._list.on_update(acts(lambda event: self._on_choose()))
        self._other.on_update(acts(lambda event: self._on_compare()))
        self._mix.on_click(acts(lambda event: self._on_mix()))
        self._export.on_click(acts(self._on_export))

    def stage_set(self, model: mujoco.MjModel) -> None:
        """Reset the comparison after the scene was rebuilt."""
        self._model, self._ghosts = model, None
        self._compare.value = False

    @property
    def compares(self) -> bool:
        """Whether takes are shown instead of the default animation."""
        return self._ghosts is not None

    def draw(self) -> None:
        """Draw the current poses of the compared takes, which play in a loop."""
        ghosts = self._ghosts
        if ghosts is None:
            return
        frames = max(len(poses) for poses in self._poses)
        frame = int(time.monotonic() * FPS) % frames
        ghosts.show([poses[min(frame, len(poses) - 1)] for poses in self._poses])

    def write(self) -> None:
        """Update the button and the lists of takes."""
        self._record.label = "Stop" if self._desk.records else "Record"
        names = self._desk.takes() or (NONE,)
        for dropdown in (self._list, self._other):
            if tuple(dropdown.options) != names:
                dropdown.options = names
                dropdown.value = names[-1] if dropdown is self._list else names[0]

    def _on_record(self) -> None:
        if self._desk.records:
            self._desk.stop()
        else:
            self._desk.record(self._name.value)
            self._name.value = next_name(self._name.value)

    def _on_download(self, event: Any) -> None:
        kind = self._download.value
        if kind == "Configuration":
            if self._desk.config is None:
                raise ParameterError("nothing runs yet; expected a run whose configuration can be kept")
            _send(event, "config.json", to_json(self._desk.config).encode())
            return
        file = self._take_folder(self._list) / (EDITED if kind == "BVH" else RECORDING)
        _send(event, f"{self._list.value}{file.suffix}", file.read_bytes())

    def _on_choose(self) -> None:
        self._regions = []
        if self._compare.value:
            self._on_compare()

    def _on_compare(self) -> None:
        ghosts, self._ghosts = self._ghosts, None
        if ghosts is not None:
            ghosts.remove()
        self._plot.visible = False
        self._legend.content = ""
        if not self._compare.value or self._model is None:
            return
        first, second = self._pair()
        self._poses = mixed(first, self._regions), second.poses
        self._ghosts = TakeGhosts(self._scene, self._model, {"0": first.path, "1": second.path})
        self._legend.content = _legend((first, second))
        n = max(len(first.force), len(second.force))
        self._plot.data = (
            np.arange(n) / FPS,
            *(np.pad(take.force, (0, n - len(take.force)), constant_values=np.nan) for take in (first, second)),
        )
        self._plot.visible = True

    def _on_mix(self) -> None:
        if self._mix.value == "Undo":
            if not self._regions:
                raise ParameterError("no region is left to undo")
            self._regions.pop()
        else:
            first, second = self._pair()
            start, end = self._region_slider.value
            regions = [*self._regions, Region(float(start), float(end), second)]
            mixed(first, regions)  # raises if the region is invalid, before it is stored
            self._regions = regions
        self._on_compare()
        parts = [f"{r.start:.1f} to {r.end:.1f} s from {r.take.name}" for r in self._regions]
        self._regions_line.content = (
            f'<p style="margin:.3rem .75rem;font-size:.8rem">{"; ".join(parts) or "no regions"}</p>'
        )

    def _on_export(self, event: Any) -> None:
        clip = Clip(mixed(TakeData.of(self._take_folder(self._list)), self._regions), FPS, "mix")
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "mix.bvh"
            write_bvh(clip, file)
            _send(event, "mix.bvh", file.read_bytes())

    def _pair(self) -> tuple[TakeData, TakeData]:
        first, second = TakeData.of(self._take_folder(self._list)), TakeData.of(self._take_folder(self._other))
        return first, second

    def _take_folder(self, chosen: Any) -> Path:
        if chosen.value == NONE:
            raise ParameterError("there is no take yet; expected one that was recorded")
        return self._desk.take(str(chosen.value))


def _send(event: Any, name: str, content: bytes) -> None:
    event.client.send_file_download(name, content, save_immediately=True)


def _legend(takes: tuple[TakeData, ...]) -> str:
    lines = [
        f'<b style="color:{color}">{take.name}</b>: {take.times[-1]:.1f} s, {np.mean(take.force):.2f} N and '
        f"{1e3 * rms(take.distance):.1f} mm from the curve RMS"
        for take, color in zip(takes, COLORS, strict=False)
    ]
    return "".join(f'<p style="margin:.3rem .75rem;font-size:.8rem">{line}</p>' for line in lines)


def next_name(name: str) -> str:
    """A name with the next number: "take 2" after "take 1"."""
    stem = name.rstrip("0123456789")
    number = name[len(stem) :]
    return f"{stem}{int(number) + 1}" if number else f"{name} 2"
