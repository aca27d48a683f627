"""A run from a configuration to a folder: recording, summary, animations, figures, page."""

import shutil
import time
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import cast

import numpy as np
import numpy.typing as npt
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from controllers.fields.instructions import TRACE_PHASE, TRACE_RIVER, TRACE_SIZE
from controllers.fields.leading import Leading
from controllers.fields.stretchy_tubes import StretchyTubes
from experiments.compiling import compile_once
from experiments.config.run_config import STRETCHING, RunConfig
from experiments.files.json_text import json_text
from experiments.results.lead_measures import lead_summary
from experiments.results.measures import BLOCK_FRAMES, summarise, trace_summary
from experiments.results.stretch_measures import editing_summary, performance_summary
from experiments.results.summary import RunSummary
from experiments.results.summary_parts import SpeedSummary
from experiments.setups.clips import load_clips
from experiments.setups.figure_maps import packed_legs
from experiments.setups.hands import handled, stylus_path
from experiments.setups.lead import walker_argument
from experiments.setups.session import Session
from experiments.setups.stretch import CURVE_FILE, save_curve, stretch_summary
from experiments.setups.wiring import wire
from models.mocap.clip import Clip
from models.mocap.readers.own_bvh import write_bvh_blocks
from models.scene import P_WH, SceneConfig, world_model
from sim.errors import SimError
from sim.loop.clock import RealTime
from sim.loop.loop import BLOCK_SECONDS, Loop, groups, record_into
from sim.loop.memory import peak_memory_mb
from sim.loop.servo import FrameLog, TickLog
from sim.recording.recorder import Recorder
from sim.recording.recording import Recording
from sim.reference.reference import make_reference, poses_along, reference_along
from sim.users.intent import Grab, Push, Turn
from sim.viewer.courses import courses
from sim.viewer.page import NullPage, Page

Array = npt.NDArray[np.float64]

RECORDING, SUMMARY, REPORT, EDITED, DEFAULT, FIGURES = (
    "run.h5",
    "summary.json",
    "report.html",
    "edited.bvh",
    "default.bvh",
    "figures",
)
BVH_FPS = 50.0
VIEW_BLOCK_SECONDS = 0.032  # a new picture for every block


def run(config: RunConfig, out: Path, overwrite: bool, started: float, view: bool = False) -> RunSummary:
    """Run and write everything into a folder.

    Parameters
    ----------
    config : RunConfig
        What to run.
    out : Path
        Folder; made when it is missing.
    overwrite : bool
        Whether a run that it holds may be replaced.
    started : float
        `time.perf_counter` when the program began.
    view : bool
        Show the run in a browser while it goes on, at the pace of the wall clock.

    Raises
    ------
    ModelError, ControllerError, SimError
        If something about the configuration or a file is wrong; the folder is then as it was.
    """
    console = Console(stderr=True)
    check_folder(out, overwrite)
    clips, remarks = load_clips(config.clips)
    session = wire(config, clips, remarks, lambda units: compile_once(console, units))
    for remark in session.remarks:
        console.print(remark, highlight=False)
    clear_folder(out)
    with Recorder(
        out / RECORDING, config_dict(config), config.seed, groups(session.servo), session.static()
    ) as recorder:
        speed = _simulate(session, recorder, console, started, view)
        recorder.flush()
        summary = _measure(out, session, speed)
        told = asdict(summary) | {"lines": summary.lines()}
        recorder.close(told)
    _write_animations(out, session)
    (out / SUMMARY).write_text(json_text(told) + "\n", encoding="utf-8")
    write_report_of(out)
    for line in summary.lines():
        print(line)
    console.print(f"Written to {out}: {REPORT} (open it in a browser), {EDITED}, {DEFAULT}, {SUMMARY}, {RECORDING}.")
    return summary


def check_folder(out: Path, overwrite: bool) -> None:
    """Refuse a folder that cannot be written, or whose run may not be replaced."""
    if out.exists() and not out.is_dir():
        raise SimError(f"{out}: is a file; expected a folder to write the run into")
    if (out / RECORDING).exists() and not overwrite:
        raise SimError(f"{out}: holds a run; choose another --out, or --overwrite it")


def clear_folder(out: Path) -> None:
    """Make the folder, and remove what an earlier run left in it; other files stay."""
    out.mkdir(parents=True, exist_ok=True)
    for name in (RECORDING, SUMMARY, REPORT, EDITED, DEFAULT, CURVE_FILE):
        (out / name).unlink(missing_ok=True)
    shutil.rmtree(out / FIGURES, ignore_errors=True)


def config_dict(config: RunConfig) -> dict[str, object]:
    """The configuration as JSON takes it."""
    return asdict(config)


def config_of(recording: Recording) -> RunConfig:
    """The configuration of a recording.

    Raises
    ------
    SimError
        If it is of another version of the program.
    """
    values = dict(recording.config)
    try:
        values["scene"] = SceneConfig(**values["scene"])  # pyright: ignore[reportCallIssue]
        values["pushes"] = tuple(Push(**push) for push in values["pushes"])  # pyright: ignore
        values["turns"] = tuple(Turn(**turn) for turn in values["turns"])  # pyright: ignore
        values["grabs"] = tuple(Grab(**grab) for grab in values["grabs"])  # pyright: ignore
        values["clips"] = tuple(values["clips"])  # pyright: ignore[reportArgumentType]
        return RunConfig(**values)  # pyright: ignore[reportArgumentType]
    except (TypeError, KeyError) as error:
        raise SimError(f"the recording's configuration is of another version of the program ({error})") from None


def clips_of(recording: Recording) -> tuple[Clip, ...]:
    """The clips of a recording, as they were on the figure."""
    names = recording.texts["clip_names"].split("\n")
    rates = recording.array("clip_fps")
    return tuple(Clip(recording.array(f"clip_{i}"), float(rates[i]), name) for i, name in enumerate(names))


def _simulate(session: Session, recorder: Recorder, console: Console, started: float, view: bool) -> SpeedSummary:
    servo, seconds = session.servo, session.config.seconds
    record = record_into(recorder, servo, session.world)
    page = _live_page(session) if view else NullPage()
    clock = RealTime()

    def observe(ticks: TickLog, frames: FrameLog, n: int) -> None:
        record(ticks, frames, n)
        page.show(servo.plant.qpos, ticks.hand[n - 1, 1:4], ticks.force[n - 1])

    loop = Loop(servo, session.world, observe, block_seconds=VIEW_BLOCK_SECONDS if view else BLOCK_SECONDS)
    first = servo.plant.period * servo.figure_ticks
    loop.run(first)
    first_tick = time.perf_counter() - started
    with Progress(
        TextColumn("{task.description}"), BarColumn(), TextColumn("{task.completed:.1f} of {task.total:.1f} s"),
        TimeRemainingColumn(), console=console,
    ) as bar:  # fmt: skip
        task = bar.add_task("simulating", total=seconds)

        def progress(t: float) -> None:
            bar.update(task, completed=t)
            if view:
                clock.wait_until(t)

        times = loop.run(seconds - first, progress)
    page.close()
    return SpeedSummary(times.real_time_factor, first_tick, peak_memory_mb())


def _live_page(session: Session) -> Page:
    from sim.viewer.live_page import LivePage  # viser takes a third of a second, and is rarely watched

    static = session.static()
    return LivePage(session.world.model, courses(static), float(np.asarray(static["tube_radius"])), P_WH)


def _measure(out: Path, session: Session, speed: SpeedSummary) -> RunSummary:
    with Recording(out / RECORDING) as recording:
        busy, memory, field = handled(session.config), session.servo.field.memory, session.field
        summary = summarise(recording, default_poses(session), speed, session.world.warnings(), busy)
        if isinstance(field, Leading):
            scene, fell_at = session.config.scene, summary.figure.fell_at
            return replace(summary, lead=lead_summary(recording, field, memory, scene, fell_at))
        if session.config.user == "trace":
            summary = replace(summary, trace=trace_summary(recording))
        if isinstance(field, StretchyTubes):
            save_curve(field.edited(memory), out / CURVE_FILE)
            return replace(
                summary,
                stretch=stretch_summary(field, memory),
                editing=editing_summary(recording, field, default_poses(session), busy),
                performance=performance_summary(recording, field, default_poses(session), busy),
            )
    return summary


def default_poses(session: Session, stride: int = 1) -> Callable[[Array, Array, Array], Array]:
    """The animation of the curve as it was given: the map at nearest points (k, 3) of phases (k,) on rivers (k,).

    Called with rows in the order of time, `stride` figure updates apart.
    """
    if session.config.map == "rivers":
        return _clips_of_rivers(session, stride)
    kind, params, memory = session.haptic_map.compiled()
    led = isinstance(session.field, Leading)
    if led:
        memory = session.servo.field.memory.copy()

    def poses_at(nearest: Array, phases: Array, rivers: Array) -> Array:
        # A bent curve keeps its phases: the same phase of the curve that was given is what it was before.
        points = session.curve.point(phases) if session.config.mode in STRETCHING else nearest
        poses = np.empty((len(points), session.haptic_map.nq))
        poses_along(kind, params, memory, walker_argument(phases) if led else stylus_path(points), poses)
        return poses

    return poses_at


def _clips_of_rivers(session: Session, stride: int) -> Callable[[Array, Array, Array], Array]:
    """Likewise where rivers play clips, which go over into each other as they did for the figure."""
    period = stride * session.servo.figure_ticks * session.servo.plant.period
    compiled, config = session.haptic_map.compiled(), session.config
    figure = session.world.figure
    reference = make_reference(figure, compiled, period, config.smoothing, config.blend, packed_legs(figure))

    def poses_at(nearest: Array, phases: Array, rivers: Array) -> Array:
        traces = np.zeros((len(nearest), TRACE_SIZE))
        traces[:, TRACE_PHASE], traces[:, TRACE_RIVER] = phases, rivers
        poses = np.empty((len(nearest), session.haptic_map.nq))
        reference_along(reference, stylus_path(nearest), traces, poses)
        return poses

    return poses_at


def _write_animations(out: Path, session: Session) -> None:
    """The animation as the hand made it, and as the curve's nearest points have it, frame by frame in step."""
    with Recording(out / RECORDING) as recording:
        reference = recording.channel("frames", "reference")
        on_curve = [recording.channel("ticks", name) for name in ("nearest", "phase", "river")]
        stride = max(1, round(recording.rates["frames"] / BVH_FPS))
        fps = recording.rates["frames"] / stride
        n = -(-len(reference) // stride)
        per_frame = stride * session.servo.figure_ticks
        poses_at = default_poses(session, stride)
        starts = range(0, n, BLOCK_FRAMES)
        blocks = [slice(k * per_frame, (k + BLOCK_FRAMES) * per_frame, per_frame) for k in starts]
        write_bvh_blocks(
            out / EDITED, n, fps, (reference[k * stride : (k + BLOCK_FRAMES) * stride : stride] for k in starts)
        )
        write_bvh_blocks(out / DEFAULT, n, fps, (poses_at(*(c[rows] for c in on_curve)) for rows in blocks))


def write_report_of(folder: Path) -> None:
    """Draw the figures and the page of a run from its recording, also of a run that was cut short."""
    from experiments.results.figures import draw_figures
    from experiments.results.lead_figure import draw_lead
    from experiments.results.report import write_report
    from experiments.results.stretch_figure import draw_stretch

    with Recording(folder / RECORDING) as recording:
        config = config_of(recording)
        figures = draw_figures(recording, folder / FIGURES)
        if (folder / CURVE_FILE).exists():
            figures.insert(0, folder / FIGURES / "stretch.png")
            draw_stretch(recording, folder, figures[0])
        if config.mode == "lead":
            figures.insert(0, folder / FIGURES / "lead.png")
            draw_lead(recording, figures[0])
        # A map from a file has clips of its own.
        title = f"{config.mode.upper()} over {', '.join(clip.name for clip in clips_of(recording))}"
        write_report(folder / REPORT, recording, world_model(config.scene), title, _lines(recording), figures)


def _lines(recording: Recording) -> list[str]:
    if recording.summary is None:
        t = recording.channel("ticks", "t")
        return [f"The run was cut short: {t[-1]:.1f} s of it are recorded, and there is no summary."]
    return [str(line) for line in cast(list[object], recording.summary["lines"])]
