"""The simulated Phantom behind the device protocol: each write advances the world by one period."""

from typing import Self

import numpy as np
import numpy.typing as npt

from controllers.state import HandState, Vec3
from sim.compilation.compiled import entry_point
from sim.devices.base import DeviceError, checked_force
from sim.users.arm import Arm
from sim.world.phantom_port import PhantomPort, actuate, phantom_port, sense
from sim.world.plant import Hand, Plant, advance, hand_torques, make_hand, make_plant
from sim.world.world import World

Array = npt.NDArray[np.float64]


@entry_point
def read_phantom(port: PhantomPort, hand: Hand, t: float) -> None:
    """Read the encoders and the switch at time t into `port.hand`."""
    sense(port, t, hand.arm.switch[0])


@entry_point
def write_phantom(plant: Plant, port: PhantomPort, hand: Hand, t: float, force: Array, applied: Array) -> None:
    """Command a force and step the physics for one period."""
    actuate(port, force)
    advance(plant, port, hand, t, False, applied)


class SimulatedPhantom:
    """The Phantom of a `World`, with a simulated hand on its stylus.

    What it does is what the servo's compiled loop does: the same kernels in the same order.

    Parameters
    ----------
    world : World
        Reset to where the run begins.
    arm : Arm
        The user.
    cutoff : float
        Corner frequency of the velocity filter [Hz].
    """

    def __init__(self, world: World, arm: Arm, cutoff: float):
        self._world = world
        self._plant, self._hand = make_plant(world), make_hand(arm)
        self._port = phantom_port(world.model, world.data, self.period, cutoff)
        self._applied = np.zeros((self._plant.substeps, hand_torques(self._hand)))
        self._state: HandState | None = None
        self._tick = 0
        self._open = True

    @property
    def period(self) -> float:
        """Servo period [s]."""
        return self._world.config.servo_period

    def read(self) -> HandState:
        """See `sim.devices.base.Device`."""
        self._check_open()
        if self._state is None:
            read_phantom(self._port, self._hand, self._tick * self.period)
            hand = self._port.hand.copy()
            self._state = HandState(float(hand[0]), hand[1:4], hand[4:8], hand[8:11], hand[11:14], bool(hand[14]))
        return self._state

    def write(self, force: Vec3) -> None:
        """See `sim.devices.base.Device`."""
        self.read()
        write_phantom(
            self._plant, self._port, self._hand, self._tick * self.period, checked_force(force), self._applied
        )
        self._state = None
        self._tick += 1

    def close(self) -> None:
        """See `sim.devices.base.Device`."""
        self._world.data.ctrl[list(self._port.motor)] = 0.0
        self._open = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _check_open(self) -> None:
        if not self._open:
            raise DeviceError("the simulated Phantom is closed; make a new one")
