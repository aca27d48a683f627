"""Contact forces of a clip as it is, and the residual that they leave."""

from typing import NamedTuple

import numpy as np

from geometry.arrays import Array, rms
from models.humanoid.skeleton import JOINTS, N_TANGENT
from models.mocap.dynamics.floor_forces import EDGES
from models.mocap.motion.clip import Clip
from models.mocap.preparation.change import Change
from models.mocap.preparation.motion_errors import MotionErrors
from models.mocap.preparation.stances import Stances


class ContactForces(NamedTuple):
    """Contact forces of a clip, the force that they leave, and the largest joint torque.

    Attributes
    ----------
    residual : float
        RMS residual force [body weights].
    loads : array, shape (n, k)
        Vertical force on each contact sphere, frame by frame [body weights].
    strain : float
        Largest torque of a joint, as a fraction of its limit.
    joint : str
        The joint with this torque.
    """

    residual: float
    loads: Array
    strain: float
    joint: str


def contact_forces(clip: Clip, schedule: Stances, passage: bool = False) -> ContactForces:
    """Contact forces of a clip as it is, for a contact schedule; `passage` as in `feasible`."""
    change = Change(clip, passage=passage)
    motion_errors = MotionErrors(change, schedule)
    errors = motion_errors.at(np.zeros(change.n_points * N_TANGENT), False)
    weight = motion_errors.floor.body_weight
    forces = (errors.grip.reshape(len(errors.grip), -1, 4) @ EDGES)[:, :, 2] / weight
    frames = np.arange(clip.n_frames) / clip.fps
    loads = np.column_stack([np.interp(frames, change.times, force) for force in forces.T])
    torque_ratios = np.abs(errors.torque_ratio).max(axis=0)
    residual = rms(np.linalg.norm(errors.residual[:, :3], axis=1)) / weight
    return ContactForces(residual, loads, float(torque_ratios.max()), JOINTS[int(torque_ratios.argmax()) // 3])
