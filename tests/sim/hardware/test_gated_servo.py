"""A servo behind a gate: equal to the simulation without faults, motors off within two ticks after a fault."""

import numpy as np
import pytest

from controllers.safety.arming import ARM, CLEAR, DISARM, State
from controllers.safety.faults import FAULT_RAMP, Fault
from controllers.safety.oscillation import OscillationDetector
from sim.errors import SimError
from sim.hardware.emulated import EmulatedPhantom
from sim.hardware.gated_servo import GatedServo, Ticker, columns
from sim.world.linkage import Linkage
from tests.sim.bare_servos import bare_servo, device_world, follow_program, simulated
from tests.sim.bare_servos import run as run_bare
from tests.sim.hardware.emulation import (
    DRIVER_FAULTS,
    PERIOD,
    READING_INDICES,
    UNRAMPED_GATE,
    FaultyDriver,
    activate,
    clock_back,
    gated_servo,
    jump_joint,
    overwrite,
    run,
)


@pytest.mark.slow
def test_follow_through_a_driver_matches_simulation_within_1_mm() -> None:
    world = device_world()
    servo = bare_servo(world, simulated(world))
    servo.device.faults[FAULT_RAMP] = 0.0
    simulated_ticks, _ = run_bare(servo, 6000)
    driven = run(Ticker(gated_servo(**UNRAMPED_GATE)), 6000, request=ARM)
    assert not driven["fault"].any()
    apart = np.linalg.norm(driven["p"] - simulated_ticks.hand[:, 1:4], axis=1)
    travelled = np.linalg.norm(np.diff(simulated_ticks.hand[:, 1:4], axis=0), axis=1).sum()
    assert travelled > 0.3
    assert np.sqrt(np.mean(apart**2)) < 1e-3


def test_force_ramps_in_from_arming_to_active_and_guides_a_released_stylus() -> None:
    ticker = Ticker(gated_servo(holds=1.5, small=5.0))
    rows = run(ticker, 4000, request=ARM)
    assert not rows["fault"].any()
    states = rows["state"].ravel()
    changes = states[np.insert(np.diff(states) != 0, 0, True)]
    np.testing.assert_array_equal(changes, [State.ARMING, State.RAMPING, State.ACTIVE])
    arming = states == State.ARMING
    assert not rows["force"][arming].any()
    assert not rows["torque"][arming].any()
    size = np.linalg.norm(rows["force"], axis=1)
    assert np.diff(size[:1000]).max() < 0.1
    assert rows["distance"][-500:].max() < 3e-3


def test_disarmed_motors_are_off() -> None:
    rows = run(Ticker(gated_servo(holds=1.0)), 100)
    assert not rows["torque"].any()
    assert not rows["state"].any()


def test_disarming_switches_off_in_the_same_tick() -> None:
    ticker = Ticker(gated_servo(**UNRAMPED_GATE))
    first = activate(ticker)
    assert columns(ticker.row[None])["torque"].any()
    rows = run(ticker, 20, first, DISARM)
    assert not rows["torque"].any()


@pytest.mark.parametrize("index", READING_INDICES)
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_reading_that_is_not_finite_is_a_fault(index: int, bad: float) -> None:
    assert_fault_releases("tamper", overwrite(index, bad), Fault.READING_NOT_FINITE)


@pytest.mark.parametrize("axis", range(3))
def test_joint_jump_is_a_fault(axis: int) -> None:
    assert_fault_releases("tamper", jump_joint(axis), Fault.RATE_IMPOSSIBLE)


def test_clock_that_goes_back_is_a_fault() -> None:
    assert_fault_releases("tamper", clock_back, Fault.CLOCK_BACK)


@pytest.mark.parametrize(("fault", "value"), DRIVER_FAULTS, ids=lambda x: getattr(x, "name", ""))
@pytest.mark.parametrize("operation", ["read_fault", "write_fault"])
def test_driver_fault_is_latched(fault: Fault, value: float, operation: str) -> None:
    assert_fault_releases(operation, (fault, value), fault)


def test_message_of_the_device_on_its_fault_is_kept_until_it_is_cleared() -> None:
    driver = gated_servo(**UNRAMPED_GATE).driver
    assert isinstance(driver, EmulatedPhantom)
    faulty = FaultyDriver(driver)
    ticker = Ticker(gated_servo(faulty, **UNRAMPED_GATE))
    faulty.read_fault = Fault.DEVICE_REPORTED, 0.0, "mine.py:3: ValueError: bad"
    run(ticker, 2)
    faulty.read_fault = Fault.DEVICE_REPORTED, 0.0, "mine.py:4: ValueError: worse"
    run(ticker, 2, 2)
    assert ticker.detail == "mine.py:3: ValueError: bad"
    faulty.read_fault = None
    run(ticker, 2, 4, CLEAR)
    assert ticker.detail == ""


@pytest.mark.parametrize("periods", [5, 50, 500])
def test_stall_of_five_periods_or_more_is_a_fault(periods: int) -> None:
    assert_fault_releases("silent", periods, Fault.READING_STALE, within=8)


@pytest.mark.parametrize("periods", [1, 3, 4])
def test_stall_of_less_than_five_periods_is_no_fault(periods: int) -> None:
    faulty = FaultyDriver(gated_servo(**UNRAMPED_GATE).driver)
    ticker = Ticker(gated_servo(faulty, **UNRAMPED_GATE))
    first = activate(ticker)
    faulty.silent = periods
    rows = run(ticker, 100, first)
    assert not rows["fault"].any()
    assert rows["force"][-1].any()


@pytest.mark.parametrize("part", ["limiter", "tank", "params"])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_memory_or_parameters_that_are_not_finite_are_a_fault(part: str, bad: float) -> None:
    faults = {"limiter": Fault.LIMITER_NOT_FINITE, "tank": Fault.TANK_NOT_FINITE, "params": Fault.FORCE_NOT_FINITE}
    parts = gated_servo(program=follow_program(), **UNRAMPED_GATE)
    ticker = Ticker(parts)
    first = activate(ticker)
    getattr(parts.servo.field, part)[0 if part != "params" else slice(None)] = bad
    assert_faulted(ticker, first, faults[part])


def assert_fault_releases(attribute: str, failure, fault: Fault, within: int = 2) -> None:
    """A fault of the driver switches the motors off within some ticks and stays latched until it is cleared."""
    driver = gated_servo(**UNRAMPED_GATE).driver
    assert isinstance(driver, EmulatedPhantom)
    faulty = FaultyDriver(driver)
    ticker = Ticker(gated_servo(faulty, **UNRAMPED_GATE))
    first = activate(ticker)
    assert ticker.state is State.ACTIVE
    setattr(faulty, attribute, failure)
    assert_faulted(ticker, first, fault, within)
    assert not faulty.last.any() or attribute == "write_fault"
    assert faulty.let_go_calls > 0
    if attribute in ("read_fault", "write_fault"):
        setattr(faulty, attribute, None)
    faulty.tamper, faulty.silent = (lambda reading: None), 0
    rows = run(ticker, 30, first + 30, ARM)
    assert not rows["torque"].any()
    assert ticker.fault is not None
    run(ticker, 2, first + 60, CLEAR)
    assert ticker.state is State.DISARMED
    rows = run(ticker, 400, first + 62, ARM)
    assert not rows["fault"].any()
    assert rows["force"][-1].any()


def assert_faulted(ticker: Ticker, first: int, fault: Fault, within: int = 2) -> None:
    rows = run(ticker, 30, first)
    assert ticker.fault is not None
    assert ticker.fault.fault is fault
    seen = int(np.argmax(rows["fault"].ravel() > 0))
    assert seen < within
    assert not rows["torque"][seen + 1 :].any()
    assert not rows["force"][seen + 1 :].any()
    assert (rows["state"][seen + 1 :] == State.FAULT).all()
    assert all(np.isfinite(rows[name]).all() for name in ("force", "torque", "p", "v"))


def test_encoder_offsets_are_subtracted_once_also_without_new_readings() -> None:
    offset = (0.01, -0.02, 0.005)
    parts = gated_servo(linkage=Linkage(offset=offset), **UNRAMPED_GATE)
    ticker = Ticker(GatedServo(*parts[:4], np.array(offset)))
    plain = Ticker(gated_servo(**UNRAMPED_GATE))
    a, b = run(ticker, 300, request=ARM), run(plain, 300, request=ARM)
    np.testing.assert_allclose(a["theta"], b["theta"], atol=3e-4)
    faulty = FaultyDriver(parts.driver)
    again = Ticker(GatedServo(parts.servo, parts.world, faulty, parts.gate, np.array(offset)))
    run(again, 2)
    before = again.row.copy()
    faulty.silent = 3
    run(again, 3, 2)
    np.testing.assert_array_equal(columns(before[None])["theta"], columns(again.row[None])["theta"])


@pytest.mark.parametrize(("stiffness", "damping"), [(12000.0, 0.5), (6000.0, 1.0)])
@pytest.mark.slow
def test_unstable_loop_is_damped_by_the_detector_and_still_guides(stiffness: float, damping: float) -> None:
    """Far beyond the certificate's boundary: without the detector the loop shakes the hand until it is too fast."""
    program = follow_program(stiffness, damping)
    bare = Ticker(gated_servo(program=program, holds=2.0, small=10.0, dead_man=False,
                              oscillation=OscillationDetector(PERIOD, turns=1e9)))  # fmt: skip
    loud = run(bare, 4000, request=ARM)
    ticker = Ticker(gated_servo(program=program, holds=2.0, small=10.0, dead_man=False))
    rows = run(ticker, 5000, request=ARM)
    assert bare.fault is not None or np.linalg.norm(loud["v"][-500:], axis=1).max() > 0.5
    assert ticker.fault is None
    assert rows["gain"].min() < 0.5
    assert np.linalg.norm(rows["force"][-1000:], axis=1).max() < 1.0
    assert rows["distance"][-1000:].max() < 5e-3


def test_servo_without_exchange_is_refused() -> None:
    world = device_world()
    parts = gated_servo()._replace(servo=bare_servo(world, simulated(world)))
    with pytest.raises(SimError, match="expected an Exchange"):
        Ticker(parts)


def test_invalid_linkage_is_refused() -> None:
    with pytest.raises(SimError, match="must not be negative"):
        Linkage(coulomb=(-1.0, 0.0, 0.0))
    with pytest.raises(SimError, match="rotors have to give"):
        Linkage(inertia=(-1.0, 0.0, 0.0))
