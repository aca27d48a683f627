"""A pose that programs put in front of a motion, such as a T-pose in frame 0: found, so that it can be left out.

It is parted from the motion by one step that no step of the motion comes near.
"""

from dataclasses import replace

import numpy as np

from models.mocap import quaternions
from models.mocap.readers.source_motion import SourceMotion

_SHARE = 0.25  # of a motion that may be such a pose, held
_TIMES = 5.0  # a jump is so much larger than all but 1 % of the steps ...
_TURN = np.deg2rad(5.0)  # ... and more than this, RMS over the joints [rad]: no body turns so far in a frame
_FEWEST = 10  # frames that tell what is usual


def without_leading_pose(motion: SourceMotion) -> tuple[SourceMotion, int]:
    """The motion without a pose in front that does not belong to it, and how many frames that was."""
    n = motion.n_frames
    if n < _FEWEST:
        return motion, 0
    turns = quaternions.logarithm(
        quaternions.product(quaternions.conjugate(motion.rotations[:-1]), motion.rotations[1:])
    )
    steps = np.sqrt((turns**2).sum(axis=2).mean(axis=1))
    early = steps[: max(1, int(_SHARE * n))]
    jump = int(np.argmax(early))
    usual = np.quantile(np.delete(steps, jump), 0.99)
    # A held pose is still: where the motion runs on before the jump, the jump is a fault of the motion itself.
    held = steps[:jump].max(initial=0.0) < 0.1 * steps[jump]
    if not held or steps[jump] < max(_TIMES * usual, _TURN):
        return motion, 0
    first = jump + 1
    rest = replace(motion, rotations=motion.rotations[first:], translations=motion.translations[first:])
    return rest, first
