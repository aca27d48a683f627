"""Presses of the stylus switch in a recording, against the memory of the field of the same run."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from controllers.fields.algebra.instructions import TRACE_DISTANCE, TRACE_PHASE, TRACE_POINT, TRACE_SIZE
from controllers.fields.stretchy_tubes import StretchyTubes, stretchy_wrench
from controllers.state import HAND_POSITION, HAND_SIZE, HAND_SWITCH, HAND_VELOCITY
from experiments.config.options import run_config
from experiments.results.measures import stretch_measures
from experiments.results.measures.phases import EditingSummary, PerformanceSummary, PressSummary
from experiments.results.measures.stretch_measures import press_summaries
from experiments.results.measures.summary_parts import AnimationSummary, FigureSummary, PathSummary, PushSummary
from experiments.setups.modes.stretch import stretch_grabs
from experiments.setups.parts.defaults import resolved
from experiments.setups.parts.hands import edited_until
from experiments.setups.parts.part_types import Parts
from experiments.setups.setups import map_parts, parts_of
from models.humanoid.skeleton import figure_model
from sim.body.residual import Residual
from sim.recording.recorder import Group, Recorder
from sim.recording.recording import Recording
from sim.users.hand.actions import Grab
from sim.users.hand.arm import Arm, hand_force

MASS, PERIOD = 0.15, 1e-3
CURVE = Trajectory.circle(0.0477, 4.0)
EPSILON = 0.008
# A clip without flights, which would add remarks on holding them.
MAPS = map_parts(run_config(map="composite", clips=("cheer",)), figure_model())
CHANNELS = {"t": (), "p": (3,), "user": (3,), "switch": (), "phase": (), "nearest": (3,), "distance": ()}


def parts_with(mode: str = "follow", user: str = "", expressive: bool = False, **words: object) -> Parts:
    config = resolved(run_config(mode, "composite", user, expressive=expressive, **words))
    return parts_of(config, replace(MAPS, expressive=expressive))


def recorded(path: Path, grabs: Sequence[Grab], seconds: float) -> tuple[StretchyTubes, np.ndarray, Recording]:
    """A hand on a mass in the field, recorded; returned with the field and its memory at the end."""
    field, arm = parts_with("stretch", grabs=tuple(grabs)).field, Arm(grabs=grabs).compiled()
    assert isinstance(field, StretchyTubes)
    program = field.program()
    params, memory, hand = program.params, program.fresh_memory(), np.zeros(HAND_SIZE)
    wrench, user, p, v = np.zeros(6), np.zeros(3), CURVE.point(0.0), np.zeros(3)
    n = round(seconds / PERIOD)
    ticks = {name: np.zeros((n, *shape)) for name, shape in CHANNELS.items()}
    for k in range(n):
        hand[0], hand[HAND_SWITCH] = k * PERIOD, arm.switch[0]
        # Rounded as by encoders: a resting hand has the same position for many ticks.
        hand[HAND_POSITION : HAND_POSITION + 3], hand[HAND_VELOCITY : HAND_VELOCITY + 3] = np.round(p, 5), v
        memory[TRACE_DISTANCE] = np.inf
        stretchy_wrench(params, 0, 0, memory, TRACE_SIZE, hand, wrench)
        hand_force(arm, k * PERIOD, p, v, user)
        trace = memory[:TRACE_SIZE]
        row = {"t": hand[0], "p": hand[HAND_POSITION : HAND_POSITION + 3], "user": user, "switch": hand[HAND_SWITCH]}
        row |= {"phase": trace[TRACE_PHASE], "nearest": trace[TRACE_POINT : TRACE_POINT + 3]}
        for name, value in (row | {"distance": trace[TRACE_DISTANCE]}).items():
            ticks[name][k] = value
        v = v + PERIOD / MASS * (wrench[:3] + user)
        p = p + PERIOD * v
    with Recorder(path, {}, 0, {"ticks": Group(1.0 / PERIOD, CHANNELS)}, {}) as recorder:
        recorder.append("ticks", ticks)
    return field, memory, Recording(path)


def test_presses_of_default_tour_match_the_field_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    grabs = stretch_grabs(CURVE, EPSILON)
    field, memory, recording = recorded(tmp_path / "run.h5", grabs, 14.2)
    with recording:
        presses = press_summaries(recording, CURVE, EPSILON)
        monkeypatch.setattr(stretch_measures, "ROWS", 777)
        assert press_summaries(recording, CURVE, EPSILON) == presses
        assert [press.what for press in press_summaries(recording, CURVE, EPSILON, 6.0)] == ["held"]
    assert [press.what for press in presses] == ["held", "held", "undo", "redo", "pushed"]
    starts = [grab.at + (grab.place is not None) * grab.reach for grab in grabs]
    assert [press.start for press in presses] == pytest.approx(starts, abs=2e-3)
    assert [press.seconds for press in presses] == pytest.approx([g.seconds + g.hold for g in grabs], abs=2e-3)
    edits, bent = field.edits(memory), field.edited(memory)
    assert len(edits) == 3
    bending = [press for press in presses if press.lap is not None]
    for press, edit in zip(bending, edits, strict=True):
        phase = press.lap * CURVE.duration
        assert phase == pytest.approx(edit[0], abs=1.0 / 32.0)
        bent_mm = 1e3 * np.linalg.norm(bent.point(phase) - CURVE.point(phase))
        assert press.deviation_mm == pytest.approx(bent_mm, abs=1e-6)
        assert press.dragged_mm == pytest.approx(bent_mm, abs=0.3)
        assert press.dragged_mm > 3.0
        assert press.peak_force > 0.3
    assert [press.line() for press in presses[2:4]] == ["undone", "redone"]
    assert presses[0].line().startswith("grabbed at 12 % of the curve and dragged 13.3 mm")


def test_presses_without_effect_are_reported_as_nothing(tmp_path: Path) -> None:
    still, away = (0.0, 0.0, 0.0), (0.02, 0.0, 0.0)
    grabs = [
        Grab(0.2, still, 0.15, 0.0),  # nothing to undo
        Grab(1.0, still, 0.7, 0.0),  # nor to redo
        Grab(2.0, away, 0.5, 0.4, (0.0477 + 0.02, 0.0, 0.0), 1.0),  # a press away from the tube that carries nothing
        Grab(4.5, away, 0.5, 0.1, (0.0477, 0.0, 0.0), 1.0),
    ]
    field, memory, recording = recorded(tmp_path / "run.h5", grabs, 6.5)
    with recording:
        presses = press_summaries(recording, CURVE, EPSILON)
    assert [press.what for press in presses] == ["nothing", "nothing", "nothing", "held"]
    assert all(press.lap is None and press.dragged_mm == 0.0 for press in presses[:3])
    assert len(field.edits(memory)) == 1


def test_press_cut_off_by_the_end_of_the_run_is_reported(tmp_path: Path) -> None:
    _, _, recording = recorded(tmp_path / "run.h5", stretch_grabs(CURVE, EPSILON)[:1], 3.2)
    with recording:
        (press,) = press_summaries(recording, CURVE, EPSILON)
    assert (press.what, press.start) == ("held", pytest.approx(2.3, abs=2e-3))
    assert press.seconds == pytest.approx(0.9, abs=2e-3)


@pytest.mark.parametrize("mode", ["stretch", "stretch-then-follow"])
@pytest.mark.parametrize("seconds", [8.0, 20.0, 30.0])
def test_pushes_begin_only_once_the_curve_is_bent(mode: str, seconds: float) -> None:
    """A push during the edits would drag the undo click, and move a held point faster than a body can."""
    grabs = stretch_grabs(CURVE, EPSILON)
    parts = parts_with(mode, "push", seconds=seconds, grabs=grabs)
    starts = [push.at for push in parts.user.pushes]
    assert min(starts) > edited_until(grabs) + CURVE.duration
    assert len(starts) == (4 if seconds == 30.0 else 2)
    assert parts.handled == tuple((grab.at, grab.end) for grab in grabs)
    assert len(parts.remarks) == (1 if seconds == 8.0 else 0)
    assert parts_with(mode, "push", seconds=seconds).user.grabs == grabs, "what it does by default"


def test_default_pushes_begin_in_the_second_lap_unless_the_run_ends_by_then() -> None:
    for seconds in (3.0, 9.0, 20.0, 22.0):
        parts = parts_with(user="push", seconds=seconds)
        starts = [push.at for push in parts.user.pushes[::2]]
        laps = range(1 if seconds > 5.0 else 0, max(1, int(seconds / 4.0)))
        assert starts == [4.0 * lap + 0.4 for lap in laps]
        assert not parts.remarks


def test_tracing_and_leading_hands_never_push() -> None:
    led = run_config(mode="lead")
    for parts in (parts_with(user="trace"), parts_of(led, map_parts(led, figure_model()))):
        assert parts.handled == ((0.0, np.inf),)
        assert len(parts.user.pushes) == 0
    assert parts_with().handled == ()
    assert "--expressive" in parts_with(user="turn").remarks[0]
    assert parts_with(user="turn", expressive=True).remarks == ()


def test_editing_and_performance_summary_lines() -> None:
    press = PressSummary(2.3, 1.7, "held", 0.125, 13.2, 13.3, 2.1)
    push = PushSummary(18.8, 1.2, 2.5, 8.4, 0.99)
    animation = AnimationSummary(31.0, 27.0)
    residual = Residual(14.3, 0.124, 0.9, 0.01, 0.05)
    figure = FigureSummary(
        (), None, 14.3, 14.3, 1.0, 0.1, 0.2, 0.124, residual, residual, residual, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0
    )
    editing = EditingSummary(14.3, 14.3, (press,), (), animation, figure)
    assert editing.lines() == [
        "Editing, 14.3 s: at 2.3 s grabbed at 12 % of the curve and dragged 13.2 mm.",
        "While it was edited the animation changed by up to 31.0° a joint; residual force 12.4 % of body weight RMS.",
    ]
    performance = PerformanceSummary(14.3, 7.7, PathSummary(0.16, 9.0, 1.9, 4.0, (push,)), animation, figure)
    assert performance.lines() == [
        "Performing, 7.7 s from 14.3 s on: 1.90 laps, 0.16 mm RMS from the bent curve when left alone.",
        "Pushes: 2.5 N at 18.8 s moved it 8.4 mm.",
        "The performed animation differs from the unedited one by up to 31.0° a joint where it was pushed, 27.0° "
        "elsewhere; residual force 12.4 % of body weight RMS.",
    ]
    lines = EditingSummary(6.0, 14.3, (), (), animation, figure).lines()
    assert lines[0] == "Editing, 6.0 s: the switch was not pressed."
    assert lines[-1] == "It was to be performed from 14.3 s on, but the run ended before."
