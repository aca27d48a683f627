"""Measures of a run on a synthetic recording with known values, for any block size."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from experiments.results.measures import run_measures as measures
from experiments.results.measures.run_measures import summarise
from experiments.results.measures.summary import RunSummary
from experiments.results.measures.summary_parts import SpeedSummary
from models.humanoid.skeleton import rest_pose
from sim.body.residual import Residual
from sim.recording.recorder import Group, Recorder
from sim.recording.recording import Recording

PERIOD, EVERY, N = 1e-3, 10, 4000


def recording_of(path: Path, down: np.ndarray) -> Recording:
    """Four seconds on a line, 0.2 mm off, but for a push to 10 mm at 2 s, when one joint is 0.1 rad off."""
    t = np.arange(N) * PERIOD
    pushing = (t >= 2.0) & (t < 2.5)
    bump = np.where(pushing, np.sin(np.pi * (t - 2.0) / 0.5) ** 2, 0.0)
    phase = t % 1.5
    nearest = np.stack((phase, np.zeros(N), np.zeros(N)), axis=1)
    distance = np.maximum(0.01 * bump, 2e-4)
    p = nearest + distance[:, None] * np.array([0.0, 1.0, 0.0])
    user = 3.0 * bump[:, None] * np.array([0.0, 1.0, 0.0])
    m = N // EVERY
    reference = np.tile(rest_pose(), (m, 1))
    turned = bump[::EVERY] > 0.01
    reference[turned, 7:11] = [np.cos(0.05), np.sin(0.05), 0.0, 0.0]
    flight = np.zeros(m)
    flight[100:120] = 1.0
    residual = np.where(flight[:, None] > 0.0, 0.0, np.array([3.0, 4.0, 0.0, 0.0, 0.0, 2.0]))
    residual[220] = [0.0, 0.0, 70.0, 0.0, 7.0, 0.0]  # without contact, where it should stand
    ticks = {"t": t, "p": p, "nearest": nearest, "distance": distance, "phase": phase, "user": user, "force": -user}
    ticks |= {"river": np.full(N, -1.0), "tank": 0.1 - 0.02 * t}
    ticks["tank_scale"] = np.where((t >= 3.0) & (t < 3.1), 0.5, 1.0)
    ground = np.tile([0.0, 0.0, 700.0], (m, 1))
    ground[100:120] = 0.0  # in flight
    ground[200:230] = 0.0  # and when it should stand
    frames = {
        "t": t[::EVERY], "reference": reference, "joint_error": np.full(m, 0.02), "root_error": np.full(m, 0.03),
        "down": down,
        "residual": residual, "ground": ground, "flight": flight,
        "saturated": np.full(m, 5.1),
    }  # fmt: skip
    groups = {
        "ticks": Group(1 / PERIOD, {name: array.shape[1:] for name, array in ticks.items()}),
        "frames": Group(1 / PERIOD / EVERY, {name: array.shape[1:] for name, array in frames.items()}),
    }
    static = {"curve_span": np.array([0.0, 1.5]), "curve_closed": 1.0, "body_weight": 700.0}
    static |= {"com_height": 1.0, "clip_seconds": 1.2, "scene": np.array([1.75, 75.0, 1e-3, 1e-3])}
    with Recorder(path, {}, 0, groups, static) as recorder:
        recorder.append("ticks", ticks)
        recorder.append("frames", frames)
    return Recording(path)


def summary_of(path: Path, down: np.ndarray | None = None, handled: tuple[tuple[float, float], ...] = ()) -> RunSummary:
    with recording_of(path, np.zeros(N // EVERY) if down is None else down) as recording:
        return summarise(
            recording, lambda points, phases, rivers: np.tile(rest_pose(), (len(points), 1)), SpeedSummary(1, 1, 1), {},
            handled,
        )  # fmt: skip


def test_summary_of_hand_never_left_alone(tmp_path: Path) -> None:
    summary = summary_of(tmp_path / "run.h5")
    never = replace(summary, path=replace(summary.path, deviation_rms_mm=None))
    assert "0.20 mm RMS from the curve when left alone" in summary.lines()[1]
    assert "laps, never left alone on the curve for more than a second." in never.lines()[1]


def test_measures_of_synthetic_recording_match_its_construction(tmp_path: Path) -> None:
    summary = summary_of(tmp_path / "run.h5")
    assert summary.path.deviation_rms_mm == pytest.approx(0.2)
    assert summary.path.laps == pytest.approx((N - 1) * PERIOD / 1.5)
    (push,) = summary.path.pushes
    assert push.start == pytest.approx(2.0, abs=0.01)
    assert push.seconds == pytest.approx(0.5, abs=0.02)
    assert (push.peak_force, push.deviation_mm) == (pytest.approx(3.0), pytest.approx(10.0))
    assert push.along_push == pytest.approx(1.0)
    assert summary.animation.pushed_deg == pytest.approx(np.degrees(0.1))
    assert summary.animation.unpushed_deg == 0.0
    figure = summary.figure
    assert figure.fell_at is None
    assert figure.joint_error_rms_deg == pytest.approx(np.degrees(0.02))
    assert (figure.root_error_rms_cm, figure.root_error_max_cm) == (pytest.approx(3.0), pytest.approx(3.0))
    # 380 frames of stance: 379 with 5 N and 2 N m, and one with 70 N and 7 N m.
    assert figure.stance.force_rms == pytest.approx(np.sqrt((379 * 5.0**2 + 70.0**2) / 380) / 700.0)
    assert figure.stance.moment_rms == pytest.approx(np.sqrt((379 * 2.0**2 + 7.0**2) / 380) / 700.0)
    assert (figure.stance.force_max, figure.stance.moment_max) == (pytest.approx(0.1), pytest.approx(0.01))
    assert figure.residual_force_rms == figure.stance.force_rms
    assert figure.residual_in_flight_max == 0.0
    # The ground bears nothing in 0.2 s of flight, and in 0.3 s in which the reference stands.
    assert figure.without_ground_force.seconds == pytest.approx(0.5)
    assert figure.without_ground_force.force_max == pytest.approx(0.1)
    assert figure.lost_contact_seconds == pytest.approx(0.3)
    assert figure.flight_seconds == pytest.approx(0.2)
    assert figure.saturated == pytest.approx(0.1)
    assert figure.ground_force_mean == pytest.approx(1.0 - 50 / 400)
    assert figure.grounded == pytest.approx(1.0 - 30 / 380)
    assert summary.animation is not None
    assert summary.animation.fastest_joint == pytest.approx(0.1 / (EVERY * PERIOD))
    assert "jumps" not in summary.animation.soles()
    assert "at most, and a joint jumps (1500 rad/s)." in replace(summary.animation, fastest_joint=1500.0).soles()
    # A push of half a second is not an oscillation.
    assert (summary.oscillation.since, summary.oscillation.share) == (None, 0.0)
    assert (summary.tank.least_mj, summary.tank.scaled_ticks) == (pytest.approx(100.0 - 20.0 * 3.999), 100)
    assert len(summary.lines()) == 9
    assert summary.path.pace == pytest.approx(1.2 / 1.5)
    assert summary.path.stopped_at is None
    assert "reduced the force at 100 ticks" in summary.lines()[0]


@pytest.mark.parametrize("block", [1, 7, 113, 205])
def test_measures_do_not_depend_on_block_size(block: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Including blocks that end in the middle of a push."""
    whole = summary_of(tmp_path / "whole.h5")
    monkeypatch.setattr(measures, "BLOCK_FRAMES", block)
    pieces = summary_of(tmp_path / "pieces.h5")
    assert len(pieces.path.pushes) == 1
    for part in ("path", "animation", "figure", "tank"):
        for name, value in vars(getattr(whole, part)).items():
            other = getattr(getattr(pieces, part), name)
            if name == "pushes":
                assert vars(other[0]) == pytest.approx(vars(value[0]))
            elif isinstance(value, Residual):
                assert vars(other) == pytest.approx(vars(value)), name
            else:
                assert other == (value if value is None else pytest.approx(value)), name


def test_time_span_of_a_run_is_measured_alone(tmp_path: Path) -> None:
    with recording_of(tmp_path / "run.h5", np.zeros(N // EVERY)) as recording:
        parts = [
            measures.measure_span(recording, lambda points, *_: np.tile(rest_pose(), (len(points), 1)), span)
            for span in ((0.0, 1.7003), (1.7003, 2.2), (2.2, np.inf))
        ]
    paths = [path for path, *_ in parts]
    # A span begins with the first frame after its start, and its first tick has no step.
    assert [path.laps for path in paths] == pytest.approx([1.709 / 1.5, 0.489 / 1.5, 1.799 / 1.5])
    assert [len(path.pushes) for path in paths] == [0, 1, 1]
    assert paths[1].pushes[0].start == pytest.approx(2.0, abs=0.01)
    assert [path.deviation_rms_mm for path in paths] == [pytest.approx(0.2), None, pytest.approx(0.2)]
    assert paths[1].deviation_max_mm is None
    animations = [animation for _, animation, _, _ in parts]
    # A push counts in the first second of a span, too, and what is not measured is not 0.
    assert animations[1].pushed_deg == pytest.approx(np.degrees(0.1))
    assert [(animations[0].pushed_deg, a.unpushed_deg) for a in animations] == [(None, 0.0), (None, None), (None, 0.0)]
    assert [a.changed(False, 2) for a in animations] == ["0.00° a joint", "5.73° a joint", "5.73° a joint"]
    assert animations[1].changed(True, 2) == "5.7° a joint where it was pushed"
    flights = [figure.flight_seconds for _, _, figure, _ in parts]
    assert flights == pytest.approx([0.2, 0.0, 0.0])


def test_laps_are_counted_along_the_river_that_has_the_hand() -> None:
    """One lap of 3 s, then one of 2 s from its middle on, then in no river; each plays a clip of 3 s."""
    arrays = {"curve_span": np.array([0.0, 3.0]), "curve_closed": 1.0, "clip_seconds": 3.0}
    arrays |= {"river_laps": np.array([3.0, 2.0]), "river_clip_laps": np.array([3.0, 3.0])}
    path = measures.PathMeasure(SimpleNamespace(arrays=arrays, texts={}, rates={"ticks": 1000.0}))
    t = np.arange(6000) * 1e-3
    river = np.where(t < 3.0, 0.0, np.where(t < 5.0, 1.0, -1.0))
    phase = np.where(t < 3.0, t, np.where(t < 5.0, np.mod(t - 2.0, 2.0), np.mod(7.0 * t, 1.3)))
    place = np.stack((t, t, t), axis=1)
    for rows in np.split(np.arange(6000), [2000, 3000, 3001, 4567]):
        path.add({"t": t[rows], "p": place[rows], "nearest": place[rows], "distance": np.zeros(len(rows)),
                  "phase": phase[rows], "river": river[rows], "user": np.zeros((len(rows), 3))})  # fmt: skip
    summary = path.summary()
    assert summary.laps == pytest.approx(2.0, abs=2e-3)
    assert summary.paces == (pytest.approx(6.0 / 6.0, abs=2e-3),)


def test_handled_time_counts_neither_as_push_nor_as_left_alone(tmp_path: Path) -> None:
    whole = summary_of(tmp_path / "whole.h5")
    handled = summary_of(tmp_path / "run.h5", handled=((1.9, 2.6),))
    assert handled.path.pushes == ()
    assert handled.path.deviation_rms_mm == whole.path.deviation_rms_mm
    assert handled.animation == whole.animation
    assert "The hand did not push." in handled.lines()
    assert f"up to {whole.animation.pushed_deg:.2f}° a joint." in " ".join(handled.lines())


def test_tick_that_rounding_takes_out_of_a_grab_is_no_push(tmp_path: Path) -> None:
    first = summary_of(tmp_path / "whole.h5").path.pushes[0].start
    assert summary_of(tmp_path / "run.h5", handled=((first + 1e-9, 2.6),)).path.pushes == ()


def test_tracing_hand_is_reported(tmp_path: Path) -> None:
    summary = summary_of(tmp_path / "run.h5", handled=((0.0, np.inf),))
    with Recording(tmp_path / "run.h5") as recording:
        trace = measures.trace_summary(recording)
        settled = recording.channel("ticks", "distance")[:][round(1.0 / PERIOD) :]
    assert trace.deviation_rms_mm == pytest.approx(1e3 * np.sqrt(np.mean(settled**2)))
    assert trace.peak_force == pytest.approx(3.0)
    lines = replace(summary, trace=trace).lines()
    assert any(line.startswith("The hand moved by itself, within ") for line in lines)
    brief = replace(trace, deviation_rms_mm=None)
    assert brief.line() == "The hand moved by itself, with up to 3.0 N."
    assert not any("push" in line.lower() for line in lines)


def test_falls_are_reported_and_down_time_is_excluded(tmp_path: Path) -> None:
    down = np.zeros(N // EVERY)
    down[150:200], down[200:250] = 1.0, 2.0
    down[380:] = 1.0
    summary = summary_of(tmp_path / "run.h5", down)
    figure = summary.figure
    assert figure.falls == (pytest.approx(1.5), pytest.approx(3.8))
    assert figure.fell_at == pytest.approx(1.5)
    assert (figure.seconds, figure.up_seconds) == (pytest.approx(4.0), pytest.approx(2.8))
    # The time without ground force when it should stand, 2 to 2.3 s, is left out; its flight is not.
    assert figure.lost_contact_seconds == 0.0
    assert figure.flight_seconds == pytest.approx(0.2)
    assert "fell at 1.5, 3.8 s (2 falls); its measures are over the 2.8 of 4.0 s" in " ".join(summary.lines())
