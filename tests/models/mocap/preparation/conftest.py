"""Motions that the tests of the preparation share."""

import numpy as np
import pytest

from models.mocap.library import embedded
from models.mocap.motion.clip import Clip
from models.mocap.preparation.poses import resampled


@pytest.fixture(scope="module")
def walks():
    """The embedded walk, and an excerpt of two and a half laps of it that starts anywhere."""
    walk = resampled(embedded("walk"), 120.0)
    rows = [walk.poses[:-1]]
    for _ in range(2):
        rows.append(walk.displacement.moved(rows[-1]))
    return walk, Clip(np.concatenate(rows)[37 : 37 + round(2.5 * walk.n_frames)], walk.fps, "walks")
