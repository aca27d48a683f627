"""The simulated Phantom: encoders and motors of the linkage in the world, and a simulated hand on its stylus."""

from typing import NamedTuple

from numba import njit

from controllers.state import HAND_TIME
from geometry.arrays import Array
from sim.compilation.units import Unit
from sim.users.hand.arm import Arm
from sim.users.person.person_state import PersonState
from sim.users.person.person_step import link_person, person_unit
from sim.world.phantom_port import PhantomPort, actuate, has_sensed, sense
from sim.world.plant import Hand, Plant, advance, make_hand


class SimulatedPhantom(NamedTuple):
    """The simulated Phantom of a world, and its simulated user.

    Attributes
    ----------
    port : PhantomPort
        Its encoders and motors.
    user : Hand
        The hand on the stylus.
    hand, torque, faults : Array
        Those of the port: measured hand (15,), joint torques (3,), and latched faults.
    force : Array
        The user's force at the end of the tick [N], in H, shape (3,).
    """

    port: PhantomPort
    user: Hand
    hand: Array
    torque: Array
    faults: Array
    force: Array

    def held_by(self, user: Arm | PersonState) -> "SimulatedPhantom":
        """The same device held by another user."""
        return simulated_phantom(self.port, user)

    def units(self) -> tuple[Unit, ...]:
        """Compilation units that its user needs: that of a person, none for an arm."""
        return () if self.user.person.numbers.size == 0 else (person_unit(),)

    def link(self) -> None:
        """Set the address of its user's code; compiles the unit if it is not in the cache."""
        if self.user.person.numbers.size > 0:
            link_person(self.user.person)


def simulated_phantom(port: PhantomPort, user: Arm | PersonState) -> SimulatedPhantom:
    """The Phantom of a world (see `sim.world.phantom_port.phantom_port`) held by a simulated user."""
    hand = make_hand(user)
    return SimulatedPhantom(port, hand, port.hand, port.torque, port.faults, hand.force)


@njit
def sense_simulated(device: SimulatedPhantom, t: float) -> None:
    """Read encoders and switch at time t, unless Python has done so for this tick."""
    if device.hand[HAND_TIME] != t or not has_sensed(device.port):
        sense(device.port, t, device.user.arm.switch[0])


@njit
def actuate_simulated(device: SimulatedPhantom, force: Array) -> None:
    """Command the motors."""
    actuate(device.port, force)


@njit
def advance_simulated(device: SimulatedPhantom, plant: Plant, t: float, replay: bool, applied: Array) -> None:
    """Step the physics with the user's hand on the stylus."""
    advance(plant, device.port, device.user, t, replay, applied)
