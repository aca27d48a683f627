"""Rest phases of clips: statically balanced poses, at which the figure can stop when the hand leaves all rivers."""

import mujoco
import numpy as np
import numpy.typing as npt

from controllers.haptic_map.river_clips import RiverClips
from controllers.haptic_map.river_memory import ACTIVE_RIVER
from controllers.legs.sole_heights import STANCE_HEIGHT, SWING_HEIGHT
from controllers.state import stylus_path
from models.humanoid.skeleton import CONTACT_RADIUS, FOOT_CONTACTS
from models.mocap.dynamics.zero_moment_point import nearest_supported
from sim.reference.reference import map_poses

_LAP_SAMPLES = 96  # samples of a lap of the hand
_SUPPORT_SCALE = 0.8  # the centre of mass is to lie over the support scaled by this factor about its middle
_FLIGHT_DISTANCE = 1.0  # [m] distance assigned to phases in flight, larger than any other


def with_rests(clips: RiverClips, figure: mujoco.MjModel) -> RiverClips:
    """The same map with the phases at which its clips can stop.

    These are the phases with both feet on the floor and the centre of mass over the support, or else the one phase at
    which the centre of mass is nearest to it.

    Parameters
    ----------
    clips : RiverClips
        Map with limbs.
    figure : mujoco.MjModel
        Model of the figure alone.
    """
    data, feet = mujoco.MjData(figure), [figure.geom(name).id for name in FOOT_CONTACTS]
    rows = clips.laps * _LAP_SAMPLES
    centre, contacts = np.empty((rows, 2)), np.empty((rows, len(feet), 3))
    rests: list[npt.NDArray[np.float64]] = []
    for river, curve in enumerate(clips.curves):
        phases = curve.start + curve.duration * np.arange(rows) / _LAP_SAMPLES
        memory = clips.compiled().memory
        memory[ACTIVE_RIVER] = river
        for i, pose in enumerate(map_poses(clips, stylus_path(curve.point(phases)), memory)):
            data.qpos[:] = pose
            mujoco.mj_kinematics(figure, data)
            mujoco.mj_comPos(figure, data)
            centre[i], contacts[i] = data.subtree_com[1, :2], data.geom_xpos[feet]
        contacts[..., 2] -= CONTACT_RADIUS
        touching = contacts[..., 2] < STANCE_HEIGHT
        nearest = nearest_supported(centre, contacts[..., :2], contacts[..., 2] < SWING_HEIGHT, _SUPPORT_SCALE)
        distance = np.linalg.norm(nearest - centre, axis=1)
        distance[~touching.any(axis=1)] = _FLIGHT_DISTANCE
        # FOOT_CONTACTS begins with the four points of the left foot.
        can_rest = (distance == 0.0) & touching[:, :4].any(axis=1) & touching[:, 4:].any(axis=1)
        rests.append(phases[can_rest] if can_rest.any() else phases[[distance.argmin()]])
    return clips.with_rest_phases(rests)
