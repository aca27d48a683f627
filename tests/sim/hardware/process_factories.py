"""What the processes of the tests are made of; found by name from other processes."""

import socket

from models.world.scene import SceneConfig
from sim.hardware.emulated import EmulatedPhantom
from sim.hardware.emulated_process import EmulatedDriver
from sim.hardware.gated_servo import GatedServo
from tests.sim.bare_servos import START
from tests.sim.hardware.emulation import AT_ONCE, gated_servo

PERIOD = 4e-3
GATE = {**AT_ONCE, "ramp": 0.1, "quiet": PERIOD, "dead_man": False}


def in_process() -> GatedServo:
    return gated_servo(period=PERIOD, holds=60.0, **GATE)


def over_packets(packets: socket.socket) -> GatedServo:
    return gated_servo(EmulatedDriver(packets), period=PERIOD, **GATE)


def device() -> EmulatedPhantom:
    return EmulatedPhantom(SceneConfig(servo_period=PERIOD), START, holds=600.0)
