"""HDAPI, against a mock of the library built from C."""

import ctypes
import gc
import threading
import time

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from controllers.safety.faults import Fault
from models.phantom.dynamics import gravity_torques
from models.phantom.kinematics import R_HP, forward_kinematics, joint_torques, stylus_orientation
from sim.devices.driver import DriverFault
from sim.devices.hdapi import ERRORS, HDAPI, HdapiDevice
from sim.errors import SimError
from tests.devices.mocks import mock_hd, motor_force


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    return mock_hd(tmp_path_factory.mktemp("hd"))


@pytest.fixture
def hd(library):
    library.mock_reset()
    return library


def pose(hd, p_mm, rotation=None) -> None:
    transform = np.eye(4)
    transform[:3, 3] = p_mm
    if rotation is not None:
        transform[:3, :3] = rotation
    hd.mock_pose((ctypes.c_double * 16)(*transform.T.ravel()))


def read_sample(device) -> np.ndarray:
    reading = np.zeros(9)
    assert device.read(reading, 0.0)
    return reading


def test_identity_is_calibrated_and_without_watchdog(hd) -> None:
    assert HdapiDevice(hd).identity == ("Mock Premium", "HDAPI", "M-42", "", True, False, True, 0, True)


@pytest.mark.parametrize(("state", "calibrated"), [(0x5000, True), (0x5001, True), (0x5002, False)])
def test_device_that_needs_calibration_is_calibrated_if_it_can(hd, state, calibrated) -> None:
    hd.mock_calibration(state)
    assert HdapiDevice(hd).identity.calibrated is calibrated


def test_position_is_in_metres_and_first_button_is_the_switch(hd, clock) -> None:
    device = HdapiDevice(hd, clock=clock)
    pose(hd, [30.0, -20.0, 10.0])
    hd.mock_buttons(3)
    assert not device.read(np.zeros(9), 0.0)
    hd.mock_tick()
    reading = read_sample(device)
    np.testing.assert_allclose(forward_kinematics(reading[3:6]), [0.03, -0.02, 0.01], atol=1e-12)
    np.testing.assert_array_equal(reading[:3], [1.0, 100.0, 1.0])
    assert not device.read(reading, 0.0)


def test_motor_force_is_that_of_the_torques_until_commands_time_out(hd, clock) -> None:
    device = HdapiDevice(hd, clock=clock)
    hd.mock_tick()
    theta, force = tuple(read_sample(device)[3:6]), (0.5, -1.0, 0.3)
    torque = np.add(joint_torques(theta, force), gravity_torques(theta))
    device.write(torque, True)
    assert not motor_force(hd).any()
    hd.mock_tick()
    np.testing.assert_allclose(motor_force(hd), force, atol=1e-12)
    clock.now += 4.9e-3
    hd.mock_tick()
    np.testing.assert_allclose(motor_force(hd), force, atol=1e-12)
    clock.now += 0.2e-3
    hd.mock_tick()
    assert not motor_force(hd).any()
    device.write(torque, True)
    hd.mock_tick()
    assert motor_force(hd).any()
    device.write(torque, False)
    hd.mock_tick()
    assert not motor_force(hd).any()


def test_force_stays_within_nominal_force_without_library_errors(hd, clock) -> None:
    device, rng = HdapiDevice(hd, clock=clock), np.random.default_rng(7)
    for _ in range(300):
        torque = rng.normal(0.0, 3.0, 3) * rng.choice([1.0, 1e3, 1e9])
        device.write(torque, True)
        hd.mock_tick()
        assert np.linalg.norm(motor_force(hd)) <= 8.5 * (1.0 + 1e-12)
        read_sample(device)  # raises for an error
    with pytest.raises(DriverFault) as refused:
        device.write(np.array([0.0, np.inf, 0.0]), True)
    assert refused.value.fault is Fault.FORCE_NOT_FINITE
    hd.mock_tick()
    assert not motor_force(hd).any()


@pytest.mark.parametrize("code", ERRORS)
def test_library_error_is_a_fault_with_its_name(hd, clock, code) -> None:
    device = HdapiDevice(hd, clock=clock)
    device.write(np.zeros(3), True)
    hd.mock_velocity(300.0, 400.0, 0.0)
    hd.mock_temperature(0.93)
    hd.mock_error(code)
    hd.mock_error(0x0304)  # what follows is of no interest
    hd.mock_tick()
    expected = {0x0200: (Fault.MOTORS_HOT, 0.93), 0x0203: (Fault.TOO_FAST, 0.5), 0x0302: (Fault.UNPLUGGED, 0x0302)}
    with pytest.raises(DriverFault, match=ERRORS[code]) as refused:
        device.read(np.zeros(9), 0.0)
    assert (refused.value.fault, refused.value.value) == expected.get(code, (Fault.DEVICE_REPORTED, code))
    hd.mock_tick()
    read_sample(device)  # once


def test_transform_columns_are_the_stylus_axes(hd, clock) -> None:
    device, rng, r_HP = HdapiDevice(hd, clock=clock), np.random.default_rng(8), Rotation.from_matrix(R_HP)
    for _ in range(50):
        turn = Rotation.from_rotvec(rng.normal(0.0, 0.4, 3))
        pose(hd, np.zeros(3), turn.as_matrix())
        hd.mock_tick()
        reading = read_sample(device)
        q = stylus_orientation(tuple(reading[3:6]), tuple(reading[6:9]))
        assert (Rotation.from_quat(q, scalar_first=True).inv() * r_HP * turn * r_HP.inv()).magnitude() < 1e-12


def test_unreachable_or_invalid_pose_is_a_fault(hd, clock) -> None:
    device = HdapiDevice(hd, clock=clock)
    for p, rotation, fault in [
        ([0.0, 0.0, 900.0], None, Fault.LEFT_WORKSPACE), ([np.nan, 0.0, 0.0], None, Fault.READING_NOT_FINITE),
        ([0.0, 0.0, 0.0], np.diag([1.0, 1.0, -1.0]), Fault.READING_NOT_FINITE),
        ([0.0, 0.0, 0.0], np.zeros((3, 3)), Fault.READING_NOT_FINITE),
    ]:  # fmt: skip
        pose(hd, p, rotation)
        hd.mock_tick()
        with pytest.raises(DriverFault) as refused:
            device.read(np.zeros(9), 0.0)
        assert refused.value.fault is fault


def test_closed_device_gives_no_force_and_opens_again(hd, clock) -> None:
    device = HdapiDevice(hd, clock=clock)
    device.write(np.ones(3), True)
    hd.mock_tick()
    assert motor_force(hd).any()
    device.close()
    assert not motor_force(hd).any()
    assert not hd.mock_opened()
    HdapiDevice(hd).close()


def test_vendor_thread_serves_at_1_khz(hd) -> None:
    hd.mock_manual(0)
    device = HdapiDevice(hd)
    reading, n, first = np.zeros(9), 0, time.perf_counter()
    while n < 200:
        n += device.read(reading, 0.5)
        device.write(np.zeros(3), True)
    assert reading[0] >= 200.0
    assert time.perf_counter() - first < 5.0
    device.close()
    frames = hd.mock_frames()
    time.sleep(0.01)
    assert hd.mock_frames() == frames


def test_vendor_thread_runs_without_the_gil_and_stops_force_without_commands(hd) -> None:
    hd.mock_manual(0)
    device, keeps_gil = HdapiDevice(hd), ctypes.PyDLL(hd._name)
    while not device.read(np.zeros(9), 0.5):
        pass
    device.write(np.ones(3), True)
    assert keeps_gil.mock_wait(hd.mock_frames() + 100)
    assert not motor_force(hd).any()
    device.close()


def test_read_waits_until_its_timeout_or_a_sample(hd) -> None:
    device = HdapiDevice(hd)
    first = time.perf_counter()
    assert not device.read(np.zeros(9), 0.05)
    assert time.perf_counter() - first >= 0.05
    tick = threading.Timer(0.05, hd.mock_tick)
    tick.start()
    assert device.read(np.zeros(9), 60.0)
    assert time.perf_counter() - first < 30.0
    tick.join()


def test_reading_carries_its_sampling_time(hd) -> None:
    device, before = HdapiDevice(hd), time.perf_counter()
    hd.mock_tick()
    after = time.perf_counter()
    time.sleep(0.01)
    assert before <= read_sample(device)[1] <= after


def test_half_written_command_is_ignored_and_the_last_one_times_out(hd, clock) -> None:
    device = HdapiDevice(hd, clock=clock)
    hd.mock_tick()
    read_sample(device)
    device.write(np.ones(3), True)
    hd.mock_tick()
    force = motor_force(hd)
    command = device._memory.command
    command.changes[0] += 1  # a writer was stopped here
    command.shared[:3] = 100.0
    clock.now += 4e-3
    hd.mock_tick()
    np.testing.assert_array_equal(motor_force(hd), force)
    clock.now += 2e-3
    hd.mock_tick()
    assert not motor_force(hd).any()


def test_half_written_sample_is_not_read(hd, clock) -> None:
    device = HdapiDevice(hd, clock=clock)
    hd.mock_tick()
    device._memory.sample.changes[0] += 1
    assert not device.read(np.zeros(9), 0.0)
    device._memory.sample.changes[0] += 1
    read_sample(device)


@pytest.mark.parametrize("clock", [time.perf_counter, lambda: time.perf_counter()])
def test_unclosed_driver_keeps_alive_what_the_vendor_thread_uses(hd, clock) -> None:
    hd.mock_manual(0)
    device = HdapiDevice(hd, clock=clock)
    device.write(np.ones(3), True)
    del device
    gc.collect()
    frames = hd.mock_frames()
    while hd.mock_frames() < frames + 20:
        time.sleep(1e-3)
    assert not motor_force(hd).any()
    hd.hdStopScheduler()


@pytest.mark.parametrize(
    ("failure", "message"),
    [("mock_missing", "HD_DEVICE_FAULT; expected a name"),
     ("mock_no_scheduler", "scheduler at 1000 Hz: HD_TIMER_ERROR")],
)  # fmt: skip
def test_missing_device_or_scheduler_is_reported_in_one_line(hd, failure, message) -> None:
    getattr(hd, failure)(1)
    with pytest.raises(SimError, match=message):
        HdapiDevice(hd)


def test_other_device_name_is_refused(hd) -> None:
    with pytest.raises(SimError, match="does not open Left"):
        HdapiDevice(hd, "Left")


def test_missing_library_error_names_what_to_install(monkeypatch) -> None:
    monkeypatch.setattr("sim.devices.vendor_library.ctypes.util.find_library", lambda name: None)
    with pytest.raises(SimError, match="install 3D Systems' OpenHaptics"):
        HDAPI.load()


def test_wrong_library_is_reported_in_one_line(tmp_path) -> None:
    (tmp_path / "libHD.so").write_text("not a library")
    with pytest.raises(SimError, match="is not OpenHaptics' library HD"):
        HDAPI.load(str(tmp_path / "libHD.so"))
