"""Frames that repeat the one before, as where a camera or a tracker lost some, or a program changed the frame rate."""

import numpy as np

from geometry.arrays import Mask
from geometry.spans import spans
from models.mocap.readers.source_motion import SourceMotion
from models.mocap.retargeting.broken_frames import MAX_GAP_TIME, MIN_FRAME_COUNT, interpolated


def without_repeated_frames(motion: SourceMotion) -> tuple[SourceMotion, Mask]:
    """The motion with frames interpolated that repeat the one before, and which frames (n,) these are.

    All numbers of a repeated frame are those of the frame before, for up to `MAX_GAP_TIME`. At both ends a pose may be
    held on purpose, as for calibration.
    """
    repeated = np.zeros(motion.n_frames, dtype=bool)
    if motion.n_frames < MIN_FRAME_COUNT:
        return motion, repeated
    repeated[1:] = (motion.rotations[1:] == motion.rotations[:-1]).all(axis=(1, 2))
    repeated[1:] &= (motion.translations[1:] == motion.translations[:-1]).all(axis=(1, 2))
    for start, end in spans(repeated):
        if end - start > max(1.0, MAX_GAP_TIME * motion.fps) or start == 1 or end == motion.n_frames:
            repeated[start:end] = False
    return interpolated(motion, repeated), repeated
