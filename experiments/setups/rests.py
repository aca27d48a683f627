"""Where clips can stand still: a hand that leaves all rivers stops the figure, which should not have to hover."""

import mujoco
import numpy as np
import numpy.typing as npt

from controllers.haptic_map.river_clips import RIVER, RiverClips
from experiments.setups.balance import nearest_supported
from experiments.setups.stylus import stylus_path
from models.humanoid.skeleton import CONTACT_RADIUS, FOOT_CONTACTS
from sim.reference.reference import poses_along

_ROWS = 96  # of a lap
_TOUCH = 0.003  # a contact point so near the floor bears [m]
_SHARE = 0.8  # of the support, about its middle, over which the centre of mass is asked to be
_FLIES = 1.0  # [m] worse than any place over the floor


def with_rests(clips: RiverClips, figure: mujoco.MjModel) -> RiverClips:
    """The same map, whose clips stop where both feet stand under the centre of mass, or else where least is missing.

    Parameters
    ----------
    clips : RiverClips
        With limbs.
    figure : mujoco.MjModel
        Whose poses they are, alone.
    """
    data, feet = mujoco.MjData(figure), [figure.geom(name).id for name in FOOT_CONTACTS]
    kind, params, memory = clips.compiled()
    poses, centre, contacts = np.empty((_ROWS, clips.nq)), np.empty((_ROWS, 2)), np.empty((_ROWS, len(feet), 3))
    rests: list[npt.NDArray[np.float64]] = []
    for river, curve in enumerate(clips.curves):
        phases = curve.start + curve.duration * np.arange(_ROWS) / _ROWS
        lap = memory.copy()
        lap[RIVER] = river
        poses_along(kind, params, lap, stylus_path(curve.point(phases)), poses)
        for i, pose in enumerate(poses):
            data.qpos[:] = pose
            mujoco.mj_kinematics(figure, data)
            mujoco.mj_comPos(figure, data)
            centre[i], contacts[i] = data.subtree_com[1, :2], data.geom_xpos[feet]
        contacts[..., 2] -= CONTACT_RADIUS
        touch = contacts[..., 2] < _TOUCH
        missing = np.linalg.norm(nearest_supported(centre, contacts, _SHARE) - centre, axis=1)
        missing[~touch.any(axis=1)] = _FLIES
        # FOOT_CONTACTS has the four of the left foot first.
        good = (missing == 0.0) & touch[:, :4].any(axis=1) & touch[:, 4:].any(axis=1)
        rests.append(phases[good] if good.any() else phases[[missing.argmin()]])
    return clips.with_rests(rests)
