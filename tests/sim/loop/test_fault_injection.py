"""Faults injected into readings and memories: the force is zero until the servo is rearmed."""

from collections.abc import Callable

import numpy as np
import pytest

from controllers.safety.energy_tank import TANK_ENERGY
from controllers.safety.faults import FAULT_GAPS, FAULT_LAST_GAP, Fault, latched
from sim.devices.device import read_device
from sim.devices.exchange import READING_CLOCK, READING_THETA
from sim.loop.channels import make_logs
from sim.loop.servo import run_block
from sim.world.encoders import SILENT_PERIODS
from tests.sim.bare_servos import bare_servo, device_world, pass_period, simulated
from tests.sim.loop.exchange_loop import FORCE_PRESENT, ExchangeLoop, assert_motors_off, assert_recovers_after_rearm


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("joint", range(6))
def test_angle_that_is_not_finite_switches_motors_off_in_that_tick(joint: int, bad: float) -> None:
    loop = ExchangeLoop()
    loop.run(300)
    assert loop.sizes[-1] > FORCE_PRESENT

    def tamper() -> None:
        loop.device.reading[READING_THETA + joint] = bad

    loop.run(1, tamper)
    loop.run(20)
    assert_motors_off(loop, 300)
    fault_found = latched(loop.device.faults)
    assert fault_found is not None
    assert fault_found.fault is Fault.READING_NOT_FINITE
    assert fault_found.t == pytest.approx(0.3)
    np.testing.assert_equal(fault_found.value, bad)
    assert_recovers_after_rearm(loop)


def test_simulated_angle_that_is_not_finite_switches_motors_off_in_that_tick() -> None:
    world = device_world()
    servo = bare_servo(world, simulated(world))
    ticks, frames = make_logs(servo, 300)
    run_block(servo, 0, 300, False, ticks, frames)
    world.data.qpos[servo.device.port.arm_q[1]] = np.nan
    after, frames = make_logs(servo, 20)
    run_block(servo, 300, 20, False, after, frames)
    assert np.linalg.norm(ticks.force[-1]) > FORCE_PRESENT
    assert not after.torque.any()
    assert not after.force.any()
    assert (after.fault[:, 0] == Fault.READING_NOT_FINITE).all()
    assert np.isfinite(after.hand).all()


@pytest.mark.parametrize("joint", range(3))
@pytest.mark.parametrize("jump", [0.3, -0.3, 0.13])
def test_encoder_jump_is_an_impossible_rate(joint: int, jump: float) -> None:
    loop = ExchangeLoop()
    loop.run(300)

    def tamper() -> None:
        loop.device.reading[READING_THETA + joint] += jump

    loop.run(30, tamper)
    assert_motors_off(loop, 300)
    fault_found = latched(loop.device.faults)
    assert fault_found is not None
    assert fault_found.fault is Fault.RATE_IMPOSSIBLE
    assert fault_found.value == pytest.approx(abs(jump) / 1e-3, rel=0.05)
    loop.run(1)
    assert_recovers_after_rearm(loop)


@pytest.mark.parametrize("silent", [SILENT_PERIODS, 40])
def test_readings_that_stop_are_stale_after_the_silent_periods(silent: int) -> None:
    """The driver's motors are off after the silent periods, too."""
    loop = ExchangeLoop(silent=silent)
    loop.run(300)
    last = loop.device.reading.copy()

    def tamper() -> None:
        loop.device.reading[:] = last

    loop.run(3000, tamper)
    assert_motors_off(loop, 300 + silent + 1)
    assert loop.fault[300 + silent - 2] == 0.0
    fault_found = latched(loop.device.faults)
    assert fault_found is not None
    assert fault_found.fault is Fault.READING_STALE
    assert not np.any(loop.applied[300 + silent + 1 :])


def freeze_encoders(loop: ExchangeLoop, ticks: int) -> np.ndarray:
    """Freeze the encoders while readings continue; returns the true joint angles."""
    angles = loop.device.reading[READING_THETA:].copy()
    port, positions = loop.driver.phantom.port, []

    def tamper() -> None:
        loop.device.reading[READING_THETA:] = angles
        positions.append(port.qpos[list(port.arm_q)].copy())

    loop.run(ticks, tamper)
    return np.array(positions)


def test_encoders_that_stand_under_a_force_are_frozen() -> None:
    loop = ExchangeLoop()
    loop.run(1000)
    freeze_encoders(loop, 3000)
    fault_found = latched(loop.device.faults)
    assert fault_found is not None
    assert fault_found.fault is Fault.ENCODERS_FROZEN
    since = round(fault_found.t / 1e-3)
    assert since <= 1000 + 510
    assert_motors_off(loop, since)


def test_frozen_encoders_of_the_simulated_linkage_are_detected() -> None:
    world = device_world()
    servo = bare_servo(world, simulated(world))
    ticks, frames = make_logs(servo, 1000)
    run_block(servo, 0, 1000, False, ticks, frames)
    port, codes, force = servo.device.port, [], []
    at = list(port.arm_q) + list(port.gimbal_q)
    stuck = port.qpos[at].copy()
    one, frames = make_logs(servo, 1)
    for k in range(1000, 4000):
        true = port.qpos[at].copy()
        port.qpos[at] = stuck
        read_device(servo.device, 1e-3 * k)
        port.qpos[at] = true
        run_block(servo, k, 1, False, one, frames)
        codes.append(one.fault[0, 0])
        force.append(np.linalg.norm(one.force[0]))
    first = int(np.argmax(codes))
    assert codes[first] == Fault.ENCODERS_FROZEN
    assert first <= 510
    assert not np.any(force[first:])


def test_servo_gap_is_counted_and_force_ramps_in_again() -> None:
    loop = ExchangeLoop()
    loop.run(300)
    before = loop.sizes[-1]
    held = []
    for _ in range(50):
        loop.driver.write()
        held.append(np.linalg.norm(loop.driver.torque))
    assert held[0] > 0.0
    assert not np.any(held[SILENT_PERIODS + 1 :])
    loop.run(300)
    assert not any(loop.fault)
    assert loop.device.faults[FAULT_GAPS] == 1.0
    assert loop.device.faults[FAULT_LAST_GAP] == pytest.approx(0.051)
    assert before > FORCE_PRESENT
    assert loop.sizes[300] == 0.0
    assert np.abs(np.diff(loop.sizes[300:])).max() < 0.3
    assert loop.sizes[-1] > FORCE_PRESENT


def test_servo_gap_on_the_simulated_linkage_is_counted_and_force_ramps_in_again() -> None:
    world = device_world()
    servo = bare_servo(world, simulated(world))
    ticks, frames = make_logs(servo, 400)
    run_block(servo, 0, 400, False, ticks, frames)
    device = servo.device
    applied, torque = np.zeros((servo.plant.substeps, 3)), []
    for k in range(50):
        pass_period(servo.plant, device.port, device.user, 1e-3 * (400 + k), applied)
        torque.append(np.abs(world.data.ctrl).max())
    assert torque[0] > 0.0
    assert not np.any(torque[SILENT_PERIODS + 1 :])
    run_block(servo, 450, 400, False, ticks, frames)
    sizes = np.linalg.norm(ticks.force, axis=1)
    assert (ticks.fault[:, 2] == 1.0).all()
    assert not ticks.fault[:, 0].any()
    assert sizes[0] == 0.0
    assert np.abs(np.diff(sizes)).max() < 0.3


@pytest.mark.parametrize("place", range(5))
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_limiter_memory_that_is_not_finite_is_a_fault(place: int, bad: float) -> None:
    loop = ExchangeLoop()
    loop.run(300)
    loop.servo.field.limiter[place] = bad
    loop.run(20)
    assert_motors_off(loop, 300)
    assert latched(loop.device.faults).fault is Fault.LIMITER_NOT_FINITE
    assert_recovers_after_rearm(loop)


@pytest.mark.parametrize("place", [0, 2, 3, 4, 5, 6, 7])
def test_tank_memory_that_is_not_finite_is_a_fault(place: int) -> None:
    loop = ExchangeLoop()
    loop.run(300)
    loop.servo.field.tank[place] = np.nan
    loop.run(20)
    assert_motors_off(loop, 300)
    assert latched(loop.device.faults).fault is Fault.TANK_NOT_FINITE
    assert loop.servo.field.tank[TANK_ENERGY] != 0.0
    assert_recovers_after_rearm(loop)


def random_fault(rng: np.random.Generator, loop: ExchangeLoop) -> tuple[str, Callable[[], None], int]:
    """A random fault: its name, the function that injects it, and within how many ticks it must be detected."""
    reading, field = loop.device.reading, loop.servo.field
    bad = float(rng.choice([np.nan, np.inf, -np.inf]))
    joint = int(rng.integers(3))
    jump = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.13, 3.0))
    last, angles = reading.copy(), reading[READING_THETA:].copy()

    def overwrite(array: np.ndarray, place: int, value: float) -> Callable[[], None]:
        def tamper() -> None:
            array[place] = value

        return tamper

    def jumped() -> None:
        reading[READING_THETA + joint] += jump

    def stale() -> None:
        reading[:] = last

    def stood() -> None:
        reading[READING_THETA:] = angles

    kinds: dict[str, tuple[Callable[[], None], int]] = {
        "angle": (overwrite(reading, READING_THETA + int(rng.integers(6)), bad), 0),
        "clock": (overwrite(reading, READING_CLOCK, bad), 0),
        "jump": (jumped, 0),
        "stale": (stale, SILENT_PERIODS + 1),
        "frozen": (stood, 510),
        "limiter": (overwrite(field.limiter, int(rng.integers(5)), bad), 0),
        "tank": (overwrite(field.tank, int(rng.choice([0, *range(2, 8)])), float("nan")), 0),
        "law": (overwrite(field.params, int(rng.integers(len(field.params))), float("nan")), 0),
    }
    name = str(rng.choice(list(kinds), p=[0.18, 0.1, 0.18, 0.16, 0.02, 0.14, 0.12, 0.1]))
    return name, *kinds[name]


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(2, 6))])
def test_random_fault_zeroes_the_force_in_the_tick_of_its_detection(seed: int) -> None:
    rng, seen = np.random.default_rng(seed), []
    for _ in range(25):
        loop = ExchangeLoop(damping=float(rng.uniform(2.0, 6.0)))
        loop.run(int(rng.integers(260, 320)))
        name, tamper, wait = random_fault(rng, loop)
        begin = loop.tick
        for _ in range(wait + 3 + int(rng.integers(10))):
            loop.run(1, tamper)
        loop.run(20)
        if not any(loop.fault):
            # A parameter that the law does not read here has no effect.
            assert name == "law"
            assert np.isfinite(loop.force).all()
            continue
        fault_found = int(np.flatnonzero(loop.fault)[0])
        assert begin <= fault_found <= begin + wait, name
        assert_motors_off(loop, fault_found)
        seen.append(name)
    assert len(seen) >= 20
