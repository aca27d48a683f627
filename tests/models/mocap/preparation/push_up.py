"""Push-ups: a body supported by its toes and palms."""

import numpy as np
from scipy.optimize import brentq

from models.humanoid.skeleton import CONTACT_RADIUS, FOOT_CONTACTS, JOINTS, N_TANGENT
from models.mocap.dynamics.floor_forces import ALL_CONTACTS
from models.mocap.motion.clip import Clip
from models.mocap.motion.kinematics import contact_points
from tools.clip_authoring.coordinates import poses

PALMS = slice(len(FOOT_CONTACTS), len(ALL_CONTACTS))


def propped(shoulders: float) -> np.ndarray:
    """Coordinates of a straight body on its toes and palms, arms forward by an angle from the sides [rad]."""
    u = np.zeros(N_TANGENT)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        u[6 + 3 * JOINTS.index(f"{side}_shoulder") + 2] = -sign * shoulders
        u[6 + 3 * JOINTS.index(f"{side}_ankle") + 1] = np.deg2rad(-25.0)

    def gap(pitch: float) -> float:
        u[4] = pitch
        heights = contact_points(poses(u)[None], ALL_CONTACTS)[0, :, 2]
        return heights[: PALMS.start].min() - heights[PALMS].min()

    u[4] = brentq(gap, 1.0, 1.5)
    u[2] = CONTACT_RADIUS - contact_points(poses(u)[None], ALL_CONTACTS)[0, :, 2].min()
    return u


def held(frames: int) -> Clip:
    """A push-up that is held, at 120 frames a second."""
    return Clip(np.tile(poses(propped(np.deg2rad(85.0))), (frames, 1)), 120.0, "held")
