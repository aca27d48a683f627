"""Completes an interrupted run from its recording: summary, animations, figures, page."""

from pathlib import Path

from rich.console import Console

from experiments.console.compiling import compiler
from experiments.results.folder import RECORDING, SUMMARY, clips_of, config_of, locked_folder
from experiments.results.measures.summary_parts import SpeedSummary
from experiments.results.pages.report import lines_of, write_report_of
from experiments.runs.reproduce import check_files
from experiments.runs.run import session_summary, write_animations, write_summary
from experiments.setups.wiring import wire
from sim.loop.loop import peak_memory_mb
from sim.recording.recording import Recording


def finish(folder: Path) -> list[str]:
    """Draw figures and page of a run again; an interrupted run first gets its summary and animations.

    Returns what happened in the run, in words.

    Raises
    ------
    SimError
        If there is no recording, or the run is still in progress.
    """
    with Recording(folder / RECORDING) as recording:
        is_configured = "mode" in recording.config and "live" not in recording.texts
        interrupted = not recording.complete and not (folder / SUMMARY).exists()
    with locked_folder(folder):
        if interrupted and is_configured:
            _complete(folder)
        write_report_of(folder)
    with Recording(folder / RECORDING) as recording:
        return lines_of(recording, folder)


def _complete(folder: Path) -> None:
    """Write summary and animations; state that is not in the recording is found by simulating the run again."""
    with Recording(folder / RECORDING) as recording:
        config = config_of(recording)
        check_files(config, recording)
        session = wire(config, clips_of(recording), compiler(Console(stderr=True)))
        seconds = len(recording.channel("ticks", "t")) * session.servo.plant.period
        times = session.loop().run(seconds)
    speed = SpeedSummary(times.real_time_factor, float("nan"), peak_memory_mb())
    write_summary(folder, session_summary(folder, session, speed))
    write_animations(folder, session)
