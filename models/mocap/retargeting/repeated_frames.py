"""Frames that repeat the one before, as where a camera or a tracker lost some, or a program changed the frame rate."""

from dataclasses import replace

import numpy as np

from geometry.arrays import Mask
from geometry.spans import spans
from models.mocap.readers.source_motion import MAX_GAP_TIME, SourceMotion
from models.mocap.retargeting.broken_frames import MIN_FRAME_COUNT, interpolated

_THROUGHOUT = 0.1  # share of the frames: 24 frames a second among 30 repeat a fifth, 25 among 30 a sixth


def without_repeated_frames(motion: SourceMotion) -> tuple[SourceMotion, Mask]:
    """The motion with frames interpolated that repeat the one before, and which frames (n,) these are.

    All numbers of a repeated frame are those of the frame before, for up to `MAX_GAP_TIME`. At both ends a pose may be
    held on purpose, as for calibration, unless frames are repeated throughout; then those at the end are left out.
    """
    repeated = np.zeros(motion.n_frames, dtype=bool)
    if motion.n_frames < MIN_FRAME_COUNT:
        return motion, repeated
    repeated[1:] = (motion.rotations[1:] == motion.rotations[:-1]).all(axis=(1, 2))
    repeated[1:] &= (motion.translations[1:] == motion.translations[:-1]).all(axis=(1, 2))
    runs = [run for run in spans(repeated) if run[1] - run[0] <= max(1.0, MAX_GAP_TIME * motion.fps)]
    throughout = sum(end - start for start, end in runs) > _THROUGHOUT * motion.n_frames
    repeated[:] = False
    for start, end in runs:
        if end == motion.n_frames and throughout:
            motion = replace(motion, rotations=motion.rotations[:start], translations=motion.translations[:start])
            repeated = repeated[:start]
        elif end < motion.n_frames and (start > 1 or throughout):
            repeated[start:end] = True
    return interpolated(motion, repeated), repeated
