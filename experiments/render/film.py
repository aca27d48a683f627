"""Renders a film of a run from its recording: the workspace beside the stage, frame by frame."""

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from experiments.files.curve_files import CURVE_FILE, load_curve
from experiments.render.captions import Captions, Entry, halved
from experiments.render.film_file import FilmFile, check_target
from experiments.render.graphics import Canvas, Image, offscreen_backend
from experiments.render.scenes import Camera, Clearance, Stage, Workspace
from experiments.render.shown_world import GHOST, GHOST_WHITE, ShownWorld, mixed_with_white, shown_world
from experiments.render.timeline import Ghost, Timeline, timeline
from experiments.results.folder import RECORDING
from experiments.results.measures.phases import performance_start
from geometry.arrays import Array
from sim.errors import SimError
from sim.recording.recording import Recording
from sim.viewer.palette import FIELD, TUBE, USER

Show = Literal["both", "workspace", "stage"]

WORKSPACE_SHARE = 0.42  # of the width, if both are shown
LEAST_WIDTH, LEAST_HEIGHT = 160, 120  # smallest frame on which text is legible [pixels]
MAX_SIZE = 8192  # of either side [pixels]: the widest frame of H.264's levels
_SHIRT_COLOR = "#3d6ba1"  # colour of the figure's shirt in its model
_FIGURE_LABELS = {"physical": "physical figure", "kinematic": "edited animation h(p)", "robot": "robot arm"}
_GHOST_LABELS = {"default": "default animation h(φ)", "animation": "edited animation h(p)"}


@dataclass(frozen=True)
class Film:
    """Settings of a film.

    Attributes
    ----------
    show : Show
        Workspace, stage, or both side by side.
    camera : Camera
        Direction from which the stage is seen, relative to the figure's heading.
    ghost : Ghost
        Animation that is shown beside the figure.
    start : float
        Start of the filmed part of the run [s].
    seconds : float or None
        Duration of the filmed part [s]; by default up to the end.
    width, height : int
        Size of a frame [pixels], even.
    fps : float
        Frames per second [1/s].
    """

    show: Show = "both"
    camera: Camera = "three-quarter"
    ghost: Ghost = "default"
    start: float = 0.0
    seconds: float | None = None
    width: int = 1280
    height: int = 720
    fps: float = 30.0

    def __post_init__(self) -> None:
        small, large = self.width < LEAST_WIDTH or self.height < LEAST_HEIGHT, max(self.width, self.height) > MAX_SIZE
        if small or large or self.width % 2 or self.height % 2:
            raise SimError(
                f"--width and --height are {self.width} and {self.height}; expected even numbers of pixels, "
                f"{LEAST_WIDTH} x {LEAST_HEIGHT} or more, {MAX_SIZE} at most"
            )
        if not 1.0 <= self.fps <= 240.0:
            raise SimError(f"--fps is {self.fps:g}; expected 1 to 240 frames per second")
        if self.seconds is not None and not self.seconds > 0.0:
            raise SimError(f"--seconds is {self.seconds:g} s; expected a time greater than 0")


class Frames:
    """Frames of a film, drawn on demand.

    Parameters
    ----------
    recording : Recording
    folder : Path
        Folder of the recording.
    film : Film
    backend : str
        Result of `offscreen_backend`.
    """

    def __init__(self, recording: Recording, folder: Path, film: Film, backend: str):
        self._film = film
        self._bent_start_time, bent = _bent_curve(recording, folder)
        self._world = shown_world(recording, film.width, film.height, bent)
        self.moments: Timeline = timeline(
            recording, folder, self._world, film.fps, film.start, film.seconds, film.ghost
        )
        left = round(WORKSPACE_SHARE * film.width / 2) * 2
        # A run without a figure has no stage.
        show = "workspace" if self._world.kind == "none" else film.show
        widths = {"both": (left, film.width - left), "workspace": (film.width, 0), "stage": (0, film.width)}
        self._left, self._right = widths[show]
        self._workspace = Workspace(recording, self._world, self.moments)
        self.stage = Stage(recording, self._world, self.moments, film.camera, max(self._right, 1) / film.height)
        self._captions = Captions(film.height)
        self._canvas = Canvas(self._world.model, backend)

    def __len__(self) -> int:
        return len(self.moments.t)

    def frame(self, row: int) -> Image:
        """The frame of a row, shape (height, width, 3)."""
        self.stage.put(row)
        self._world.show_bent(bool(self.moments.t[row] >= self._bent_start_time))
        height, time = self._film.height, f"{self.moments.t[row]:.1f} s"
        parts: list[Image] = []
        if self._left:
            scene = self._workspace.picture(self._canvas, row, self._left, height)
            field, user = self._workspace.newtons(row)
            legend = (Entry(FIELD, f"field {field:.1f} N"), Entry(USER, f"hand {user:.1f} N"))
            parts.append(self._captions.on(scene, "workspace", "" if self._right else time, legend))
        if self._right:
            scene = self.stage.picture(self._canvas, row, self._right, height)
            parts.append(self._captions.on(scene, "stage", time, _stage_legend(self._world, self.moments.kind), True))
        picture = np.concatenate(parts, axis=1)
        if len(parts) == 2:
            picture[:, self._left - 1 : self._left + 1] = 255
        return picture

    def close(self) -> None:
        """Release the graphics buffers."""
        self._canvas.close()


def _bent_curve(recording: Recording, folder: Path) -> tuple[float, Array | None]:
    """Time from which a bent curve is performed [s], and its points; infinity and None if there is none."""
    start = performance_start(recording)
    if start is None or not (folder / CURVE_FILE).exists():
        return np.inf, None
    curve = load_curve(folder / CURVE_FILE)
    return start, curve.point(np.linspace(curve.start, curve.end, 400))


def _stage_legend(world: ShownWorld, ghost: Ghost) -> tuple[Entry, ...]:
    """Legend of the stage: the figure and its ghost."""
    actors = (Entry(_SHIRT_COLOR, _FIGURE_LABELS[world.kind]),)
    if not world.has_figure or ghost == "none":
        return actors
    red, green, blue, _ = (round(255 * share) for share in mixed_with_white(TUBE, GHOST_WHITE))
    return (*actors, Entry(f"#{red:02x}{green:02x}{blue:02x}", _GHOST_LABELS[ghost]))


@dataclass(frozen=True)
class FilmResult:
    """Result of rendering a film.

    Attributes
    ----------
    files : tuple of str
        Files written.
    frames : int
    clearance : mapping of str to Clearance
        Lowest points of the figure and the ghost, for those that are shown.
    """

    files: tuple[str, ...]
    frames: int
    clearance: Mapping[str, Clearance]

    def lines(self) -> list[str]:
        """Lowest points of the figures, one line each."""
        return [
            f"The lowest point of the {name} was {1e3 * lowest:+.1f} mm from the floor at {at:.1f} s"
            f"{', and was drawn higher by that' if lowest < 0.0 else ''}."
            for name, (lowest, at) in self.clearance.items()
        ]


def render(folder: Path, target: Path, film: Film, gif: bool = False, overwrite: bool = False) -> FilmResult:
    """Write the film of a run.

    Parameters
    ----------
    folder : Path
        Folder of the run.
    target : Path
        ``.mp4`` or ``.gif`` file.
    film : Film
    gif : bool
        Also write a GIF beside it: half as large, every second frame.
    overwrite : bool
        Replace existing files.

    Raises
    ------
    SimError
        If the recording cannot be filmed, the target cannot be written, or this machine cannot draw.
    """
    gif_target = target.with_suffix(".gif") if gif and target.suffix.lower() != ".gif" else None
    targets = (target,) if gif_target is None else (target, gif_target)
    for file in targets:
        check_target(file, overwrite)
    console = Console(stderr=True)
    with Recording(folder / RECORDING) as recording, ExitStack() as files:
        frames = Frames(recording, folder, film, offscreen_backend())
        files.callback(frames.close)
        film_file = files.enter_context(FilmFile(target, film.width, film.height, film.fps))
        gif_file = gif_target and files.enter_context(
            FilmFile(gif_target, film.width // 2, film.height // 2, film.fps / 2.0)
        )
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn("frames"))
        bar = files.enter_context(Progress(*columns, TimeRemainingColumn(), console=console))
        for row in bar.track(range(len(frames)), description="drawing"):
            picture = frames.frame(row)
            film_file.add(picture)
            if gif_file and row % 2 == 0:
                gif_file.add(halved(picture))
        if not recording.complete:
            recorded = float(recording.channel("ticks", "t")[-1])
            console.print(f"The run was cut short after {recorded:.1f} s.")
    console.print(f"Written to {', '.join(str(file) for file in targets)}.", highlight=False, soft_wrap=True)
    clearance = {"ghost" if prefix == GHOST else "figure": low for prefix, low in frames.stage.clearance.items()}
    return FilmResult(tuple(map(str, targets)), len(frames), clearance)
