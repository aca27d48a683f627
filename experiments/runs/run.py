"""Runs a configuration and writes its folder: recording, summary, animations, figures, page."""

import time
from collections.abc import Mapping
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np
from rich.console import Console

from controllers.state import HAND_TIME, POSITION
from experiments.config.part import to_dict, to_json
from experiments.config.run_config import RunConfig
from experiments.console.compiling import compiler
from experiments.console.estimates import SIMULATING, check_length, cost_estimate
from experiments.console.progress import simulating, store_duration
from experiments.files.curve_files import CURVE_FILE, save_curve
from experiments.files.json_text import json_text
from experiments.results import folder as results
from experiments.results.measures.blocks import BLOCK_FRAMES
from experiments.results.measures.run_measures import summarise
from experiments.results.measures.summary import RunSummary
from experiments.results.measures.summary_parts import SpeedSummary
from experiments.setups.parts.part_types import Measuring
from experiments.setups.session import Session, default_poses
from experiments.setups.wiring import wire
from geometry.whole_files import write_text
from models.mocap.readers.own_bvh import write_bvh_blocks
from sim.loop.channels import groups, record_into, shown_configuration
from sim.loop.loop import BLOCK_SECONDS, peak_memory_mb
from sim.loop.servo import FrameLog, TickLog
from sim.recording.recorder import Recorder
from sim.recording.recording import Recording
from sim.viewer.shown import Moment, RealTime, courses

if TYPE_CHECKING:
    from sim.viewer.live_page import LivePage

BVH_FPS = 50.0  # [1/s]
VIEW_BLOCK_SECONDS = 0.032  # simulated time between two updates of the live view


def run(config: RunConfig, out: Path, overwrite: bool, started: float, view: bool = False) -> RunSummary:
    """Run and write everything into a folder.

    Parameters
    ----------
    config : RunConfig
        What to run.
    out : Path
        Folder; created if it is missing.
    overwrite : bool
        Whether a run that the folder holds may be replaced.
    started : float
        `time.perf_counter` when the program began.
    view : bool
        Show the run in a browser while it is simulated, in real time.

    Raises
    ------
    HvfError
        If something about the configuration or a file is wrong; the folder is then left unchanged.
    """
    console = Console(stderr=True)
    results.check_folder(out, overwrite)
    check_length(out, config.seconds, config.clock.servo_period)
    session = wire(config, ready=compiler(console))
    for remark in session.remarks:
        console.print(remark, highlight=False)
    full_config = cast(RunConfig, session.config)
    cost_message = cost_estimate(out, full_config.seconds, groups(session.servo, session.world))
    if cost_message is not None:
        console.print(cost_message, highlight=False)
    with results.claimed_and_cleared(out, overwrite, config.device):
        write_text(out / results.CONFIG, to_json(full_config))
        summary = record(session, out, to_dict(full_config), full_config.seconds, started, console, view)
        write_animations(out, session)
        write_summary(out, summary)
        from experiments.results.pages.report import write_report_of  # matplotlib and viser: after the first tick

        write_report_of(out)
    others = ", ".join(
        name for name in (results.EDITED, results.DEFAULT, results.SUMMARY, results.RECORDING) if (out / name).exists()
    )
    console.print(f"Written to {out}: {results.REPORT} (open it in a browser), {others}.")
    return summary


def write_summary(out: Path, summary: RunSummary) -> None:
    """Write the summary of a run beside its recording."""
    write_text(out / results.SUMMARY, json_text(summary) + "\n")


def record(
    session: Session, out: Path, config: Mapping[str, object], seconds: float, started: float, console: Console,
    view: bool = False,
) -> RunSummary:  # fmt: skip
    """Run a session, record it into an existing folder and return its summary.

    Parameters
    ----------
    session : Session
        Session that has not been run yet.
    out : Path
        Existing folder.
    config : Mapping
        Configuration of the session, as the recording stores it.
    seconds : float
        Simulated time [s].
    started : float
        `time.perf_counter` when the program began.
    console : Console
        Where progress is shown.
    view : bool
        As in `run`.
    """
    servo = session.servo
    kept = groups(servo, session.world)
    with Recorder(out / results.RECORDING, config, session.config.seed, kept, session.static()) as recorder:
        speed = _simulate(session, recorder, seconds, console, started, view)
        recorder.flush()
        session.haptic_map.check()  # before the measures evaluate it again, outside a tick
        summary = session_summary(out, session, speed)
        recorder.close(asdict(summary) | {"lines": summary.lines()})
    return summary


def _simulate(
    session: Session, recorder: Recorder, seconds: float, console: Console, started: float, view: bool
) -> SpeedSummary:
    servo = session.servo
    record = record_into(recorder, servo, session.world)
    page = _live_page(session) if view else None
    clock, simulated = RealTime(), session.world.simulates_figure

    def observe(ticks: TickLog, frames: FrameLog, n: int) -> None:
        record(ticks, frames, n)
        if page is None:
            return
        hand = ticks.hand[n - 1]
        page.show(
            Moment(
                hand[HAND_TIME], shown_configuration(servo), servo.reference.pose if simulated else hand[:0],
                hand[POSITION], ticks.force[n - 1], ticks.user[n - 1], np.full(3, np.nan),
            )
        )  # fmt: skip

    loop = session.loop(observe, VIEW_BLOCK_SECONDS if view else BLOCK_SECONDS)
    first = servo.plant.period * servo.figure_ticks
    rest = first * (round(seconds / first) - 1)  # a whole number of figure updates, as many as in a single call
    with session.naming_laws():
        loop.run(first)
    session.haptic_map.check()
    first_tick = time.perf_counter() - started
    with simulating(console, seconds) as reached:

        def progress(t: float) -> None:
            reached(t)
            session.haptic_map.check()  # a user-defined map that has failed ends the run at once
            if view:
                clock.wait_until(t)

        with session.naming_laws():
            times = loop.run(rest, progress)
    if page is not None:
        page.close()
    store_duration(SIMULATING, 1.0 / times.real_time_factor)
    return SpeedSummary(times.real_time_factor, first_tick, peak_memory_mb())


def _live_page(session: Session) -> "LivePage":
    from sim.viewer.live_page import LivePage  # importing viser takes a third of a second, and is rarely needed

    static = session.static()
    radius = float(np.asarray(static["tube_radius"]))
    return LivePage(session.world.full_model(), courses(static), radius, session.world.kind)


def session_summary(out: Path, session: Session, speed: SpeedSummary) -> RunSummary:
    """Summary of a session that has been run, computed from its recording."""
    parts = session.parts

    with Recording(out / results.RECORDING) as recording:
        summary = summarise(recording, default_poses(session), speed, session.world.warnings(), parts.handled)
        field = session.servo.field
        of = Measuring(
            recording, lambda: default_poses(session), parts.handled, field.memory, field.walkers.state,
            partial(save_curve, path=out / CURVE_FILE),
        )  # fmt: skip
        return replace(parts.summarise(summary, of), remarks=session.remarks)


def write_animations(out: Path, session: Session) -> None:
    """Write two BVH files: the animation as the hand made it, and that of the curve's nearest points at each frame."""
    with Recording(out / results.RECORDING) as recording:
        if not session.world.has_figure:
            return
        reference = recording.channel("frames", "reference")
        on_curve = [recording.channel("ticks", name) for name in ("nearest", "phase", "river")]
        stride = max(1, round(recording.rates["frames"] / BVH_FPS))
        fps = recording.rates["frames"] / stride
        n = -(-len(reference) // stride)
        per_frame = stride * session.servo.figure_ticks
        poses_at = default_poses(session, stride)
        starts, stature = range(0, n, BLOCK_FRAMES), session.world.config.stature
        blocks = [slice(k * per_frame, (k + BLOCK_FRAMES) * per_frame, per_frame) for k in starts]
        edited = (reference[k * stride : (k + BLOCK_FRAMES) * stride : stride] for k in starts)
        write_bvh_blocks(out / results.EDITED, n, fps, edited, stature)
        default = (poses_at(*(c[rows] for c in on_curve)) for rows in blocks)
        write_bvh_blocks(out / results.DEFAULT, n, fps, default, stature)
