"""A check that the joints between a limb's part and its end, such as twist joints, lie on the bone.

Not in feet: between ankle and toes is the heel in some rigs (OpenSim's calcn), which turns with the foot.
"""

import numpy as np

from geometry.arrays import Array
from models.mocap.readers.motion_file import MotionFileError
from models.mocap.readers.source_motion import SourceMotion
from models.mocap.retargeting.skeleton_roles import Roles, ancestry

# Largest distance from the bone, as a fraction of its length: 0.05 in MakeHuman's thighs, less in other rigs with twist
# joints. A joint between pelvis and hip that is taken for the thigh has 0.08 to 0.12.
MAX_DISTANCE_RATIO = 0.07


def check_bones(motion: SourceMotion, roles: Roles, positions: Array) -> None:
    """Refuse a limb that bends at a joint where no part begins: the parts were then assigned to the wrong joints.

    Parameters
    ----------
    motion : SourceMotion
        The motion, for names and tree.
    roles : Roles
        Which joint plays which part.
    positions : array of shape (n, joints, 3)
        Positions of its joints.

    Raises
    ------
    MotionFileError
        If the median distance of a joint between a part and its end from the line between them is too large.
    """
    for part, end in roles.ends.items():
        if part.endswith("foot"):
            continue
        start = roles.segments[part]
        bone = positions[:, end] - positions[:, start]
        length = np.linalg.norm(bone, axis=1)
        for joint in ancestry(motion.parents[end], motion.parents):
            if joint == start:
                break
            moment = np.linalg.norm(np.cross(positions[:, joint] - positions[:, start], bone), axis=1)
            if np.median(moment) > MAX_DISTANCE_RATIO * np.median(length) ** 2:
                name, known = motion.joints[joint], f"{motion.joints[start]} and {motion.joints[end]}"
                what = f"the {part.replace('_', ' ')} bends at {name}, between {known}"
                raise MotionFileError(motion.path, 0, what, "known names, or --roles FILE")
