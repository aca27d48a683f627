"""The bytes sent to a device stay within the limits whatever the field commands and the person requests."""

import struct
import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controllers.safety.arming import ARM, CLEAR, DISARM, NO_REQUEST, State
from controllers.safety.gate import GATE_SHARE, Gate
from models.phantom.dynamics import gravity_torques
from models.phantom.kinematics import jacobian
from models.phantom.parameters import PREMIUM_1_5
from sim.devices.dhd import DhdDevice
from sim.devices.hdapi import HdapiDevice
from sim.devices.hid import HidPhantom
from sim.hardware.gated_servo import GatedServo, Ticker
from tests.devices.firmware import Firmware, FirmwareHandle
from tests.devices.mocks import DhdBackend, HdBackend, mock_dhd, mock_hd, motor_force
from tests.devices.rig import FirmwareBackend, Linkage, LockStep
from tests.sim.bare_servos import follow_program
from tests.sim.hardware.emulation import gated_servo

T = 1e-3
GAINS = (1234.5, 67.8)  # of the spring and the damper; located by value among the field's parameters
ROUNDED = 1e-4  # [N], effect at the tip of rounding by half a micronewton metre at each shaft
LIMITS = {"ramp": 0.02, "quiet": 2e-3, "small": 2.0}


class RecordingHandle(FirmwareHandle):
    """The firmware's handle, which keeps all output reports."""

    def __init__(self, firmware: Firmware):
        super().__init__(firmware)
        self.sent: list[bytes] = []

    def write(self, buff: bytes) -> int:
        self.sent.append(bytes(buff))
        return super().write(buff)


def output(report: bytes) -> tuple[bool, np.ndarray]:
    """Whether the motors are on, and the joint torques [N m], decoded as the protocol's page describes."""
    assert len(report) == 64
    assert report[0] == 2
    assert zlib.crc32(report[:60]) == struct.unpack_from("<I", report, 60)[0]
    return bool(report[1] & 1), np.array(struct.unpack_from("<3i", report, 12)) * 1e-6 * PREMIUM_1_5.capstan


def tip_force(ticker: Ticker, torque: np.ndarray) -> np.ndarray:
    """Force at the tip [N] of joint torques, less those that balance the linkage's weight."""
    theta = tuple(ticker.parts.servo.device.memory[:3])
    weight = ticker.gated.gate[GATE_SHARE] * np.array(gravity_torques(theta))
    return np.linalg.solve(np.array(jacobian(theta)).T, torque - weight)


def servo(driver, gate: Gate) -> tuple[GatedServo, np.ndarray]:
    program = follow_program(*GAINS)
    parts = gated_servo(driver, program=program)._replace(gate=gate)
    params = parts.servo.field.params
    (indices,) = np.nonzero(np.isin(params, GAINS))
    assert len(indices) == 2
    params[indices] = 300.0, 4.0
    return parts, indices


gains = st.sampled_from([0.0, 4.0, 300.0, 1e4, 1e12, -1e5, np.nan, np.inf]) | st.floats(-1e6, 1e6)
steps = st.lists(
    st.tuples(st.none() | st.tuples(gains, gains), st.sampled_from([NO_REQUEST, ARM, ARM, DISARM, CLEAR]),
              st.sampled_from([0.0, 1.0, 1.0, 1.0]), st.sampled_from([0, 0, 0, 3, 9000]), st.integers(1, 60)),
    min_size=1, max_size=12,
)  # fmt: skip


@settings(max_examples=15)
@given(steps, st.booleans(), st.booleans())
def test_no_sequence_of_commands_sends_a_torque_beyond_the_limits(
    firmware_library, sequence, permitted, dead_man
) -> None:
    firmware = Firmware(firmware_library)
    handle = RecordingHandle(firmware)
    driver = LockStep(HidPhantom(handle, "in memory"), FirmwareBackend(firmware, handle, Linkage()))
    gate = Gate(T, permitted=permitted, dead_man=dead_man, **LIMITS)
    parts, indices = servo(driver, gate)
    ticker, number, last = Ticker(parts), 0, np.zeros(3)
    for changed, request, switch, slip, times in sequence:
        firmware.sensors.pressed = int(switch)
        if changed is not None:
            parts.servo.field.params[indices] = changed
        for k in range(times):
            handle.sent.clear()
            if slip:
                firmware.zero[k % 3] += slip  # somebody pulls, or the encoder slips
            ticker.tick(number, request if k == 0 else NO_REQUEST)
            number += 1
            assert handle.sent
            for report in handle.sent:
                on, torque = output(report)
                assert np.all(np.abs(torque) <= np.multiply(PREMIUM_1_5.peak_torque, 1.0 + 1e-6) + 1e-5)
                if not on:
                    assert not torque.any()
                    last = np.zeros(3)
                    continue
                assert permitted
                assert switch or not dead_man
                assert ticker.state in (State.RAMPING, State.ACTIVE)
                assert ticker.fault is None
                force = tip_force(ticker, torque)
                assert np.linalg.norm(force) <= gate.force + ROUNDED
                assert np.linalg.norm(force - last) <= gate.slew * T + ROUNDED
                last = force


def test_random_sequences_can_reach_the_motors(firmware_library) -> None:
    """Otherwise the property would hold for a device that is never on."""
    firmware = Firmware(firmware_library)
    handle = RecordingHandle(firmware)
    driver = LockStep(HidPhantom(handle, "in memory"), FirmwareBackend(firmware, handle, Linkage()))
    parts, indices = servo(
        driver, Gate(T, permitted=True, dead_man=False, force=1.0, small=10.0, ramp=0.02, quiet=2e-3)
    )
    ticker, forces = Ticker(parts), []
    for k in range(300):
        if k == 100:
            parts.servo.field.params[indices] = 2e4, 0.0
        ticker.tick(k, ARM if k == 0 else NO_REQUEST)
        on, torque = output(handle.sent[-1])
        forces.append(np.linalg.norm(tip_force(ticker, torque)) if on else 0.0)
    assert 0.9 < max(forces) <= 1.0 + ROUNDED


@pytest.mark.parametrize("kind", ["hdapi", "dhd"])
def test_vendor_library_receives_the_gated_force_also_during_the_ramp(kind: str, tmp_path) -> None:
    if kind == "hdapi":
        backend = HdBackend(mock_hd(tmp_path), Linkage())
        device = HdapiDevice(backend.library, clock=lambda: backend.linkage.ticks * 1e-3)
    else:
        backend = DhdBackend(mock_dhd(tmp_path), Linkage())
        device = DhdDevice(backend.library, clock=lambda: backend.linkage.ticks * 1e-3)
    driver = LockStep(device, backend)
    parts, _ = servo(driver, Gate(T, permitted=True, dead_man=False, small=10.0, ramp=0.2, quiet=2e-3))
    ticker, commanded, sent = Ticker(parts), [], []
    for k in range(400):
        ticker.tick(k, ARM if k == 0 else NO_REQUEST)
        commanded.append(np.linalg.norm(ticker.gated.force))
        sent.append(np.linalg.norm(motor_force(backend.library)))
    driver.close()
    late = kind == "hdapi"  # a force waits for the next callback
    assert max(commanded) > 0.5
    np.testing.assert_allclose(sent[late:], commanded[: len(commanded) - late], atol=1e-9)
