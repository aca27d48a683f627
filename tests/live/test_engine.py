"""A servo in somebody's hand: dragged, bent, tuned, put back, recorded."""

import json

import numpy as np
import pytest

from controllers.errors import ParameterError
from controllers.fields.algebra.law import TRACE_SIZE
from experiments.config.words import run_config
from experiments.live.session.engine import STRONGEST, Drag, Engine
from experiments.live.session.engine_process import slice_points
from experiments.live.session.gains import gains_of, with_gain
from experiments.live.session.takes import Take
from experiments.results.folder import EDITED, RECORDING, SUMMARY
from experiments.runs.reproduce import reproduce
from experiments.setups.wiring import wire
from models.mocap.library import load
from sim.errors import SimError
from sim.loop.field_slice import field_slice
from sim.recording.recording import Recording


def engine(mode: str = "follow", **words: object) -> Engine:
    return Engine(wire(run_config(mode=mode, figure="kinematic", seconds=3600.0, **words)))


def run(it: Engine, seconds: float) -> None:
    for _ in range(round(seconds / it.seconds)):
        it.advance()


def test_drag_force_is_stiffness_times_lag():
    it = engine()
    run(it, 0.8)
    relaxed = it.session.servo.reference.pose.copy()
    target = it.stylus + np.array([0.0, 0.0, 0.02])
    it.drag = Drag(target)
    run(it, 1.0)
    lag = target - it.stylus
    user = it.logs[0].user[-1]
    assert np.linalg.norm(user) > 1.0
    np.testing.assert_allclose(user, 300.0 * lag, atol=0.15)  # k times the lag, but for tremor and damping
    assert np.abs(it.session.servo.reference.pose - relaxed).max() > 0.01
    it.drag = None
    it.advance()
    assert np.all(it.logs[0].user[-1] == 0.0)


def test_long_hold_is_not_an_encoder_fault():
    it = engine()
    run(it, 0.4)
    it.drag = Drag(it.stylus + np.array([0.0, 0.0, 0.015]))
    run(it, 3.0)
    assert it.session.servo.device.faults[0] == 0.0
    assert np.linalg.norm(it.logs[0].force[-1]) > 0.5


def test_drag_force_is_bounded():
    it = engine()
    it.drag = Drag(np.array([0.0, 0.0, 0.12]))  # 36 N of the arm's spring away
    strongest = 0.0
    for _ in range(60):
        it.advance()
        strongest = max(strongest, float(np.linalg.norm(it.logs[0].user, axis=1).max()))
    # The spring is bounded at every block, and so is the speed at which the damper takes the stylus along.
    assert STRONGEST / 2.0 < strongest < 1.5 * STRONGEST


def test_bend_undo_and_redo_restore_the_curve():
    it = engine("stretch")
    run(it, 0.4)
    before = it.tubes.edited(it.memory).point(np.linspace(0.0, 4.0, 41))
    it.drag = Drag(it.stylus + np.array([0.0, 0.0, 0.02]), pressed=True)
    run(it, 0.6)
    it.drag = None
    run(it, 0.1)
    bent = it.tubes.edited(it.memory).point(np.linspace(0.0, 4.0, 41))
    assert it.bends() == 1
    assert np.abs(bent - before)[:, 2].max() > 0.005
    assert it.undo()
    np.testing.assert_array_equal(it.tubes.edited(it.memory).point(np.linspace(0.0, 4.0, 41)), before)
    assert not it.undo()
    assert it.redo()
    np.testing.assert_array_equal(it.tubes.edited(it.memory).point(np.linspace(0.0, 4.0, 41)), bent)


def test_bent_curve_is_performed_only_on_request():
    it = engine("stretch-then-follow")
    run(it, 0.8)
    start = it.stylus.copy()
    run(it, 0.8)
    assert np.linalg.norm(it.stylus - start) < 2e-3  # it is sought, nothing leads along it
    it.perform(True)
    run(it, 2.0)
    assert it.performs
    assert np.linalg.norm(it.stylus - start) > 0.02
    it.perform(False)
    run(it, 0.5)
    start = it.stylus.copy()
    run(it, 0.5)
    assert np.linalg.norm(it.stylus - start) < 2e-3


@pytest.mark.parametrize("mode", ["follow", "bunny", "stretch", "stretch-then-follow", "lead"])
def test_changed_gains_equal_those_of_a_fresh_run(mode):
    it = engine(mode)
    for gain, value in gains_of(it.config).items():
        # What paces a curve that can be bent: of the test below.
        if mode != "stretch-then-follow" or gain.name not in ("damping", "stiffness"):
            it.set_gains(with_gain(it.config, gain.name, 1.25 * value))
    other = engine(mode, **{gain.name: value for gain, value in gains_of(it.config).items()})
    for _ in range(60):
        it.advance()
        other.advance()
    np.testing.assert_array_equal(it.stylus, other.stylus)
    np.testing.assert_array_equal(it.logs[0].force, other.logs[0].force)


@pytest.mark.parametrize(("gain", "value"), [("damping", 20.0), ("stiffness", 600.0)])
def test_bendable_curve_keeps_its_timing_if_a_gain_changes(gain, value):
    it, same = engine("stretch-then-follow"), engine("stretch-then-follow")
    other = engine("stretch-then-follow", **{gain: value})
    record = it.tubes.record_at(TRACE_SIZE)
    assert len(other.memory) != len(it.memory) or np.any(other.memory[record:] != it.memory[record:])
    it.set_gains(with_gain(it.config, gain, value))
    np.testing.assert_array_equal(it.memory[record:], same.memory[record:])
    np.testing.assert_array_equal(it.memory[:record], other.memory[:record])
    assert np.any(it.memory[:record] != same.memory[:record])
    for one in (it, same):
        one.perform(True)
        run(one, 1.0)
    assert it.tubes.edited(it.memory).duration == same.tubes.edited(same.memory).duration
    assert np.any(it.stylus != same.stylus)


def test_gains_of_another_mode_are_refused():
    it = engine()
    with pytest.raises(ParameterError, match="same mode and map"):
        it.set_gains(run_config(mode="bunny", figure="kinematic"))


def test_run_from_a_stored_state_is_repeated_exactly():
    it = Engine(wire(run_config(mode="stretch", seconds=3600.0)))
    run(it, 2.4)
    assert it.back_to(1.9) <= 1.9
    run(it, 0.8)
    first = it.session.servo.plant.qpos.copy(), it.memory.copy(), it.time
    it.drag = Drag(it.stylus + 0.01)
    run(it, 0.4)
    it.back_to(1.9)
    run(it, 0.8)
    np.testing.assert_array_equal(it.session.servo.plant.qpos, first[0])
    np.testing.assert_array_equal(it.memory, first[1])
    assert it.time == first[2]
    it.reset()
    assert it.time == 0.0


def test_field_slice_does_not_change_the_state():
    it, same = engine("stretch"), engine("stretch")
    for _ in range(40):
        it.advance()
        same.advance()
        points = slice_points(0.0)
        forces, hand = np.full_like(points, np.nan), it.session.servo.device.hand.copy()
        hand[8:11] = 0.0
        field_slice(it.field, hand, points, forces)
        assert np.all(np.isfinite(forces))
    np.testing.assert_array_equal(it.memory, same.memory)
    # A hand at rest is drawn to the curve; on the circle's axis, all ways are as far.
    curve = it.session.curve.point(np.linspace(0.0, 4.0, 200))
    nearest = curve[np.argmin(np.linalg.norm(points[:, None] - curve[None], axis=2), axis=1)]
    off = np.linalg.norm(points[:, :2], axis=1) > 1e-3
    assert np.all(np.sum((nearest - points) * forces, axis=1)[off] > 0.0)


def test_take_is_a_recording_whose_animation_loads(tmp_path):
    it = engine("stretch")
    run(it, 0.4)
    take = Take(tmp_path / "take", it)
    it.drag = Drag(it.stylus + np.array([0.0, 0.0, 0.015]), pressed=True)
    for _ in range(100):
        take.add(it.advance(), it)
    it.drag = None
    lines = take.end(it)
    assert any("bent once" in line for line in lines) or it.bends() == 0
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
        Take(tmp_path / "take", it)


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
    it = engine(mode)
    run(it, 0.8)
    it.perform(performs)
    take = Take(tmp_path / "take", it)
    for block in range(160):
        if block == 40:
            it.drag = Drag(it.stylus + np.array([0.0, 0.0, 0.015]), pressed)
        elif block == 110:
            it.drag = None
        take.add(it.advance(), it)
    lines = take.end(it)
    reported = json.loads((tmp_path / "take" / SUMMARY).read_text())["path"]["pushes"]
    assert len(reported) == pushes
    for push in reported:
        assert push["start"] == pytest.approx(0.32, abs=1e-9)
        assert push["seconds"] == pytest.approx(0.56, abs=0.002)
        assert push["peak_force"] > 1.0
        assert push["deviation_mm"] > 1.0
        assert f"{push['peak_force']:.1f} N at 0.3 s" in " ".join(lines)
        assert "The hand did not push." not in lines


def test_too_short_take_is_refused(tmp_path):
    it = engine()
    take = Take(tmp_path / "take", it)
    take.add(it.advance(), it)
    with pytest.raises(SimError, match=r"0\.01 s is not measured"):
        take.end(it)


def test_take_during_pause_leaves_no_folder(tmp_path):
    it = engine()
    take = Take(tmp_path / "take", it)
    with pytest.raises(SimError, match="time stood still"):
        take.end(it)
    assert not (tmp_path / "take").exists()


def test_slider_ranges_contain_the_gains():
    for mode in ("follow", "bunny", "stretch", "stretch-then-follow", "lead"):
        config = run_config(mode=mode)
        for gain, value in gains_of(config).items():
            assert gain.least <= value <= gain.most
            assert getattr(with_gain(config, gain.name, gain.most).mode, gain.name) == gain.most
