"""A user-defined device: a class in a file."""

import textwrap
from pathlib import Path

import numpy as np
import pytest

from controllers.errors import ParameterError
from controllers.safety.faults import Fault
from models.phantom.dynamics import gravity_torques
from models.phantom.kinematics import forward_kinematics, joint_torques, vector_to_device_frame
from sim.devices.driver import READ, DriverFault
from sim.devices.hardware_list import check_present, open_device
from sim.devices.own_device import TipDevice, TipDriver, TipPose
from sim.errors import SimError
from tests.devices.follow import device_follow, rms, simulated_follow
from tests.devices.own_tip import LinkageTip
from tests.devices.rig import Linkage, Rig

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "own_device.py"
POSITION = np.array([0.01, -0.02, 0.03])


class Scripted(TipDevice):
    """Returns a given pose (or raises it), and records the forces written to it; None is a release."""

    def __init__(self, pose=None):
        self.pose, self.written = pose, []

    def read(self):
        if isinstance(self.pose, Exception):
            raise self.pose
        return self.pose

    def write(self, force):
        self.written.append(force)

    def release(self):
        self.written.append(None)


def test_tip_is_read_in_the_hand_frame_with_switch_and_sequence_number() -> None:
    driver, reading = TipDriver(Scripted(TipPose(POSITION, pressed=True)), "here", clock=lambda: 5.0), np.zeros(9)
    assert driver.read(reading, 0.0)
    np.testing.assert_allclose(
        forward_kinematics(tuple(reading[3:6])), vector_to_device_frame(tuple(POSITION)), atol=1e-12
    )
    np.testing.assert_array_equal(reading[:3], [1.0, 5.0, 1.0])
    assert driver.telemetry[READ] == 1.0
    driver = TipDriver(Scripted(), "here")
    assert not driver.read(reading, 0.0)


def test_written_force_is_the_field_force_up_to_the_device_limit() -> None:
    device, rng = Scripted(TipPose(POSITION)), np.random.default_rng(3)
    driver, reading = TipDriver(device, "here"), np.zeros(9)
    driver.read(reading, 0.0)
    theta = tuple(reading[3:6])
    for _ in range(100):
        f_H = rng.normal(0.0, 4.0, 3)
        driver.write(
            np.add(joint_torques(theta, vector_to_device_frame(tuple(f_H))), gravity_torques(theta)), enable=True
        )
        wanted = f_H * min(1.0, device.largest_force / np.linalg.norm(f_H))
        np.testing.assert_allclose(device.written[-1], wanted, atol=1e-12)
    driver.write(np.zeros(3), enable=False)
    assert device.written[-1] is None


def test_what_poses_and_forces_need_is_compiled_before_the_first_of_them(monkeypatch) -> None:
    called: list[str] = []
    for name in ("write_pose", "force_at_tip"):
        monkeypatch.setattr(f"sim.devices.own_device.{name}", lambda *_, name=name: called.append(name))
    TipDriver(Scripted(), "here")
    assert called == ["write_pose", "force_at_tip"]


def test_torque_that_is_not_finite_releases_the_device() -> None:
    device = Scripted(TipPose(POSITION))
    driver = TipDriver(device, "here")
    with pytest.raises(DriverFault) as refused:
        driver.write(np.array([0.0, np.nan, 0.0]), enable=True)
    assert refused.value.fault is Fault.FORCE_NOT_FINITE
    assert device.written == [None]


@pytest.mark.parametrize(
    ("pose", "fault"),
    [
        (OSError("gone"), Fault.UNPLUGGED), (ValueError("a bad cable"), Fault.DEVICE_REPORTED),
        (TipPose(np.zeros(2)), Fault.DEVICE_REPORTED),
        (TipPose(np.zeros(3), pressed=np.zeros(2)), Fault.DEVICE_REPORTED), ("here", Fault.DEVICE_REPORTED),
        (TipPose(np.zeros(3), pressed="no"), Fault.DEVICE_REPORTED),
        (TipPose(np.zeros(3), pressed=np.nan), Fault.DEVICE_REPORTED),
        (TipPose(np.array([0.0, np.nan, 0.0])), Fault.READING_NOT_FINITE),
        (TipPose(np.zeros(3), -np.eye(3)), Fault.READING_NOT_FINITE),
        (TipPose(np.array([0.9, 0.0, 0.0])), Fault.LEFT_WORKSPACE),
    ],
)  # fmt: skip
def test_exception_or_invalid_pose_is_a_fault_without_reading(pose, fault) -> None:
    driver, reading = TipDriver(Scripted(pose), "here"), np.zeros(9)
    with pytest.raises(DriverFault) as refused:
        driver.read(reading, 0.0)
    assert refused.value.fault is fault
    assert not reading.any()


@pytest.mark.parametrize("pose", [TipPose(np.zeros(2)), TipPose(np.zeros(3), pressed="no"), "here"])
def test_wrong_pose_is_reported_at_the_read_of_the_device(pose) -> None:
    with pytest.raises(DriverFault) as refused:
        TipDriver(Scripted(pose), "own.py:Scripted").read(np.zeros(9), 0.0)
    assert refused.value.detail.startswith("own.py:Scripted, read: ")


def test_exception_is_printed_once(capsys) -> None:
    driver = TipDriver(Scripted(ValueError("a bad cable")), "here")
    for _ in range(3):
        with pytest.raises(DriverFault) as refused:
            driver.read(np.zeros(9), 0.0)
        assert refused.value.detail.endswith("ValueError: a bad cable")
    assert capsys.readouterr().err.strip().count("ValueError: a bad cable") == 1


def test_release_and_close_errors_are_not_raised(capsys) -> None:
    class Stuck(Scripted):
        def release(self):
            raise RuntimeError("stuck")

        def close(self):
            raise RuntimeError("stuck")

    driver = TipDriver(Stuck(), "here")
    driver.let_go()
    driver.close()
    assert capsys.readouterr().err.count("RuntimeError: stuck") == 2  # printed once for each place


def test_motors_are_released_when_a_force_cannot_be_written() -> None:
    class Broken(Scripted):
        def write(self, force):
            raise OSError("gone")

    device = Broken(TipPose(POSITION))
    with pytest.raises(DriverFault) as refused:
        TipDriver(device, "here").write(np.zeros(3), enable=True)
    assert refused.value.fault is Fault.UNPLUGGED
    assert device.written == [None]


@pytest.mark.parametrize("largest", [0.0, -1.0, np.nan, np.inf])
def test_largest_force_that_limits_nothing_is_refused(largest) -> None:
    device = Scripted()
    device.largest_force = largest
    with pytest.raises(SimError, match="expected a finite force above 0 N"):
        TipDriver(device, "here")


def test_largest_force_in_letters_is_refused() -> None:
    device = Scripted()
    device.largest_force = "3"
    with pytest.raises(ParameterError, match="largest_force is '3'; expected a number"):
        TipDriver(device, "here")


@pytest.mark.parametrize("pressed", [True, np.True_, 1, np.uint8(1)])
def test_switch_may_be_a_bit(pressed) -> None:
    driver, reading = TipDriver(Scripted(TipPose(POSITION, pressed=pressed)), "here"), np.zeros(9)
    assert driver.read(reading, 0.0)
    assert reading[2] == 1.0


def test_what_is_no_pose_is_named() -> None:
    with pytest.raises(DriverFault) as refused:
        TipDriver(Scripted((POSITION, True)), "here").read(np.zeros(9), 0.0)
    assert "expected TipPose" in refused.value.detail


def test_file_may_define_dataclasses_and_import_its_neighbours(tmp_path) -> None:
    (tmp_path / "neighbour_sdk.py").write_text("NAME = 'sdk'", encoding="utf-8")
    text = """
        from __future__ import annotations
        from dataclasses import dataclass
        import hvf, neighbour_sdk

        @dataclass
        class State:
            x: float = 0.0

        class Mine(hvf.TipDevice):
            name = neighbour_sdk.NAME
            def read(self): return None
    """
    (tmp_path / "mine.py").write_text(textwrap.dedent(text), encoding="utf-8")
    assert open_device(f"{tmp_path}/mine.py:Mine").identity.name == "sdk"


def test_device_without_write_has_no_motors() -> None:
    class Mouse(TipDevice):
        def read(self):
            return None

    assert not TipDriver(Mouse(), "here").identity.forces
    assert TipDriver(Scripted(), "here").identity.forces


@pytest.mark.slow
def test_follow_matches_simulation_within_1_mm() -> None:
    def rig(device):
        tip = LinkageTip(Linkage())
        return Rig(device, TipDriver(tip, "here", clock=lambda: tip.linkage.ticks * 1e-3), tip)

    positions, driven_rig = device_follow(rig)
    assert driven_rig.fault == 0
    assert rms(positions, simulated_follow()) < 1e-3


def test_example_device_opens_by_file_and_class() -> None:
    name = f"{EXAMPLE}:Mass"
    check_present(name)
    driver = open_device(name)
    assert driver.identity.name == "Mass"
    assert driver.read(np.zeros(9), 0.0)
    driver.close()


@pytest.mark.parametrize(
    ("text", "name", "why"),
    [
        (None, "own.py:Mine", "there is no file .*own.py"),
        ("x = 1", "own.py:Mine", "has no device 'Mine'; expected FILE.py:CLASS"),
        ("import hvf\nclass Mine(hvf.TipDevice): ...", "own.py", "is named without its class; there is Mine"),
        ("x = 1\ny = z", "own.py:Mine", "own.py:2: NameError: name 'z'"),
        ("import hvf\nclass Mine(hvf.TipDevice): ...", "own.py:Mine", "does not open: .*abstract"),
        ("def", "own.py:Mine", r"own\.py:1: SyntaxError"),
        ("raise SystemExit(0)", "own.py:Mine", "SystemExit"),
        ("raise ValueError('a\\nb')", "own.py:Mine", "ValueError: a b"),
    ],
)  # fmt: skip
def test_file_without_usable_device_is_reported_in_one_line(tmp_path, text, name, why) -> None:
    if text is not None:
        (tmp_path / "own.py").write_text(text, encoding="utf-8")
    with pytest.raises(SimError, match=why) as refused:
        open_device(f"{tmp_path}/{name}")
    assert "\n" not in str(refused.value)
