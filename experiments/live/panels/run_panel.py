"""Panels of the live page for the choice of mode, map, figure and clips, and for uploading a motion file."""

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import viser

from experiments.config.maps import MAPS, Led, MapFile, RobotArm
from experiments.config.modes import MODES
from experiments.config.options import run_config
from experiments.config.run_config import RunConfig, meaningless_options
from experiments.live.panels import Acts
from experiments.live.session.desk import MAX_UPLOAD_BYTES, Desk
from experiments.live.session.messages import Built
from models.mocap.library import embedded_names

MAX_SESSION_DURATION = 86400.0  # [s] longest session: a day
SLOTS = {
    "cylindrical": ("inner low", "outer low", "inner high", "outer high"),
    "composite": ("lower body", "upper body inside", "upper body outside"),
    "rivers": ("level river", "wave", "high river"),
    "led": ("walks",),
    "file": (),
}
"""Roles of a map's clips, by kind of map."""
UPLOAD_HINT = (
    "A **BVH**, an **ASF** and then its **AMC**, or a **DeepMimic** motion: calibrated, put on the floor, looped "
    "or at rest, made feasible on contact, as `hvf prepare` does. It is then the first of the clips under *Play*."
)


class RunPanel:
    """Choice of mode, map, figure and clips, and the button that runs them; other arguments as in `ClockPanel`.

    Parameters
    ----------
    config : RunConfig
        The initial choice; its device, rates, seed and size of the figure are those of every run.
    """

    def __init__(self, gui: viser.GuiApi, desk: Desk, acts: Acts, config: RunConfig):
        self._gui, self._desk, self._acts = gui, desk, acts
        self._initial = config
        modes = tuple(mode.__pydantic_fields__["kind"].default for mode in MODES)  # pyright: ignore
        maps = tuple(kind.__pydantic_fields__["kind"].default for kind in MAPS if kind is not RobotArm)  # pyright: ignore
        self._file = config.map.file if isinstance(config.map, MapFile) else ""
        with gui.add_folder("Run"):
            self._mode = gui.add_dropdown("Mode", modes, initial_value=config.mode.kind)
            self._map = gui.add_dropdown(
                "Map", tuple(kind for kind in maps if kind != "file" or self._file), initial_value=_map_kind(config)
            )
            self._figure = gui.add_dropdown("Figure", ("physical", "kinematic"), initial_value=config.figure.kind)
            self._folder = gui.add_folder("Clips")
            self._build = gui.add_button("Run this", icon=viser.Icon.PLAYER_PLAY, color="blue")
        self._slots: list[viser.GuiDropdownHandle[Any]] = []
        for file in map(Path, config.map.clips):
            if file.suffix:  # embedded clips have names without
                desk.offer(file)
        self._pending_names = self._labels(config)
        self._offered_clips = self._clips()
        self._rebuild_slots()
        self._mode.on_update(acts(lambda event: self._rebuild_slots()))
        self._map.on_update(acts(lambda event: self._rebuild_slots()))
        self._build.on_click(acts(lambda event: desk.build(self.config())))

    def config(self) -> RunConfig:
        """The chosen run, with the default gains of its mode.

        Raises
        ------
        ParameterError
            If its parts do not fit.
        """
        mode, map_kind = str(self._mode.value), str(self._map.value)
        options: dict[str, Any] = {"figure": str(self._figure.value), "seconds": MAX_SESSION_DURATION}
        if mode != "lead" and map_kind == "file":
            options["map"] = self._file
        else:
            options |= {"map": "" if mode == "lead" else map_kind, "clips": self._clip_names()}
        chosen, initial = run_config(mode=mode, **options), self._initial
        idle = meaningless_options(chosen.body, chosen.leads)
        sizes = {name: getattr(initial.figure, name) for name in ("stature", "mass") if name not in idle}
        return replace(
            chosen,
            figure=replace(chosen.figure, **sizes),
            device=initial.device,
            clock=initial.clock,
            seed=initial.seed,
        )

    def show(self, built: Built) -> None:
        """Set the choice to the current run."""
        config = built.config
        self._pending_names = self._labels(config)
        self._mode.value, self._figure.value = config.mode.kind, config.figure.kind
        if not config.leads:
            self._map.value = _map_kind(config)
        self._rebuild_slots()

    def write(self) -> None:
        """Offer newly prepared clips."""
        if self._clips() != self._offered_clips:
            new_clips = [name for name in self._clips() if name not in self._offered_clips]
            self._offered_clips = self._clips()
            self._pending_names = (*new_clips, *self._shown_names()[len(new_clips) :])
            self._rebuild_slots()

    def _clips(self) -> tuple[str, ...]:
        return (*self._desk.clips, *embedded_names())

    def _kind(self) -> str:
        return "led" if self._mode.value == "lead" else str(self._map.value)

    def _rebuild_slots(self) -> None:
        labels, known = SLOTS[self._kind()], self._clips()
        if len(self._slots) == len(labels):
            names = self._shown_names() if not self._pending_names else self._pending_names
        else:
            names = self._pending_names
        defaults = _default_clips(self._kind())
        for slot in self._slots:
            slot.remove()
        self._slots = []
        with self._folder:
            for k, label in enumerate(labels):
                name = names[k] if k < len(names) and names[k] in known else defaults[min(k, len(defaults) - 1)]
                self._slots.append(self._gui.add_dropdown(label, known, initial_value=name))
        self._pending_names = ()

    def _shown_names(self) -> tuple[str, ...]:
        return tuple(str(slot.value) for slot in self._slots)

    def _labels(self, config: RunConfig) -> tuple[str, ...]:
        """The clips of a run as the lists name them."""
        labels = {file: name for name, file in self._desk.clips.items()}
        return tuple(labels.get(Path(clip), clip) for clip in config.map.clips)

    def _clip_names(self) -> tuple[str, ...]:
        return tuple(str(self._desk.clips.get(name, name)) for name in self._shown_names())


def _map_kind(config: RunConfig) -> str:
    return "cylindrical" if config.leads else config.map.kind


def _default_clips(kind: str) -> tuple[str, ...]:
    cls = next((part for part in (*MAPS, Led) if part.__pydantic_fields__["kind"].default == kind), None)  # pyright: ignore
    return () if cls is None or kind == "file" else cls().clips  # pyright: ignore


class UploadsPanel:
    """Upload and its progress; the arguments are those of `ClockPanel`."""

    def __init__(self, gui: viser.GuiApi, desk: Desk, acts: Acts):
        self._desk = desk
        gui.add_markdown(UPLOAD_HINT)
        self._upload = gui.add_upload_button(
            f"Upload a motion (up to {MAX_UPLOAD_BYTES // 1_000_000} MB)", icon=viser.Icon.UPLOAD
        )
        self._status = gui.add_markdown("", visible=False)
        self._bar = gui.add_progress_bar(100.0, visible=False, animated=True)
        self._ready_text = gui.add_markdown("")
        self._upload.on_upload(acts(self._on_upload))

    def write(self) -> None:
        """Show the file being prepared and the clips that are ready."""
        preparing = self._desk.preparing
        self._bar.visible = self._status.visible = preparing is not None
        if preparing is not None:
            name, since = preparing
            self._status.content = f"Preparing **{name}**: {time.monotonic() - since:.0f} s so far, of ten to sixty."
        if self._desk.clips:
            self._ready_text.content = "Ready: " + ", ".join(f"**{name}**" for name in self._desk.clips)

    def _on_upload(self, event: Any) -> None:
        file = self._upload.value
        self._desk.upload(file.name, file.content)
