"""The engine of the live page: dragging, bending, gains, stored states, takes."""

import json
import queue
import shutil
from typing import Any

import numpy as np
import pytest

from controllers.errors import ParameterError
from controllers.fields.algebra.law import TRACE_SIZE
from controllers.walking.walker import walker_at
from experiments.config.options import run_config
from experiments.live.session import engine_process
from experiments.live.session.engine import MAX_HAND_FORCE, Drag, Engine
from experiments.live.session.engine_process import slice_points
from experiments.live.session.gains import gains_of, with_gain
from experiments.live.session.messages import HELD, SHOWN, Board, Record
from experiments.live.session.takes import Take
from experiments.results.folder import EDITED, RECORDING, SUMMARY
from experiments.runs.reproduce import reproduce
from experiments.setups.wiring import wire
from models.mocap.library import load
from sim.errors import SimError
from sim.loop.field_slice import field_slice
from sim.recording.recording import Recording
from sim.recording.unclosed import has_writer


def make_engine(mode: str = "follow", **words: object) -> Engine:
    return Engine(wire(run_config(mode=mode, figure="kinematic", seconds=3600.0, **words)))


def run(engine: Engine, seconds: float) -> None:
    for _ in range(round(seconds / engine.seconds)):
        engine.advance()


def test_drag_force_is_stiffness_times_lag():
    engine = make_engine()
    run(engine, 0.8)
    relaxed = engine.session.servo.reference.pose.copy()
    target = engine.stylus + np.array([0.0, 0.0, 0.02])
    engine.drag = Drag(target)
    run(engine, 1.0)
    lag = target - engine.stylus
    user = engine.logs[0].user[-1]
    assert np.linalg.norm(user) > 1.0
    np.testing.assert_allclose(user, 300.0 * lag, atol=0.15)  # k times the lag, but for tremor and damping
    assert np.abs(engine.session.servo.reference.pose - relaxed).max() > 0.01
    engine.drag = None
    engine.advance()
    assert np.all(engine.logs[0].user[-1] == 0.0)


def test_long_hold_is_not_an_encoder_fault():
    engine = make_engine()
    run(engine, 0.4)
    engine.drag = Drag(engine.stylus + np.array([0.0, 0.0, 0.015]))
    run(engine, 3.0)
    assert engine.session.servo.device.faults[0] == 0.0
    assert np.linalg.norm(engine.logs[0].force[-1]) > 0.5


def test_drag_force_is_bounded():
    engine = make_engine()
    engine.drag = Drag(np.array([0.0, 0.0, 0.12]))  # 36 N of the arm's spring away
    strongest = 0.0
    for _ in range(60):
        engine.advance()
        strongest = max(strongest, float(np.linalg.norm(engine.logs[0].user, axis=1).max()))
    # The spring is bounded at every block, and so is the speed at which the damper takes the stylus along.
    assert MAX_HAND_FORCE / 2.0 < strongest < 1.5 * MAX_HAND_FORCE


def test_bend_undo_and_redo_restore_the_curve():
    engine = make_engine("stretch")
    run(engine, 0.4)
    before = engine.tubes.edited(engine.memory).point(np.linspace(0.0, 4.0, 41))
    engine.drag = Drag(engine.stylus + np.array([0.0, 0.0, 0.02]), pressed=True)
    run(engine, 0.6)
    engine.drag = None
    run(engine, 0.1)
    bent = engine.tubes.edited(engine.memory).point(np.linspace(0.0, 4.0, 41))
    assert engine.bends() == 1
    assert np.abs(bent - before)[:, 2].max() > 0.005
    assert engine.undo()
    np.testing.assert_array_equal(engine.tubes.edited(engine.memory).point(np.linspace(0.0, 4.0, 41)), before)
    assert not engine.undo()
    assert engine.redo()
    np.testing.assert_array_equal(engine.tubes.edited(engine.memory).point(np.linspace(0.0, 4.0, 41)), bent)


def test_bent_curve_is_performed_only_on_request():
    engine = make_engine("stretch-then-follow")
    run(engine, 0.8)
    start = engine.stylus.copy()
    run(engine, 0.8)
    assert np.linalg.norm(engine.stylus - start) < 2e-3  # the hand is pulled to the curve, not along it
    engine.perform(True)
    run(engine, 2.0)
    assert engine.performs
    assert np.linalg.norm(engine.stylus - start) > 0.02
    engine.perform(False)
    run(engine, 0.5)
    start = engine.stylus.copy()
    run(engine, 0.5)
    assert np.linalg.norm(engine.stylus - start) < 2e-3


@pytest.mark.parametrize("mode", ["follow", "bunny", "stretch", "stretch-then-follow", "lead"])
def test_changed_gains_equal_those_of_a_fresh_run(mode):
    engine = make_engine(mode)
    for gain, value in gains_of(engine.config).items():
        # Gains that time a bendable curve are left to the next test.
        if mode != "stretch-then-follow" or gain.name not in ("damping", "stiffness"):
            engine.set_gains(with_gain(engine.config, gain.name, 1.25 * value))
    other = make_engine(mode, **{gain.name: value for gain, value in gains_of(engine.config).items()})
    for _ in range(60):
        engine.advance()
        other.advance()
    np.testing.assert_array_equal(engine.stylus, other.stylus)
    np.testing.assert_array_equal(engine.logs[0].force, other.logs[0].force)


@pytest.mark.parametrize(("gain", "value"), [("damping", 20.0), ("stiffness", 600.0)])
def test_bendable_curve_keeps_its_timing_if_a_gain_changes(gain, value):
    engine, same = make_engine("stretch-then-follow"), make_engine("stretch-then-follow")
    other = make_engine("stretch-then-follow", **{gain: value})
    record = engine.tubes.record_at(TRACE_SIZE)
    assert len(other.memory) != len(engine.memory) or np.any(other.memory[record:] != engine.memory[record:])
    engine.set_gains(with_gain(engine.config, gain, value))
    np.testing.assert_array_equal(engine.memory[record:], same.memory[record:])
    np.testing.assert_array_equal(engine.memory[:record], other.memory[:record])
    assert np.any(engine.memory[:record] != same.memory[:record])
    for one in (engine, same):
        one.perform(True)
        run(one, 1.0)
    assert engine.tubes.edited(engine.memory).duration == same.tubes.edited(same.memory).duration
    assert np.any(engine.stylus != same.stylus)


def test_gains_are_kept_at_the_return_to_the_beginning():
    engine, other = make_engine("stretch-then-follow"), make_engine("stretch-then-follow", stiffness=600.0)
    record = engine.tubes.record_at(TRACE_SIZE)
    engine.set_gains(with_gain(engine.config, "stiffness", 600.0))
    run(engine, 0.4)
    engine.reset()
    np.testing.assert_array_equal(engine.memory[:record], other.memory[:record])


def test_gains_of_another_mode_are_refused():
    engine = make_engine()
    with pytest.raises(ParameterError, match="same mode and map"):
        engine.set_gains(run_config(mode="bunny", figure="kinematic"))


@pytest.mark.slow
def test_run_from_a_stored_state_is_repeated_exactly():
    engine = Engine(wire(run_config(mode="stretch", seconds=3600.0)))
    run(engine, 2.4)
    assert engine.back_to(1.9) <= 1.9
    run(engine, 0.8)
    first = engine.session.servo.plant.qpos.copy(), engine.memory.copy(), engine.time
    engine.drag = Drag(engine.stylus + 0.01)
    run(engine, 0.4)
    engine.back_to(1.9)
    run(engine, 0.8)
    np.testing.assert_array_equal(engine.session.servo.plant.qpos, first[0])
    np.testing.assert_array_equal(engine.memory, first[1])
    assert engine.time == first[2]
    engine.reset()
    assert engine.time == 0.0


def test_field_slice_does_not_change_the_state():
    engine, same = make_engine("stretch"), make_engine("stretch")
    for _ in range(40):
        engine.advance()
        same.advance()
        points = slice_points(0.0)
        forces, hand = np.full_like(points, np.nan), engine.session.servo.device.hand.copy()
        hand[8:11] = 0.0
        field_slice(engine.field, hand, points, forces)
        assert np.all(np.isfinite(forces))
    np.testing.assert_array_equal(engine.memory, same.memory)
    # A hand at rest is drawn to the curve; on the circle's axis, all ways are as far.
    curve = engine.session.curve.point(np.linspace(0.0, 4.0, 200))
    nearest = curve[np.argmin(np.linalg.norm(points[:, None] - curve[None], axis=2), axis=1)]
    off = np.linalg.norm(points[:, :2], axis=1) > 1e-3
    assert np.all(np.sum((nearest - points) * forces, axis=1)[off] > 0.0)


def test_take_is_a_recording_whose_animation_loads(tmp_path):
    engine = make_engine("stretch")
    run(engine, 0.4)
    take = Take(tmp_path / "take", engine)
    engine.drag = Drag(engine.stylus + np.array([0.0, 0.0, 0.015]), pressed=True)
    for _ in range(100):
        take.add(engine.advance(), engine)
    engine.drag = None
    lines = take.end(engine)
    assert any("bent once" in line for line in lines) or engine.bends() == 0
    with Recording(tmp_path / "take" / RECORDING) as recording:
        assert recording.complete
        t = recording.channel("ticks", "t")[:]
        np.testing.assert_allclose(t, 1e-3 * np.arange(800), atol=1e-12)
        assert np.linalg.norm(recording.channel("ticks", "user")[-1]) > 0.5
    clip = load(tmp_path / "take" / EDITED).clip
    assert clip.duration == pytest.approx(0.8, abs=0.05)
    with pytest.raises(SimError, match="dragged by hand"):
        reproduce(tmp_path / "take")
    with pytest.raises(SimError, match="holds a run"):
        Take(tmp_path / "take", engine)


@pytest.mark.parametrize(
    ("mode", "pressed", "performs", "pushes"),
    [
        ("follow", False, False, 1),
        ("follow", True, False, 1),  # the switch does nothing there
        ("stretch", False, False, 1),
        ("stretch", True, False, 0),
        ("stretch-then-follow", True, True, 1),
        ("lead", False, False, 0),
    ],
)
def test_drag_without_bend_or_lead_is_reported_as_one_push(tmp_path, mode, pressed, performs, pushes):
    engine = make_engine(mode)
    run(engine, 0.8)
    engine.perform(performs)
    take = Take(tmp_path / "take", engine)
    for block in range(160):
        if block == 40:
            engine.drag = Drag(engine.stylus + np.array([0.0, 0.0, 0.015]), pressed)
        elif block == 110:
            engine.drag = None
        take.add(engine.advance(), engine)
    lines = take.end(engine)
    summary = json.loads((tmp_path / "take" / SUMMARY).read_text())
    assert summary["remarks"] == list(engine.session.remarks)
    reported = summary["path"]["pushes"]
    assert len(reported) == pushes
    for push in reported:
        assert push["start"] == pytest.approx(0.32, abs=1e-9)
        assert push["seconds"] == pytest.approx(0.56, abs=0.002)
        assert push["peak_force"] > 1.0
        assert push["deviation_mm"] > 1.0
        assert f"{push['peak_force']:.1f} N at 0.3 s" in " ".join(lines)
        assert "The hand did not push." not in lines


def test_take_of_a_led_figure_has_the_measures_of_leading(tmp_path):
    engine = make_engine("lead")
    run(engine, 0.4)
    engine.drag = Drag(engine.stylus + np.array([0.02, -0.02, 0.0]))
    run(engine, 1.0)
    walker = walker_at.py_func(engine.session.servo.field.walkers.state, 0)
    before = float(walker.argument[0])
    take = Take(tmp_path / "take", engine)
    for _ in range(160):
        take.add(engine.advance(), engine)
    lines = take.end(engine)
    length = json.loads((tmp_path / "take" / SUMMARY).read_text())["lead"]["length_m"]
    assert 0.05 < length == pytest.approx(float(walker.argument[0]) - before, abs=0.01)
    assert any(line.startswith("The figure was led") for line in lines)
    assert not any("laps" in line for line in lines)


def test_too_short_take_is_refused(tmp_path):
    engine = make_engine()
    take = Take(tmp_path / "take", engine)
    take.add(engine.advance(), engine)
    with pytest.raises(SimError, match=r"a take of 0\.01 s is not kept"):
        take.end(engine)
    assert not (tmp_path / "take").exists()


def test_full_disk_ends_the_take_and_not_the_session(tmp_path, monkeypatch):
    engine, answers = make_engine(), queue.Queue[Any]()
    boards = [Board(fields) for fields in (SHOWN, HELD)]
    loop: Any = engine_process._EngineLoop(*boards, queue.Queue(), answers)
    monkeypatch.setattr(loop, "_send_picture", lambda: None)
    usage = shutil.disk_usage(tmp_path)
    for name, free in (("first", 0), ("second", usage.free)):
        monkeypatch.setattr(shutil, "disk_usage", lambda path, free=free: usage._replace(free=free))
        loop._execute_on_engine(Record(tmp_path / name), engine)
        for _ in range(80):
            loop._run_block(engine)
        loop._stop(engine)
    refused, *_, saved = [answers.get() for _ in range(answers.qsize())]
    assert "the disk is full (0 MB free); what was recorded until then is kept" in refused.text
    assert saved.folder == tmp_path / "second"
    assert not has_writer(tmp_path / "first" / RECORDING)
    for board in boards:
        board.close()


def test_take_during_pause_leaves_no_folder(tmp_path):
    engine = make_engine()
    take = Take(tmp_path / "take", engine)
    with pytest.raises(SimError, match="time was paused"):
        take.end(engine)
    assert not (tmp_path / "take").exists()


def test_slider_ranges_contain_the_gains():
    for mode in ("follow", "bunny", "stretch", "stretch-then-follow", "lead"):
        config = run_config(mode=mode)
        for gain, value in gains_of(config).items():
            assert gain.least <= value <= gain.most
            assert getattr(with_gain(config, gain.name, gain.most).mode, gain.name) == gain.most
