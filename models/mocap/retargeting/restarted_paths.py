"""Paths that begin anew within a file: the body's place leaps in a frame, but its limbs move on.

Programs that repeat a lap of a gait put the body back to where the lap began, and trackers that lose a body find it at
another place. A pose that goes on is that of one motion, so its path is carried on from where it was.
"""

from dataclasses import replace

import numpy as np

from geometry.arrays import Array, rms
from models.mocap.retargeting.broken_frames import MAX_STEP_RATIO, Repaired, joint_steps
from models.mocap.retargeting.skeleton_roles import Roles

# Largest step of a joint across a leap that is no other pose whatever its steps beside it [rad]. The one capture of
# 357 that leaps has steps of 0 and 12°.
_MAX_STEP = np.deg2rad(15.0)


def with_path_carried_on(repaired: Repaired, roles: Roles) -> Repaired:
    """The motion without the leaps of its path, which are no longer among its jumps.

    In place of a leap the body moves on as in the steps beside it, as far as its limbs do: not at all where a lap's
    last pose is its first.

    Parameters
    ----------
    repaired : Repaired
        A motion without short gaps.
    roles : Roles
        The roles of its joints.
    """
    motion = repaired.motion
    steps = joint_steps(motion, roles)
    leaps = tuple(k for k in repaired.jumps if 0 < k < len(steps) - 1 and _limbs_move_on(steps, k))
    if not leaps:
        return repaired
    pelvis = motion.global_positions(motion.global_rotations())[:, roles.segments["pelvis"]]
    travel = np.diff(pelvis, axis=0)
    shift = np.zeros_like(pelvis)
    for k in leaps:
        usual = (travel[k - 1] + travel[k + 1]) / 2.0
        shift[k + 1 :] += _limbs_share(steps, k) * usual - travel[k]
    translations = motion.translations.copy()
    translations[:, 0] += shift
    jumps = tuple(k for k in repaired.jumps if k not in leaps)
    return repaired._replace(motion=replace(motion, translations=translations), jumps=jumps, leaps=leaps)


def _limbs_move_on(steps: Array, k: int) -> bool:
    """Whether no joint turns much further in a step than in those beside it."""
    beside = np.maximum(steps[k - 1], steps[k + 1])
    return bool(np.all(steps[k] <= np.maximum(_MAX_STEP, MAX_STEP_RATIO * beside)))


def _limbs_share(steps: Array, k: int) -> float:
    """How far the joints turn in a step, relative to the mean of the steps beside it."""
    usual = (rms(steps[k - 1]) + rms(steps[k + 1])) / 2.0
    return min(rms(steps[k]) / usual, MAX_STEP_RATIO) if usual > 0.0 else 1.0
