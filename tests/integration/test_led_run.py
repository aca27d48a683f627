"""A figure led along an S and straight back: it retraces its path, and its feet do not slide."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.config.options import run_config
from experiments.runs.run import run
from experiments.setups.modes import lead
from experiments.setups.parts import leading_hand
from sim.recording.recording import Recording
from tests.captures import MOCAP, needs_mocap

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("led") / "run"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("experiments.results.pages.report.write_report_of", lambda folder: None)
        run(run_config(mode="lead", seconds=19.0), folder, False, 0.0)
    return folder


def assert_led_back(summary: dict[str, Any]) -> None:
    """It stands, comes back within 1 cm and 3°; soles slide by less than 3 cm, the figure's likewise."""
    lead, figure = summary["lead"], summary["figure"]
    assert figure["fell_at"] is None
    assert lead["retrace_cm"] < 1.0
    assert lead["retrace_deg"] < 1.0
    assert lead["physical_retrace_cm"] < 1.0
    # SNU's run: 2.5°; the others: 2° at most.
    assert lead["physical_retrace_deg"] < 3.0
    assert lead["slide_cm"] < 3.0
    assert lead["physical_slide_cm"] < 3.0  # DeepMimic's run: 1.7 to 2.1 cm along four paths


def test_led_walk_retraces_its_path_within_1_cm_and_2_degrees(folder: Path) -> None:
    summary = json.loads((folder / "summary.json").read_text())
    lead, figure = summary["lead"], summary["figure"]
    assert lead["length_m"] > 5.5
    assert lead["retrace_cm"] < 0.1
    assert lead["retrace_deg"] < 0.1
    assert figure["fell_at"] is None
    assert lead["physical_retrace_cm"] < 1.0
    assert lead["physical_retrace_deg"] < 2.0
    assert figure["joint_error_rms_deg"] < 2.0


def test_led_walk_follows_the_s_curve_and_returns(folder: Path) -> None:
    with Recording(folder / "run.h5") as recording:
        s = recording.channel("ticks", "phase")[:]
        poses = recording.channel("frames", "reference")[:]
    farthest = int(np.argmax(s))
    # The hand leads for five seconds after a pause of 0.8 s; the figure ends up behind it.
    assert 5.8 < 1e-3 * farthest < 9.0
    assert s[-1] < 0.05 * s[farthest]
    w, x, y, z = poses[:, 3:7].T
    yaw = np.unwrap(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
    forth = np.degrees(yaw[: farthest * len(poses) // len(s)])
    # Left by about 80 degrees and right again.
    assert 60.0 < forth.max() - forth[0] < 100.0
    assert forth.max() - forth[-1] > 40.0


def test_soles_keep_contact_and_support_bounds_the_turn_rate(folder: Path) -> None:
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["lead"]["slide_cm"] < 3.0
    none, one, two = summary["lead"]["turn_deg_per_s"]
    assert none == 0.0
    assert 20.0 < one < np.degrees(0.9) + 1e-6
    assert one < two < np.degrees(1.2) + 1e-6
    assert summary["lead"]["physical_slide_cm"] < 1.5  # 0.6; with what the contact spheres roll 2.4


# What is prepared rounds by the kernels of OpenBLAS: xia has 0.138 with Zen's and 0.142 with Nehalem's; with these
# 02_01 has 0.043, 02_03 0.089 and snu's run 0.086.
@needs_mocap
@pytest.mark.usefixtures("without_page")
@pytest.mark.parametrize(
    ("file", "residual"),
    [
        ("cmu_amc/02_01.amc", 0.08),
        ("xia/dme_example.bvh", 0.20),
        # Runs are led by steps.
        ("cmu_amc/02_03.amc", 0.10),
        ("snu/run.bvh", 0.10),
        ("deepmimic/humanoid3d_run.txt", 0.12),
    ],
)
def test_captured_walks_and_runs_stand_and_return(tmp_path: Path, file: str, residual: float) -> None:
    run(run_config(mode="lead", clips=(str(MOCAP / file),), seconds=19.0), tmp_path / "run", False, 0.0)
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert_led_back(summary)
    assert summary["figure"]["residual_force_rms"] < residual


@needs_mocap
@pytest.mark.usefixtures("without_page")
def test_stepping_run_returns_along_a_wider_s_curve(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Each half turns from −72° to 72°: the figure lags, and at 1.3 times its pace it stumbled and turned by 7°.
    for module in (lead, leading_hand):
        monkeypatch.setattr(module, "HALF_TURN", 0.4 * np.pi)
    clip = str(MOCAP / "deepmimic/humanoid3d_run.txt")
    run(run_config(mode="lead", clips=(clip,), seconds=19.0), tmp_path / "run", False, 0.0)
    assert_led_back(json.loads((tmp_path / "run" / "summary.json").read_text()))


@pytest.mark.usefixtures("without_page")
def test_led_run_flies_along_the_s_curve_and_returns(tmp_path: Path) -> None:
    run(run_config(mode="lead", clips=("run",), seconds=19.0), tmp_path / "run", False, 0.0)
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert_led_back(summary)
    assert summary["figure"]["flight_seconds"] > 0.15  # of the reference, clear of the floor
    assert summary["lead"]["turn_deg_per_s"][0] == 0.0
