"""Factories of the servo and of the emulated device, which are sent to their processes and called there."""

import socket
from dataclasses import dataclass, replace

import numpy as np

from controllers.errors import ParameterError
from controllers.safety.gate import Gate
from experiments.config.run_config import Clock, RunConfig, phantom_of
from experiments.files.device_files import Calibration
from experiments.hardware.arming_checks import check_device
from experiments.setups.session import Session
from experiments.setups.wiring import Ready, wire
from geometry.arrays import Array
from models.world.scene import P_WH, PHANTOM, SceneConfig
from sim.devices.device import DeviceState
from sim.devices.driver import Driver
from sim.devices.exchange import exchange
from sim.errors import SimError
from sim.hardware.emulated import EmulatedPhantom
from sim.hardware.emulated_process import EmulatedDriver
from sim.hardware.gated_servo import GatedServo
from sim.world.encoders import SILENT_PERIODS
from sim.world.linkage import Linkage
from sim.world.world import World


def served(config: RunConfig) -> RunConfig:
    """The configuration of the servo's process: without a figure, and with one physics step per period.

    The device replaces the simulated physics, and the figure is evaluated where it is shown; the certificate depends on
    neither of the two.

    Raises
    ------
    ParameterError
        If the map moves a robot arm: only figures are shown beside a device.
    """
    if config.body == "robot":
        raise ParameterError("beside a device only figures are shown; expected another map than robot-arm")
    clock = Clock(servo_period=config.clock.servo_period, physics_step=config.clock.servo_period)
    return replace(config, figure=config.figure.as_kind("none", config.leads), clock=clock)


def session_of(config: RunConfig, ready: Ready = lambda units: None, silent: float = SILENT_PERIODS) -> Session:
    """Put together the run of a field on a device that is accessed through two arrays (`sim.devices.exchange`).

    After `silent` servo periods without a reading from the device, a fault is latched.

    Raises
    ------
    HvfError
        As `experiments.setups.wiring.wire`.
    """
    cutoff = phantom_of(config.device).cutoff

    def device(world: World) -> DeviceState:
        return exchange(world, cutoff, silent=silent)

    return wire(config, ready=ready, device=device)


def start_of(session: Session) -> Array:
    """Position of the stylus at which the run begins, in H [m], shape (3,)."""
    return session.world.data.site(PHANTOM + "tip").xpos - P_WH


@dataclass(frozen=True)
class MakeServo:
    """Opens the device and makes the gated servo; sent to the servo's process and called there.

    Parameters
    ----------
    config : RunConfig
        Configuration returned by `served`.
    name : str
        Name of the device, for `sim.devices.hardware_list`.
    gate : Gate
        Safety gate with its limits.
    offset : three floats
        Offset of the encoders [rad].
    calibration : Calibration, optional
        Calibration from which the offset comes.
    packets : socket, optional
        Socket of an emulated device, which is used instead of a real one.
    calibrated : bool
        Whether the emulated device knows its zero.
    silent : float
        Number of periods without a new reading after which a fault is latched.
    """

    config: RunConfig
    name: str
    gate: Gate
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    calibration: Calibration | None = None
    packets: socket.socket | None = None
    calibrated: bool = True
    silent: float = SILENT_PERIODS

    def __call__(self) -> GatedServo:
        """Open the device and make the servo.

        Raises
        ------
        SimError
            If there is no such device, or it may not be armed.
        """
        session = session_of(self.config, silent=self.silent)
        driver = self._driver()
        try:
            check_device(driver.identity, self.calibration)
        except SimError:
            driver.close()
            raise
        return GatedServo(session.servo, session.world, driver, self.gate, np.array(self.offset))

    def _driver(self) -> Driver:
        if self.packets is not None:
            return EmulatedDriver(self.packets, self.calibrated)
        from sim.devices.hardware_list import open_device  # imported late, as it loads the installed drivers

        return open_device(self.name)


@dataclass(frozen=True)
class MakeEmulated:
    """Makes the emulated Phantom; sent to its process and called there.

    Parameters
    ----------
    scene : SceneConfig
        Rates of the emulation.
    start : Array
        Initial position of the stylus in H [m], shape (3,).
    linkage : Linkage
        Parameters of the emulated linkage.
    """

    scene: SceneConfig
    start: Array
    linkage: Linkage

    def __call__(self) -> EmulatedPhantom:
        """Make the device."""
        return EmulatedPhantom(self.scene, self.start, self.linkage)
