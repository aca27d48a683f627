"""The emulated device: its hand, and its behaviour without commands."""

import numpy as np
import pytest

from models.phantom.kinematics import forward_kinematics
from models.world.scene import SceneConfig
from sim.devices.exchange import READING_SIZE, READING_THETA
from sim.errors import SimError
from sim.hardware.emulated import EmulatedPhantom
from sim.world.linkage import Linkage
from tests.sim.bare_servos import START

PERIOD = 1e-3


def tip(device: EmulatedPhantom) -> np.ndarray:
    reading = np.zeros(READING_SIZE)
    device.read(reading, 0.0)
    return np.array(forward_kinematics(tuple(reading[READING_THETA : READING_THETA + 3])))


def test_hand_catches_the_stylus_where_it_is_when_motors_go_off() -> None:
    device = EmulatedPhantom(SceneConfig(servo_period=PERIOD, physics_step=PERIOD), START, holds=0.01)
    begin = tip(device)
    for _ in range(150):
        device.write(np.array([0.06, 0.0, 0.0]), True)
    let_go = tip(device)
    assert np.linalg.norm(let_go - begin) > 0.02
    places = []
    for _ in range(300):
        device.write(np.zeros(3), False)
        places.append(tip(device))
    speeds = np.linalg.norm(np.diff(places, axis=0), axis=1) / PERIOD
    assert speeds[:50].max() < 0.7
    assert speeds[-50:].max() < 0.1
    assert np.linalg.norm(places[-1] - let_go) < 2e-3


@pytest.mark.parametrize("step", [1.25e-4, 5e-4, 1e-3])
def test_delay_of_a_servo_period_applies_the_previous_command_at_any_physics_step(step: float) -> None:
    scene = SceneConfig(servo_period=PERIOD, physics_step=step)
    late, prompt = (EmulatedPhantom(scene, START, Linkage(delay=delay), holds=0.0) for delay in (PERIOD, 0.0))
    torques = 0.05 * np.random.default_rng(1).standard_normal((40, 3))
    for torque, before in zip(torques, np.vstack([np.zeros(3), torques]), strict=False):
        late.write(torque, True)
        prompt.write(before, True)
        np.testing.assert_array_equal(late.world.data.qpos, prompt.world.data.qpos)
    with pytest.raises(SimError, match=r"expected at most 0\.001 s of an emulated device, the servo period"):
        EmulatedPhantom(scene, START, Linkage(delay=1.1e-3))
