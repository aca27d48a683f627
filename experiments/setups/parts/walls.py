"""Soft walls of the figure: the limits of its joints as a field."""

import numpy as np

from controllers.errors import ParameterError
from controllers.fields.soft_wall import SoftWall
from controllers.haptic_map.base import HapticMap
from models.humanoid.skeleton import JOINTS, N_POSE, N_TANGENT, joint_range

DAMPING = 2e-3  # damping of a joint that exceeds the greatest speed [N m s/rad]


def figure_walls(haptic_map: HapticMap, stiffness: float, margin: float, speed: float) -> SoftWall:
    """A field that repels the hand from the limits of the figure's joints and from joint speeds above `speed` [rad/s].

    Raises
    ------
    ParameterError
        If a number is out of its interval.
    """
    n, narrowest = len(JOINTS), float(np.diff(joint_range(), axis=2).min())
    if margin > 0.5 * narrowest:
        raise ParameterError(
            f"--wall-margin is {margin:g} rad; expected at most {np.floor(500.0 * narrowest) / 1e3:g} rad, half of the "
            "narrowest range"
        )
    columns, rows = range(N_POSE - 4 * n, N_POSE, 4), range(N_TANGENT - 3 * n, N_TANGENT, 3)
    return SoftWall(haptic_map, tuple(columns), tuple(rows), tuple(joint_range()), stiffness, margin, DAMPING, speed)
