"""What is driven in the servo's process, from what can be sent to it."""

import socket
from dataclasses import dataclass, replace

import numpy as np

from controllers.safety.gate import Gate
from controllers.state import Array
from experiments.config.run_config import Clock, RunConfig
from experiments.files.device_files import Calibration
from experiments.hardware.permit import check_device
from experiments.setups.session import Session
from experiments.setups.wiring import Ready, wire
from models.scene import P_WH, PHANTOM, SceneConfig
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
    """A configuration as the servo has it: no figure, and one physics step a period, for no physics decides anything.

    The figure is evaluated where it is shown. Neither is what a certificate is of.
    """
    clock = Clock(servo_period=config.clock.servo_period, physics_step=config.clock.servo_period)
    return replace(config, figure=replace(config.figure, kind="none"), clock=clock)


def session_of(config: RunConfig, ready: Ready = lambda units: None, silent: float = SILENT_PERIODS) -> Session:
    """A run of a field on a device behind two arrays, which may be silent for so many periods, wired up.

    Raises
    ------
    ModelError, ControllerError, SimError
        As `experiments.setups.wiring.wire`.
    """

    def device(world: World) -> DeviceState:
        return exchange(world, config.device.cutoff, silent=silent)

    return wire(config, ready=ready, device=device)


def start_of(session: Session) -> Array:
    """Where the run begins, in H [m], shape (3,)."""
    return session.world.data.site(PHANTOM + "tip").xpos - P_WH


@dataclass(frozen=True)
class MakeServo:
    """Opens the device and makes what is driven; sent to the servo's process and called there.

    Parameters
    ----------
    config : RunConfig
        As `served`.
    name : str
        Of the device, for `sim.devices.hardware_list`.
    gate : Gate
        Its limits.
    offset : three floats
        Of its encoders [rad].
    calibration : Calibration, optional
        Whose offset that is.
    packets : socket, optional
        Of an emulated device, instead.
    calibrated : bool
        Whether that one knows its zero.
    silent : float
        Periods without a new reading that are a fault.
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
        """Make it.

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
        from sim.devices.hardware_list import open_device  # loads what drivers there are

        return open_device(self.name)


@dataclass(frozen=True)
class MakeEmulated:
    """Makes the emulated Phantom; sent to its process and called there.

    Parameters
    ----------
    scene : SceneConfig
        Its rates.
    start : Array
        Where the stylus is [m], shape (3,).
    linkage : Linkage
        What it is.
    """

    scene: SceneConfig
    start: Array
    linkage: Linkage

    def __call__(self) -> EmulatedPhantom:
        """Make it."""
        return EmulatedPhantom(self.scene, self.start, self.linkage)
