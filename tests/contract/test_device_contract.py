"""The contract between every device and the servo loop."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from controllers.safety.faults import FAULT_CODE, Fault
from controllers.state import HandState
from sim.devices.device import read_device
from sim.devices.exchange import COMMAND_FAULT, COMMAND_TORQUE, Exchange, exchange
from sim.devices.replayed import recorded_hand, replayed_hand
from sim.errors import SimError
from sim.loop.channels import groups, record_into, tick_channels
from sim.loop.loop import Loop
from sim.loop.servo import Servo, rearm_servo
from sim.recording.recorder import Recorder
from sim.recording.recording import Recording
from sim.users.hand.actions import Push
from sim.users.hand.arm import Arm
from sim.world.world import World
from tests.devices.drivers import KINDS, NODE_KINDS, make_rig
from tests.sim.bare_servos import CUTOFF, SimulatedDriver, bare_servo, device_world, follow_program, run, simulated

TICKS = 400
ARM = Arm(pushes=(Push(0.05, 0.2, 1.5, (0.0, 0.0, 1.0)),))


class ServoUnderTest(NamedTuple):
    """A servo with a device, and the hook that has to be called before each of its ticks."""

    servo: Servo
    world: World
    before_tick: Callable[[int], None] | None = None

    def ticks(self, n: int) -> dict[str, np.ndarray]:
        blocks = []

        def append_block(ticks, frames, m):
            blocks.append({name: channel.copy() for name, channel in tick_channels(ticks, m).items()})

        Loop(self.servo, self.world, append_block, before_tick=self.before_tick).run(n * self.servo.plant.period)
        return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}


@pytest.fixture(scope="module")
def hand_rows() -> np.ndarray:
    world = device_world()
    ticks, _ = run(bare_servo(world, simulated(world, ARM)), TICKS)
    return ticks.hand


def exchange_hook(device: Exchange) -> Callable[[int], None]:
    driver = SimulatedDriver(device, ARM)

    def before_tick(tick: int) -> None:
        if tick > 0:
            driver.write()
        driver.read()

    return before_tick


@pytest.fixture(params=["simulated", "replayed", "exchange", *KINDS, *NODE_KINDS])
def make_subject(
    request: pytest.FixtureRequest, hand_rows: np.ndarray, tmp_path: Path
) -> Callable[..., ServoUnderTest]:
    def build(**parts) -> ServoUnderTest:
        world = device_world()
        if request.param == "simulated":
            return ServoUnderTest(bare_servo(world, simulated(world, ARM), **parts), world)
        if request.param == "replayed":
            return ServoUnderTest(bare_servo(world, replayed_hand(hand_rows, world), **parts), world)
        device = exchange(world, CUTOFF)
        if request.param == "exchange":
            return ServoUnderTest(bare_servo(world, device, **parts), world, exchange_hook(device))
        rig = make_rig(request.param, device, ARM, tmp_path)
        request.addfinalizer(rig.driver.close)
        return ServoUnderTest(bare_servo(world, device, **parts), world, rig)

    return build


def test_time_starts_at_zero_and_advances_by_the_period(make_subject) -> None:
    np.testing.assert_allclose(make_subject().ticks(6)["t"], np.arange(6) * 1e-3, atol=1e-12)


def test_hand_state_is_finite_with_unit_quaternion(make_subject) -> None:
    ticks = make_subject().ticks(TICKS)
    assert all(np.isfinite(channel).all() for channel in ticks.values())
    np.testing.assert_allclose(np.linalg.norm(ticks["quaternion"], axis=1), 1.0, atol=1e-9)
    assert not ticks["fault"].any()
    assert not ticks["gaps"].any()


def test_reading_twice_in_one_tick_returns_the_same_state(make_subject) -> None:
    subject = make_subject()
    subject.ticks(20)
    if subject.before_tick is not None:
        subject.before_tick(20)
    device = subject.servo.device
    read_device(device, 0.02)
    first = HandState.of(device.hand).vector()
    read_device(device, 0.02)
    np.testing.assert_array_equal(first, HandState.of(device.hand).vector())


def test_velocity_is_the_rate_of_position(make_subject) -> None:
    """The velocity filter lags by a few milliseconds; over 0.3 s its integral has to equal the distance covered."""
    ticks = make_subject().ticks(TICKS)
    covered = ticks["p"][-1] - ticks["p"][100]
    integrated = np.sum(ticks["v"][100:-1], axis=0) * 1e-3
    assert np.linalg.norm(covered) > 5e-3
    np.testing.assert_allclose(integrated, covered, atol=0.1 * np.linalg.norm(covered))


def test_force_that_is_not_finite_is_latched_and_never_reaches_the_motors(make_subject) -> None:
    program = follow_program()
    subject = make_subject(program=program)
    subject.ticks(10)
    program.params[:] = np.nan
    ticks = subject.ticks(10)
    assert not ticks["force"].any()
    assert not ticks["torque"].any()
    assert not ticks["ctrl"].any()
    assert (ticks["fault"] == Fault.FORCE_NOT_FINITE).all()


def test_motors_stay_off_until_rearmed_and_then_force_ramps_in(make_subject) -> None:
    subject = make_subject()
    subject.ticks(10)
    subject.servo.field.limiter[0] = np.nan
    ticks = subject.ticks(50)
    assert (ticks["fault"] == Fault.LIMITER_NOT_FINITE).all()
    assert not ticks["force"].any()
    assert not ticks["torque"].any()
    rearm_servo(subject.servo)
    replayed = subject.ticks(200)
    assert not replayed["fault"].any()
    size = np.linalg.norm(replayed["force"], axis=1)
    assert size[-1] > 0.02
    assert np.abs(np.diff(size)).max() < 0.2


def test_repeated_runs_are_identical(make_subject) -> None:
    first, second = make_subject().ticks(TICKS), make_subject().ticks(TICKS)
    for name, channel in first.items():
        np.testing.assert_array_equal(channel, second[name], err_msg=name)


def test_recording_replays_to_the_same_positions(make_subject, tmp_path: Path) -> None:
    subject = make_subject()
    with Recorder(tmp_path / "run.h5", {}, 1, groups(subject.servo, subject.world), {}) as recorder:
        loop = Loop(
            subject.servo,
            subject.world,
            record_into(recorder, subject.servo, subject.world),
            before_tick=subject.before_tick,
        )
        loop.run(0.2)
    with Recording(tmp_path / "run.h5") as recording:
        world = device_world()
        device = replayed_hand(recorded_hand(recording), world, 1.0 / recording.rates["ticks"])
        replayed = ServoUnderTest(bare_servo(world, device), world).ticks(200)
        np.testing.assert_array_equal(replayed["p"], recording.channel("ticks", "p")[:])


def test_displayed_linkage_tip_is_at_the_hand_position(make_subject) -> None:
    subject = make_subject()
    subject.ticks(100)
    tip = subject.world.data.site("phantom/tip").xpos - subject.world.data.body("phantom/base").xpos
    np.testing.assert_allclose(tip, subject.servo.device.hand[1:4], atol=5e-4)


def test_replay_shorter_than_the_run_is_refused_before_it_starts(hand_rows) -> None:
    world = device_world()
    subject = ServoUnderTest(bare_servo(world, replayed_hand(hand_rows, world)), world)
    with pytest.raises(SimError, match=f"ends after {TICKS} ticks .* ask for 0.4 s or less"):
        subject.ticks(TICKS + 2)
    subject.ticks(TICKS)


def test_replay_past_its_end_is_a_fault_and_holds_the_last_position(hand_rows) -> None:
    world = device_world()
    servo = bare_servo(world, replayed_hand(hand_rows, world))
    ticks, _ = run(servo, TICKS + 5)
    np.testing.assert_array_equal(ticks.hand[-5:, 1:], np.tile(hand_rows[-1, 1:], (5, 1)))
    np.testing.assert_array_equal(ticks.fault[-6:, 0], [0.0, *[Fault.READINGS_ENDED] * 5])
    assert servo.device.faults[FAULT_CODE] == Fault.READINGS_ENDED


@pytest.mark.parametrize(
    ("bad", "message"),
    [(np.zeros((0, 15)), r"shape \(0, 15\)"), (np.zeros((3, 14)), r"shape \(3, 14\)"),
     (np.array([[0.0] * 15, [np.nan] * 15]), "not finite in row 1")],
)  # fmt: skip
def test_replay_rows_of_wrong_shape_or_not_finite_are_refused(bad, message) -> None:
    with pytest.raises(SimError, match=message):
        replayed_hand(bad, device_world())


def test_replay_at_another_rate_is_refused(hand_rows) -> None:
    with pytest.raises(SimError, match=r"every 0\.002 s"):
        replayed_hand(hand_rows, device_world(), 2e-3)


def test_exchange_answers_each_reading_with_torque_and_fault() -> None:
    world = device_world()
    device = exchange(world, CUTOFF)
    subject = ServoUnderTest(bare_servo(world, device), world, exchange_hook(device))
    subject.ticks(20)
    assert device.command[0] == device.reading[0] == 20.0
    np.testing.assert_array_equal(device.command[COMMAND_TORQUE : COMMAND_TORQUE + 3], device.torque)
    subject.servo.field.limiter[0] = np.inf
    subject.ticks(2)
    assert device.command[COMMAND_FAULT] == Fault.LIMITER_NOT_FINITE
    assert not device.command[COMMAND_TORQUE : COMMAND_TORQUE + 3].any()
