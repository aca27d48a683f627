"""A device's driver in the loop, in lock-step with a simulated linkage behind it."""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from controllers.safety.faults import FAULT_CODE, latch
from models.world.scene import SceneConfig
from sim.devices.driver import DeviceIdentity, Driver, DriverFault
from sim.devices.exchange import COMMAND_FAULT, COMMAND_TORQUE, READING_SIZE, READING_THETA, Exchange
from sim.hardware.emulated import EmulatedPhantom
from sim.users.hand.arm import Arm
from sim.world.plant import make_plant
from tests.devices.firmware import Firmware, FirmwareHandle
from tests.sim.bare_servos import START, device_world, pass_period, simulated


class Linkage:
    """The Phantom in MuJoCo with a hand on it: gives true angles, takes joint torques."""

    def __init__(self, arm: Arm | None = None, start: np.ndarray = START):
        self.world = device_world(start=start)
        self.phantom = simulated(self.world, arm)
        self.plant, self.ticks = make_plant(self.world), 0
        self._applied = np.zeros((self.plant.substeps, 3))

    def angles(self) -> np.ndarray:
        """Joint and gimbal angles [rad], shape (6,)."""
        port = self.phantom.port
        return port.qpos[[*port.arm_q, *port.gimbal_q]]

    def step(self, torque: np.ndarray) -> None:
        """Advance by a period under these joint torques."""
        self.plant.ctrl[list(self.phantom.port.motor)] = torque
        pass_period(self.plant, self.phantom.port, self.phantom.user, self.ticks * self.plant.period, self._applied)
        self.ticks += 1


class HeldLinkage:
    """A linkage whose hand holds the stylus until the motors have been on for a while (`EmulatedPhantom`)."""

    def __init__(self, start: np.ndarray, period: float):
        self._device = EmulatedPhantom(SceneConfig(servo_period=period), start)

    def angles(self) -> np.ndarray:
        reading = np.zeros(READING_SIZE)
        self._device.read(reading, 0.0)
        return reading[READING_THETA:]

    def step(self, torque: np.ndarray) -> None:
        self._device.write(torque, bool(torque.any()))


class DeviceBackend(Protocol):
    """The simulated hardware behind a driver."""

    def publish_reading(self) -> None:
        """Begin a period: send a reading."""
        ...

    def advance(self) -> None:
        """End the period: move under the last command."""
        ...


class LockStep:
    """A driver whose device advances by a period with each command, for a servo without a clock."""

    def __init__(self, driver: Driver, backend: DeviceBackend):
        self.driver, self.backend, self.telemetry, self._published = driver, backend, driver.telemetry, False

    @property
    def identity(self) -> DeviceIdentity:
        return self.driver.identity

    def read(self, reading: np.ndarray, timeout: float) -> bool:
        if not self._published:
            self.backend.publish_reading()
            self._published = True
        return self.driver.read(reading, timeout)

    def write(self, torque: np.ndarray, enable: bool) -> None:
        try:
            self.driver.write(torque, enable)
        finally:
            self.backend.advance()
            self._published = False

    def let_go(self) -> None:
        self.driver.let_go()

    def close(self) -> None:
        self.driver.close()


class FirmwareBackend:
    """The reference firmware on the simulated linkage."""

    def __init__(self, firmware: Firmware, handle: FirmwareHandle, linkage: Linkage):
        self.firmware, self.handle, self.linkage = firmware, handle, linkage

    def publish_reading(self) -> None:
        self.firmware.turn_to(self.linkage.angles())
        self.handle.tick()

    def advance(self) -> None:
        self.linkage.step(self.firmware.joint_torque)


class Rig:
    """Called before each tick: sends the last command, and reads; a fault of the driver is latched in the device."""

    def __init__(self, device: Exchange, driver: Driver, backend: DeviceBackend, period: float = 1e-3):
        self.device, self.driver, self.backend, self.period = device, driver, backend, period

    def send(self) -> None:
        command = self.device.command
        self.driver.write(command[COMMAND_TORQUE : COMMAND_TORQUE + 3], command[COMMAND_FAULT] == 0.0)

    def __call__(self, tick: int) -> None:
        if tick > 0:
            self._guarded(self.send, tick)
            self.backend.advance()
        self.backend.publish_reading()
        self._guarded(lambda: self.driver.read(self.device.reading, 0.0), tick)

    def _guarded(self, action: Callable[[], object], tick: int) -> None:
        try:
            action()
        except DriverFault as fault:
            latch(self.device.faults, int(fault.fault), tick * self.period, fault.value)
            self.driver.let_go()

    @property
    def fault(self) -> int:
        return int(self.device.faults[FAULT_CODE])
