"""Servos and devices that other processes of the tests make; importable by name from there."""

import socket

from controllers.safety.faults import Fault
from models.world.scene import SceneConfig
from sim.hardware.emulated import EmulatedPhantom
from sim.hardware.emulated_process import EmulatedDriver
from sim.hardware.gated_servo import GatedServo
from tests.sim.bare_servos import START
from tests.sim.hardware.emulation import UNRAMPED_GATE, FaultyDriver, gated_servo

PERIOD = 4e-3
GATE = {**UNRAMPED_GATE, "ramp": 0.1, "quiet": PERIOD, "dead_man": False}


def servo_with_own_device() -> GatedServo:
    return gated_servo(period=PERIOD, holds=60.0, **GATE)


def servo_with_failing_device() -> GatedServo:
    driver = servo_with_own_device().driver
    assert isinstance(driver, EmulatedPhantom)
    faulty = FaultyDriver(driver)
    faulty.read_fault = Fault.DEVICE_REPORTED, 0.0, "mine.py:3: ValueError: bad"
    return gated_servo(faulty, period=PERIOD, **GATE)


def servo_over_packets(packets: socket.socket) -> GatedServo:
    return gated_servo(EmulatedDriver(packets), period=PERIOD, **GATE)


def emulated_device() -> EmulatedPhantom:
    return EmulatedPhantom(SceneConfig(servo_period=PERIOD), START, holds=600.0)
