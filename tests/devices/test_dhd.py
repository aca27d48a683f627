"""DHD, against a mock of the library built from C."""

import ctypes

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from controllers.safety.faults import Fault
from models.phantom.dynamics import gravity_torques
from models.phantom.kinematics import forward_kinematics, joint_torques, stylus_orientation, vector_to_device_frame
from sim.devices.dhd import DHD, MAX_FORCE, DhdDevice
from sim.devices.driver import DriverFault
from sim.errors import SimError
from tests.devices.mocks import mock_dhd, motor_force


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    return mock_dhd(tmp_path_factory.mktemp("dhd"))


@pytest.fixture
def dhd(library):
    library.mock_reset()
    return library


def pose(dhd, p, frame=None) -> None:
    frame = np.eye(3) if frame is None else frame
    dhd.mock_pose((ctypes.c_double * 3)(*p), (ctypes.c_double * 9)(*frame.ravel()))


def test_identity_is_read_and_watchdog_set_to_10_ms(dhd) -> None:
    device = DhdDevice(dhd)
    assert device.identity == ("mock omega.6", "DHD", "321", "", True, True, True, 0, True)
    assert dhd.mock_watchdog() * 125e-6 == pytest.approx(0.01)


def test_device_axes_point_to_the_user_right_and_up(dhd) -> None:
    device = DhdDevice(dhd)
    dhd.mock_button(1)
    pose(dhd, [0.01, 0.02, 0.03])
    reading = np.zeros(9)
    assert device.read(reading, 0.0)
    np.testing.assert_allclose(
        forward_kinematics(reading[3:6]), vector_to_device_frame((-0.01, -0.02, 0.03)), atol=1e-12
    )
    assert tuple(reading[[0, 2]]) == (1.0, 1.0)
    dhd.mock_guard(1)
    assert not device.read(reading, 0.0)


def test_forces_are_in_newtons_in_device_axes_and_limited(dhd) -> None:
    device, reading, rng = DhdDevice(dhd), np.zeros(9), np.random.default_rng(6)
    device.read(reading, 0.0)
    theta = tuple(reading[3:6])
    for _ in range(200):
        f_H = rng.normal(0.0, 3.0, 3)
        torque = np.add(joint_torques(theta, vector_to_device_frame(tuple(f_H))), gravity_torques(theta))
        device.write(torque, True)
        wanted = f_H * min(1.0, MAX_FORCE / np.linalg.norm(f_H))
        np.testing.assert_allclose(motor_force(dhd), wanted * [-1.0, -1.0, 1.0], atol=1e-12)
    device.write(torque, False)
    assert not motor_force(dhd).any()
    device.write(torque, True)
    with pytest.raises(DriverFault):
        device.write(np.array([np.nan, 0.0, 0.0]), True)
    assert not motor_force(dhd).any()
    device.write(torque, True)
    device.close()
    assert not dhd.mock_opened()


def test_rotation_matrix_is_read_row_by_row(dhd) -> None:
    device, reading, rng = DhdDevice(dhd), np.zeros(9), np.random.default_rng(8)
    half = Rotation.from_euler("z", 180, degrees=True)  # its axes are H's, turned about the vertical
    for _ in range(50):
        turn = Rotation.from_rotvec(rng.normal(0.0, 0.4, 3))
        pose(dhd, np.zeros(3), turn.as_matrix())
        assert device.read(reading, 0.0)
        measured = Rotation.from_quat(stylus_orientation(tuple(reading[3:6]), tuple(reading[6:9])), scalar_first=True)
        assert (measured.inv() * half * turn * half.inv()).magnitude() < 1e-12


def test_unreachable_or_invalid_pose_is_a_fault_without_reading(dhd) -> None:
    device, reading = DhdDevice(dhd), np.zeros(9)
    for p, frame, fault in [
        ([0.9, 0.0, 0.0], np.eye(3), Fault.LEFT_WORKSPACE), ([0.0, np.nan, 0.0], np.eye(3), Fault.READING_NOT_FINITE),
        ([0.0, 0.0, 0.0], np.diag([1.0, 1.0, -1.0]), Fault.READING_NOT_FINITE),
    ]:  # fmt: skip
        pose(dhd, p, frame)
        with pytest.raises(DriverFault) as refused:
            device.read(reading, 0.0)
        assert refused.value.fault is fault
    np.testing.assert_array_equal(reading, 0.0)
    pose(dhd, [0.0, 0.0, 0.0])
    assert device.read(reading, 0.0)
    assert reading[0] == 1.0


def test_release_switches_off_motors_that_others_switched_on(dhd) -> None:
    device = DhdDevice(dhd)
    dhd.dhdEnableForce(1, b"\x02")
    assert dhd.mock_enabled()
    device.let_go()
    assert not dhd.mock_enabled()


@pytest.mark.parametrize(("code", "fault"), [(2, Fault.UNPLUGGED), (7, Fault.UNPLUGGED), (12, Fault.DEVICE_REPORTED)])
def test_library_error_is_a_fault_with_its_message_on_read_and_write(dhd, code, fault) -> None:
    device = DhdDevice(dhd)
    dhd.mock_error(code)
    for action in (lambda: device.read(np.zeros(9), 0.0), lambda: device.write(np.zeros(3), True)):
        with pytest.raises(DriverFault, match="mock error") as refused:
            action()
        assert refused.value.fault is fault
    device.let_go()


def test_missing_device_or_library_is_reported_in_one_line(dhd, monkeypatch) -> None:
    dhd.mock_missing(1)
    with pytest.raises(SimError, match="DHD opens no device: mock error"):
        DhdDevice(dhd)
    monkeypatch.setattr("sim.devices.vendor_library.ctypes.util.find_library", lambda name: None)
    with pytest.raises(SimError, match="install the Force Dimension SDK"):
        DHD.load()
