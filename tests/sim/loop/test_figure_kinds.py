"""Physical figure, kinematic figure and none: what is recorded, read and drawn of each."""

import time
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from experiments.config.options import run_config
from experiments.config.part import to_dict
from experiments.results.pages.report import write_report_of
from experiments.runs.run import record, write_animations
from experiments.setups.session import Session
from experiments.setups.wiring import wire
from models.world.scene import FIGURE, device_world_model, world_model
from sim.errors import SimError
from sim.loop.channels import make_logs
from sim.loop.servo import run_block
from sim.recording.recording import Recording
from sim.world.world import World

CLIPS = ("cheer", "angry")


def session_of(kind: str, seconds: float = 1.0, **words: object) -> Session:
    return wire(run_config(clips=CLIPS, seconds=seconds, figure=kind, **words))


def logged(session: Session, n: int):
    ticks, frames = make_logs(session.servo, n)
    run_block(session.servo, 0, n, False, ticks, frames)
    return ticks, frames


def test_model_without_figure_is_the_first_part_of_the_one_with_it() -> None:
    scene = run_config().scene
    figure_model, device_model = world_model(scene), device_world_model(scene)
    assert int(figure_model.joint(FIGURE + "root").qposadr[0]) == device_model.nq
    assert [figure_model.joint(j).name for j in range(device_model.njnt)] == [
        device_model.joint(j).name for j in range(device_model.njnt)
    ]


def test_kinematic_figure_shows_the_reference() -> None:
    physical, shown = session_of("physical"), session_of("kinematic")
    (ticks, frames), (shown_ticks, shown_frames) = logged(physical, 1000), logged(shown, 1000)
    # Two solvers round differently, and encoders count.
    np.testing.assert_allclose(shown_ticks.hand[:, 1:4], ticks.hand[:, 1:4], atol=2e-4)
    np.testing.assert_allclose(shown_frames.reference[:, 7:], frames.reference[:, 7:], atol=0.02)
    assert shown_frames.qpos.shape == frames.qpos.shape
    np.testing.assert_array_equal(shown_frames.qpos[:, -75:], shown_frames.reference)
    assert np.abs(np.diff(shown_frames.reference, axis=0)).max() > 1e-3
    assert not shown_ticks.residual.any()


def test_stylus_motion_is_the_same_without_a_figure() -> None:
    (ticks, _), (shown_ticks, frames) = logged(session_of("physical"), 1000), logged(session_of("none"), 1000)
    np.testing.assert_allclose(shown_ticks.hand[:, 1:4], ticks.hand[:, 1:4], atol=2e-4)
    assert frames.reference.shape[1] == 0
    assert frames.qpos.shape[1] == device_world_model(run_config().scene).nq


def test_unknown_kind_is_refused() -> None:
    with pytest.raises(SimError, match="'ghost'; expected one of physical, kinematic, none"):
        World(kind="ghost")  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("kind", ["kinematic", "none"])
@pytest.mark.slow
def test_recording_without_physical_figure_is_measured_and_drawn(kind: str, tmp_path: Path) -> None:
    session = session_of(kind, 1.5, user="push")
    summary = record(session, tmp_path, to_dict(session.config), 1.5, time.perf_counter(), Console(quiet=True))
    write_animations(tmp_path, session)
    write_report_of(tmp_path)
    assert summary.figure is None
    assert (summary.animation is None) == (kind == "none")
    assert not any("physical figure" in line for line in summary.lines())
    page = (tmp_path / "report.html").read_text()
    assert "physical figure" not in page
    assert (tmp_path / "edited.bvh").exists() == (kind == "kinematic")
    assert not (tmp_path / "figures" / "figure.png").exists()
    with Recording(tmp_path / "run.h5") as recording:
        names = {"t", "qpos"} | ({"reference"} if kind == "kinematic" else set())
        assert set(recording.groups["frames"]) == names


def test_fault_is_recorded_and_reported_first_in_the_summary(tmp_path: Path) -> None:
    session = session_of("none")
    session.servo.field.limiter[0] = np.nan
    summary = record(session, tmp_path, to_dict(session.config), 1.0, time.perf_counter(), Console(quiet=True))
    assert summary.lines()[0] == "The motors were switched off at 0.000 s: the limiter's memory held nan."
    with Recording(tmp_path / "run.h5") as recording:
        assert (recording.channel("ticks", "fault")[:] == 2.0).all()
        assert recording.summary is not None
