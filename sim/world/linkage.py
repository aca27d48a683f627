"""Parameters of a device beyond geometry and published masses: friction, added inertia, delay, encoder offsets."""

from dataclasses import dataclass

import numpy as np

from geometry.vectors import Triple
from models.phantom.parameters import PREMIUM_1_5
from models.phantom.spec import MOTOR_JOINTS
from models.world.scene import PHANTOM
from sim.errors import SimError
from sim.world.world import World


@dataclass(frozen=True)
class Linkage:
    """Parameters of a device beyond its geometry and masses.

    Parameters
    ----------
    coulomb : three floats
        Coulomb friction of the joints [N m].
    viscous : three floats
        Viscous friction of the joints [N m s/rad].
    inertia : three floats
        Inertia added to the published one at the joints, such as a rotor's or a handle's [kg m²]; may be negative.
    delay : float
        Latency from a command to the motors' torque [s].
    offset : three floats
        Encoder reading minus angle [rad].

    Raises
    ------
    SimError
        If a friction or the delay is negative, or a negative added inertia exceeds that of the rotors.
    """

    coulomb: Triple = PREMIUM_1_5.coulomb_friction
    viscous: Triple = PREMIUM_1_5.viscous_friction
    inertia: Triple = (0.0, 0.0, 0.0)
    delay: float = 0.0
    offset: Triple = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if min(*self.coulomb, *self.viscous, self.delay) < 0.0:
            raise SimError(f"friction {self.coulomb}, {self.viscous} and delay {self.delay} must not be negative")
        if min(np.add(self.inertia, PREMIUM_1_5.armature)) < 0.0:
            raise SimError(f"an added inertia of {self.inertia} kg m² is more than the rotors have to give")

    def into(self, world: World) -> None:
        """Set friction and inertia of a world's Phantom; delay and offset have no place in the world's model."""
        model = world.model
        for axis, name in enumerate(MOTOR_JOINTS):
            place = int(model.joint(PHANTOM + name).dofadr[0])
            model.dof_frictionloss[place], model.dof_damping[place] = self.coulomb[axis], self.viscous[axis]
            model.dof_armature[place] = PREMIUM_1_5.armature[axis] + self.inertia[axis]
