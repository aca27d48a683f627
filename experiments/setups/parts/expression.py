"""Expressive map of the figure: gaze and lean follow the orientation of the stylus."""

import numpy as np

from controllers.haptic_map.base import HapticMap
from controllers.haptic_map.expressive import Expressive, ExpressiveJoint
from models.humanoid.skeleton import BODIES, JOINTS, joint_range
from sim.users.hand.actions import Turn

# Share of the stylus's rotation about x (roll), y (pitch) and z (yaw) that each joint takes. In pitch and yaw the
# shares add up to 1, so gaze follows one to one, with a leading trunk as in people; roll leans the trunk only.
GAINS = {"abdomen": (0.3, 0.2, 0.1), "chest": (0.3, 0.2, 0.2), "head": (0.0, 0.6, 0.7)}
LAP_ANGLE = 0.7  # angle by which the default hand turns the stylus, twice a lap [rad]
JOINT_MARGIN = np.deg2rad(3.0)  # kept from the joints' limits, since rotations about different axes do not quite add


def expressive_figure(base: HapticMap) -> Expressive:
    """A map of the figure with gaze and lean: joints above the pelvis turn, so the legs and their contacts stay."""
    joints: list[ExpressiveJoint] = []
    for name, gain in GAINS.items():
        low, high = joint_range()[JOINTS.index(name)].T
        x, y, z = (float(end) for end in low + JOINT_MARGIN)
        a, b, c = (float(end) for end in high - JOINT_MARGIN)
        joints.append(ExpressiveJoint(BODIES.index(name), gain, (x, y, z), (a, b, c)))
    return Expressive(base, joints)


def lap_turns(start: float, lap: float, way: int) -> tuple[Turn, Turn]:
    """A turn by `LAP_ANGLE` and one by its negative, in the lap that begins at `start` [s].

    `way` chooses the axis: 0 yaws left and right, 1 pitches down and up, 2 rolls right and left.
    """
    axis = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))[way % 3]
    return Turn(start, 0.5 * lap, LAP_ANGLE, axis), Turn(start + 0.5 * lap, 0.5 * lap, -LAP_ANGLE, axis)
