"""Figures and page of a run, drawn from its recording, also of a run that was cut short."""

from pathlib import Path
from typing import cast

import mujoco

from experiments.files.curve_files import CURVE_FILE
from experiments.results.figures import draw_figures
from experiments.results.folder import FIGURES, RECORDING, REPORT, clips_of, config_of
from experiments.results.lead_figure import draw_lead
from experiments.results.report import write_report
from experiments.results.stretch_figure import draw_stretch
from models.scene import SceneConfig, device_world_model, world_model
from sim.recording.recording import Recording


def write_report_of(folder: Path) -> None:
    """Draw the figures and the page of a run from its recording."""
    with Recording(folder / RECORDING) as recording:
        config = config_of(recording)
        figures = draw_figures(recording, folder / FIGURES)
        if (folder / CURVE_FILE).exists():
            figures.insert(0, folder / FIGURES / "stretch.png")
            draw_stretch(recording, folder, figures[0])
        if config.mode.kind == "lead":
            figures.insert(0, folder / FIGURES / "lead.png")
            draw_lead(recording, figures[0])
        # A map from a file has clips of its own.
        title = f"{config.mode.kind.upper()} over {', '.join(clip.name for clip in clips_of(recording))}"
        write_report(folder / REPORT, recording, _model(recording, config.scene), title, _lines(recording), figures)


def _model(recording: Recording, scene: SceneConfig) -> mujoco.MjModel:
    """The model of the recorded configurations: where there is no figure, without one."""
    return device_world_model(scene) if recording.texts.get("figure") == "none" else world_model(scene)


def _lines(recording: Recording) -> list[str]:
    if recording.summary is None:
        t = recording.channel("ticks", "t")
        return [f"The run was cut short: {t[-1]:.1f} s of it are recorded, and there is no summary."]
    return [str(line) for line in cast(list[object], recording.summary["lines"])]
