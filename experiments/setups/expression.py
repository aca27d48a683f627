"""What turning the stylus does: the figure looks where it points and leans as it leans; the moment of the field."""

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.fields.law import Program
from controllers.fields.orientation import Orientation
from controllers.haptic_map.base import HapticMap
from controllers.haptic_map.expressive import Expressive, ExpressiveJoint
from experiments.config.run_config import STRETCHING, RunConfig
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


def oriented(program: Program, config: RunConfig, curve: Trajectory) -> Program:
    """A field, and the moment to the curve's orientation if the run is to have one.

    Raises
    ------
    ParameterError
        If a gain of the moment is negative or not finite, or the curve is one that is bent during the run.
    """
    if config.orientation_stiffness == 0.0 and config.orientation_damping == 0.0:
        return program
    if config.mode in STRETCHING:
        raise ParameterError(f"a moment to the curve's orientation needs a curve that stays; {config.mode} bends it")
    moment = Orientation(curve, config.orientation_stiffness, config.orientation_damping, config.tube)
    return program + moment.program()
