"""The HID driver on the reference firmware: readings, commands, and measurements of the link."""

import numpy as np
import pytest

from controllers.safety.faults import Fault
from models.phantom.kinematics import ENCODER_STEP, GIMBAL_STEP
from models.phantom.parameters import PREMIUM_1_5
from sim.devices import hid_protocol as protocol
from sim.devices.driver import JITTER, LOST, READ, REFUSED, ROUND_TRIP, STALENESS, TEMPERATURE, DriverFault
from sim.devices.hid import HidPhantom
from sim.errors import SimError
from tests.devices.firmware import Firmware, FirmwareHandle, output_report
from tests.devices.follow import device_follow, gated_follow, rms, simulated_follow
from tests.devices.hand_made import Clock
from tests.devices.rig import FirmwareBackend, Linkage, LockStep, Rig

POSE = np.array([0.3, -0.2, 0.5, 0.1, -0.4, 1.2])


@pytest.fixture
def driver(handle: FirmwareHandle, clock: Clock) -> HidPhantom:
    return HidPhantom(handle, "in memory", clock)


def test_identity_is_read_from_the_device(driver: HidPhantom, firmware: Firmware) -> None:
    assert driver.identity == ("Reference", "in memory", "HVF-0001", "1.0", True, True, True, firmware.boot, False)


def test_joint_angles_are_read_to_half_an_encoder_count(
    driver: HidPhantom, handle: FirmwareHandle, firmware: Firmware
) -> None:
    firmware.turn_to(POSE)
    firmware.sensors.pressed = 1
    handle.tick()
    reading = np.zeros(9)
    assert driver.read(reading, 0.0)
    steps = np.array([*ENCODER_STEP, *[GIMBAL_STEP] * 3])
    assert np.all(np.abs(reading[3:] - POSE) <= 0.5001 * steps)
    np.testing.assert_array_equal(reading[:3], [1.0, 1e-3, 1.0])
    assert not driver.read(reading, 0.0)
    handle.tick()
    handle.tick()
    assert driver.read(reading, 0.0)
    np.testing.assert_array_equal(reading[:2], [3.0, 3e-3])  # the newest report


def test_joint_torques_reach_the_shafts_within_rounding(driver, handle, firmware) -> None:
    rng = np.random.default_rng(4)
    for _ in range(200):
        torque = rng.uniform(-1.0, 1.0, 3) * PREMIUM_1_5.peak_torque
        driver.write(torque, True)
        handle.tick()
        np.testing.assert_allclose(firmware.joint_torque, torque, atol=13.3e-6)
    driver.write(torque, False)
    handle.tick()
    assert not firmware.joint_torque.any()


def test_torque_is_limited_to_peak_and_not_finite_torque_switches_off(driver, handle, firmware) -> None:
    rng = np.random.default_rng(5)
    bad = [np.nan, np.inf, -np.inf, 1e300, -1e300, 1e9, 0.0]
    for _ in range(500):
        torque = np.where(rng.random(3) < 0.3, rng.choice(bad, 3), rng.normal(0.0, 5.0, 3))
        if np.all(np.isfinite(torque)):
            driver.write(torque, True)
        else:
            with pytest.raises(DriverFault) as refused:
                driver.write(torque, True)
            assert refused.value.fault is Fault.FORCE_NOT_FINITE
        handle.tick()
        assert np.all(np.abs(firmware.joint_torque) <= np.array(PREMIUM_1_5.peak_torque) * (1.0 + 1e-9))
        if not np.all(np.isfinite(torque)):
            assert not firmware.motors.on


def test_telemetry_measures_temperature_round_trip_loss_jitter_and_staleness(driver, handle, firmware, clock) -> None:
    reading, telemetry = np.zeros(9), driver.telemetry
    assert np.isnan(telemetry[ROUND_TRIP])
    for k in range(202):
        driver.write(np.zeros(3), True)
        clock.now += 0.4e-3
        handle.tick()
        if k % 20 == 19:
            handle.queue.clear()  # lost
        clock.now += 0.6e-3 + (0.3e-3 if k % 2 else 0.0)
        driver.read(reading, 0.0)
        clock.now -= 0.3e-3 if k % 2 else 0.0
    np.testing.assert_array_equal(telemetry[TEMPERATURE : TEMPERATURE + 3], [30.0, 31.0, np.nan])
    assert (telemetry[READ], telemetry[REFUSED], telemetry[LOST]) == (192.0, 0.0, 10.0)
    assert telemetry[ROUND_TRIP] == pytest.approx(0.3e-3, abs=1e-6)  # 1.3 ms, of which the device held it for 1 ms
    assert telemetry[JITTER] == pytest.approx(0.3e-3, rel=0.2)
    assert telemetry[STALENESS] == pytest.approx(0.3e-3, abs=1e-6)


def test_calibration_is_stored_in_the_device(driver, handle, firmware) -> None:
    firmware.turn_to(POSE)
    handle.tick()
    driver.calibrate(np.array([0.0, 0.1, -0.1]), np.zeros(3))
    handle.tick()
    reading = np.zeros(9)
    driver.read(reading, 0.0)
    np.testing.assert_allclose(reading[3:], [0.0, 0.1, -0.1, 0.0, 0.0, 0.0], atol=GIMBAL_STEP)
    reopened = HidPhantom(handle, "in memory")
    handle.tick()
    reopened.read(reading, 0.0)
    np.testing.assert_allclose(reading[3:], [0.0, 0.1, -0.1, 0.0, 0.0, 0.0], atol=GIMBAL_STEP)


def test_commands_are_accepted_from_the_first_reading_after_a_previous_session(handle, firmware, driver) -> None:
    """The firmware accepts no number twice; it reports the last one that an earlier program sent."""
    reading, torque = np.zeros(9), np.array([0.1, -0.1, 0.1])
    for _ in range(500):
        driver.write(torque, True)
        handle.tick()
        driver.read(reading, 0.0)
    for _ in range(20):
        handle.tick()  # the earlier program was killed, and the firmware switched off
    handle.queue.clear()
    reopened = HidPhantom(handle, "in memory")
    handle.tick()
    assert reopened.read(reading, 0.0)
    for _ in range(2):
        reopened.write(torque, True)
        handle.tick()
        assert reopened.read(reading, 0.0)
    np.testing.assert_allclose(firmware.joint_torque, torque, atol=13.3e-6)


@pytest.mark.parametrize("calibrated", [True, False])
def test_reset_device_continues_only_if_it_kept_its_zero(driver, handle, firmware, calibrated) -> None:
    reading = np.zeros(9)
    handle.tick()
    assert driver.read(reading, 0.0)
    firmware.power_up(calibrated)
    for _ in range(3):
        handle.tick()
        if handle.firmware.boot == driver.identity.power_up and calibrated:
            assert driver.read(reading, 0.0)
        else:
            with pytest.raises(DriverFault) as refused:
                driver.read(reading, 0.0)
            assert refused.value.fault is Fault.DEVICE_RESET
    assert driver.identity.calibrated == calibrated


def push_and_read(driver: HidPhantom, handle: FirmwareHandle, clock: Clock, ticks: int) -> None:
    """Command a torque and read, tick by tick."""
    for _ in range(ticks):
        driver.write(np.array([0.1, 0.0, 0.0]), True)
        clock.now += 1e-3
        handle.tick()
        driver.read(np.zeros(9), 0.0)


def test_commands_are_accepted_and_missed_ones_detected_where_numbers_wrap(handle, firmware, clock) -> None:
    for number in (2**31 - 1, 2**32 - 6):
        assert firmware.take(output_report(False, firmware.boot, number, 10_000, [0, 0, 0], 0))
    handle.tick()
    driver = HidPhantom(handle, "in memory", clock)
    driver.read(np.zeros(9), 0.0)
    push_and_read(driver, handle, clock, 40)
    assert firmware.motors.on
    assert driver.telemetry[ROUND_TRIP] == pytest.approx(0.0, abs=1e-9)  # the device held the report the whole time
    handle.write = lambda buff: len(buff)
    with pytest.raises(DriverFault) as lost:
        push_and_read(driver, handle, clock, 40)
    assert lost.value.fault is Fault.DEVICE_REPORTED


def test_motors_that_stay_off_are_a_fault(handle, firmware, clock) -> None:
    handle.tick()
    driver = HidPhantom(handle, "in memory", clock)
    driver.read(np.zeros(9), 0.0)
    handle.write = lambda buff: len(buff)  # no command arrives
    with pytest.raises(DriverFault, match=r"left its motors off for 0\.01") as off:
        push_and_read(driver, handle, clock, 40)
    assert off.value.fault is Fault.MOTORS_OFF
    assert not firmware.motors.on


@pytest.mark.parametrize("angle", [np.nan, np.inf, 1e30])
def test_calibration_beyond_32_bit_counts_is_refused_and_not_sent(driver, handle, firmware, angle) -> None:
    handle.tick()
    before = firmware.feature(protocol.CALIBRATION)
    with pytest.raises(SimError, match="expected numbers of 32 bits"):
        driver.calibrate(np.array([angle, 0.0, 0.0]), np.zeros(3))
    assert firmware.feature(protocol.CALIBRATION) == before


def test_device_without_peak_torque_or_watchdog_time_reports_no_motors_or_watchdog(handle) -> None:
    with_altered_feature(protocol.IDENTITY, peak_torque=0)(handle)
    assert not HidPhantom(handle, "x").identity.forces
    with_altered_feature(protocol.IDENTITY, watchdog_max_us=0)(handle)
    assert not HidPhantom(handle, "x").identity.watchdog


def test_calibration_without_a_reading_is_refused(driver) -> None:
    with pytest.raises(SimError, match="nothing to calibrate"):
        driver.calibrate(np.zeros(3), np.zeros(3))


def with_altered_feature(number: int, **changed):
    def feature(handle: FirmwareHandle) -> None:
        genuine = handle.get_feature_report

        def telemetry(report_num: int, max_length: int) -> list[int]:
            raw = bytes(genuine(report_num, max_length))
            if report_num != number:
                return list(raw)
            record = np.frombuffer(raw, protocol.LAYOUTS[number]).copy()[0:1].reshape(())
            for name, value in changed.items():
                record[name] = value
            return list(protocol.encode_report(record))

        handle.get_feature_report = telemetry

    return feature


def test_other_major_version_is_a_fault_and_other_minor_version_is_not(handle: FirmwareHandle) -> None:
    with_altered_feature(protocol.IDENTITY, minor=9)(handle)
    HidPhantom(handle, "x")
    with_altered_feature(protocol.IDENTITY, major=2)(handle)
    with pytest.raises(DriverFault, match="speaks major version 2 of") as refused:
        HidPhantom(handle, "x")
    assert refused.value.fault is Fault.VERSION_WRONG


@pytest.mark.parametrize(
    ("number", "changed", "message"),
    [(protocol.IDENTITY, {"magic": 5}, "the magic 0x5; expected 0x31465648"),
     (protocol.CALIBRATION, {"counts_per_turn": 0}, "expected none to be 0")],
)  # fmt: skip
def test_device_with_wrong_magic_or_zero_scale_is_refused(handle, number, changed, message) -> None:
    with_altered_feature(number, **changed)(handle)
    with pytest.raises(SimError, match=message):
        HidPhantom(handle, "x")


@pytest.mark.slow
def test_follow_through_firmware_matches_simulation_within_1_mm(handle, firmware) -> None:
    positions, rig = device_follow(
        lambda device: Rig(device, HidPhantom(handle, "in memory"), FirmwareBackend(firmware, handle, Linkage()))
    )
    assert rig.fault == Fault.NONE
    assert rms(positions, simulated_follow()) < 1e-3


@pytest.mark.slow
def test_follow_through_firmware_and_gate_matches_simulation_within_1_mm(handle, firmware) -> None:
    driver = LockStep(HidPhantom(handle, "in memory"), FirmwareBackend(firmware, handle, Linkage()))
    assert rms(gated_follow(driver)["p"], simulated_follow()) < 1e-3
