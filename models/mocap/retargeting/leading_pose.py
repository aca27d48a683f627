"""Detection and removal of a calibration pose in front of a motion, such as a T-pose in frame 0.

The pose is separated from the motion by one step far larger than any step of the motion.
"""

from dataclasses import replace

import numpy as np

from models.mocap import quaternions
from models.mocap.readers.source_motion import SourceMotion

_SHARE = 0.25  # largest share of a motion that may be such a pose, held
_TIMES = 5.0  # least ratio of the jump to the 99th percentile of the steps
_TURN = np.deg2rad(5.0)  # least jump, RMS over the joints [rad]: no body turns so far in a frame
_FEWEST = 10  # least number of frames that define usual steps


def without_leading_pose(motion: SourceMotion) -> tuple[SourceMotion, int]:
    """The motion without the frames of a calibration pose in front, and the number of these frames."""
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
    # A calibration pose is held still; if there is motion before the jump, the jump is a fault of the capture.
    held = steps[:jump].max(initial=0.0) < 0.1 * steps[jump]
    if not held or steps[jump] < max(_TIMES * usual, _TURN):
        return motion, 0
    first = jump + 1
    rest = replace(motion, rotations=motion.rotations[first:], translations=motion.translations[first:])
    return rest, first
