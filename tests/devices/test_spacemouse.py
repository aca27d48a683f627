"""A SpaceMouse as a device: a push sets the velocity of the tip within the workspace."""

import numpy as np
import pytest

from controllers.safety.faults import Fault
from models.phantom.kinematics import (
    forward_kinematics,
    inside_workspace,
    stylus_orientation,
    vector_to_device_frame,
    vector_to_hand_frame,
    within_limits,
)
from models.phantom.parameters import PREMIUM_1_5
from sim.devices.driver import READ, REFUSED, DriverFault
from sim.devices.spacemouse import MAX_ANGULAR_SPEED, MAX_SPEED, SpaceMouse
from tests.devices.hand_made import Cap, Clock


@pytest.fixture
def cap() -> Cap:
    return Cap()


@pytest.fixture
def mouse(cap: Cap, clock: Clock) -> SpaceMouse:
    return SpaceMouse(cap, "SpaceNavigator", "test", clock)


def read_tip(mouse: SpaceMouse, clock: Clock, ticks: int = 100) -> tuple[np.ndarray, np.ndarray]:
    reading = np.zeros(9)
    for _ in range(ticks):
        clock.now += 1e-3
        assert mouse.read(reading, 0.0)
    return np.array(vector_to_hand_frame(forward_kinematics(reading[3:6]))), reading


@pytest.mark.parametrize(
    ("push", "direction"), [((350, 0, 0), (0, -1, 0)), ((0, 350, 0), (-1, 0, 0)), ((0, 0, 350), (0, 0, -1))]
)
def test_full_push_moves_the_tip_at_top_speed_in_its_direction(mouse, cap, clock, push, direction) -> None:
    read_tip(mouse, clock, 1)
    cap.push(*push)
    p, _ = read_tip(mouse, clock, 100)
    np.testing.assert_allclose(p, np.array(direction) * MAX_SPEED * 0.1, atol=1e-9)
    cap.push(0, 0, 0)
    q, _ = read_tip(mouse, clock, 50)
    np.testing.assert_array_equal(p, q)


def test_twist_turns_the_stylus_about_the_same_axis(mouse, cap, clock) -> None:
    read_tip(mouse, clock, 1)
    cap.turn(0, 0, -350)
    _, reading = read_tip(mouse, clock, 100)
    q = np.array(stylus_orientation(reading[3:6], reading[6:9]))
    half = 0.5 * MAX_ANGULAR_SPEED * 0.1
    np.testing.assert_allclose(q, [np.cos(half), 0.0, 0.0, np.sin(half)], atol=1e-9)


def test_six_axes_in_one_report_and_buttons_are_read(mouse, cap, clock) -> None:
    read_tip(mouse, clock, 1)
    cap.queue.append(b"\x01" + np.array([350, 0, 0, 0, 0, -350], "<i2").tobytes())
    cap.queue.append(b"\x03\x01\x00")
    p, reading = read_tip(mouse, clock, 10)
    assert p[1] < 0.0
    assert reading[2] == 1.0
    assert stylus_orientation(reading[3:6], reading[6:9])[3] > 0.0


def test_tip_stays_in_workspace_and_gimbal_in_range_for_random_input(mouse, cap, clock) -> None:
    rng, reading = np.random.default_rng(8), np.zeros(9)
    for _ in range(400):
        cap.push(*rng.integers(-500, 500, 3))
        cap.turn(*rng.integers(-500, 500, 3))
        clock.now += rng.uniform(0.0, 0.2)
        last = reading.copy()
        mouse.read(reading, 0.0)
        theta = tuple(reading[3:6])
        assert within_limits(theta)
        assert inside_workspace(vector_to_device_frame(vector_to_hand_frame(forward_kinematics(theta))))
        for angle, (low, high) in zip(reading[6:], PREMIUM_1_5.gimbal_limit, strict=True):
            assert low - 1e-9 <= angle <= high + 1e-9
        if last[0]:
            step = np.subtract(forward_kinematics(reading[3:6]), forward_kinematics(last[3:6]))
            assert np.abs(step).max() <= MAX_SPEED * 0.05 + 1e-9


def test_untouched_cap_does_not_drift_and_other_reports_are_ignored(mouse, cap, clock) -> None:
    cap.push(5, -5, 8)
    cap.queue.append(b"\x17\x64")  # a battery's
    cap.queue.append(b"\x01\x00")  # too short
    p, _ = read_tip(mouse, clock, 100)
    assert not p.any()
    assert mouse.telemetry[REFUSED] == 1.0
    assert mouse.telemetry[READ] == 1.0


def test_device_has_no_force_and_unplugging_is_a_fault(mouse, cap, clock) -> None:
    assert not mouse.identity.forces
    mouse.write(np.ones(3), True)
    cap.plugged = False
    with pytest.raises(DriverFault) as refused:
        mouse.read(np.zeros(9), 0.0)
    assert refused.value.fault is Fault.UNPLUGGED
