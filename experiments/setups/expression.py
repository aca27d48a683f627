"""What turning the stylus does: the figure looks where it points and leans as it leans."""

import numpy as np

from controllers.haptic_map.base import HapticMap
from controllers.haptic_map.expressive import Expressive, ExpressiveJoint
from models.humanoid.skeleton import BODIES, JOINTS, joint_range
from sim.users.intent import Turn

# Turn of a joint for a turn of the stylus about x (roll), y (pitch), z (yaw): gaze follows one to one, and the trunk
# leads it as a person's does; roll leans the trunk only.
GAINS = {
    "abdomen": (0.3, 0.2, 0.1),
    "chest": (0.3, 0.2, 0.2),
    "head": (0.0, 0.6, 0.7),
}
LAP_ANGLE = 0.7  # of the hand that turns the stylus twice a lap [rad]
MARGIN = np.deg2rad(3.0)  # of the joints' ranges that is kept: turns about different axes do not quite add


def expressive_figure(base: HapticMap) -> Expressive:
    """A map of the figure with gaze and lean: joints above the pelvis turn, so the legs and their contacts stay."""
    joints: list[ExpressiveJoint] = []
    for name, gain in GAINS.items():
        low, high = joint_range()[JOINTS.index(name)].T
        x, y, z = (float(end) for end in low + MARGIN)
        a, b, c = (float(end) for end in high - MARGIN)
        joints.append(ExpressiveJoint(BODIES.index(name), gain, (x, y, z), (a, b, c)))
    return Expressive(base, joints)


def lap_turns(start: float, lap: float, way: int, angle: float = LAP_ANGLE) -> tuple[Turn, Turn]:
    """A turn one way and one the other, by an angle [rad], in the lap that begins at a time [s].

    Way 0 is to the left and right, 1 down and up, 2 over to the right and left.
    """
    axis = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))[way % 3]
    return Turn(start, 0.5 * lap, angle, axis), Turn(start + 0.5 * lap, 0.5 * lap, -angle, axis)
