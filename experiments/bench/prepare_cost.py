"""Cost of preparing captures, relative to the duration of the clips and to simulating them."""

import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d

from experiments.preparation.followed import followed
from models.humanoid.skeleton import N_TANGENT
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip
from models.mocap.preparation.poses import plus
from models.mocap.preparation.prepare import prepared
from models.mocap.readers.own_bvh import write_bvh

_CLIPS = ("walk", "run", "jump", "squat_dance")  # gaits, a flight, and a dance in place
# Error of joints [rad] and of the root [m], RMS, and its correlation time [s]: soles then slide and hover by
# centimetres, as those of captures do.
_TURNED, _MOVED, _SLOW = np.deg2rad(2.0), 0.01, 0.1
_SECONDS = 5.0  # for which the physical figure follows each [s]


class PrepareCost(NamedTuple):
    """Processor time of preparing.

    Attributes
    ----------
    clip : float
        Over the duration of the prepared clips.
    simulating : float
        Over that of simulating the physical figure that follows them, for as long.
    """

    clip: float
    simulating: float


def prepare_cost() -> PrepareCost:
    """Prepare embedded clips with errors as of captures, and let the physical figure follow them."""
    rng = np.random.default_rng(0)
    took = lasts = simulated = 0.0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "capture.bvh"
        for number, name in enumerate((_CLIPS[0], *_CLIPS)):
            write_bvh(_captured(embedded(name), rng), path)
            made = prepared(path)
            cost = followed(made.clip, _SECONDS).cost
            if number == 0:
                continue  # compiles
            took, lasts = took + made.seconds, lasts + made.clip.duration
            simulated += made.clip.duration * cost
    return PrepareCost(took / lasts, took / simulated)


def _captured(clip: Clip, rng: np.random.Generator) -> Clip:
    """The motion with smooth random errors of the root and all joints, and so with open ends."""
    scale = np.where(np.arange(N_TANGENT) < 3, _MOVED, _TURNED)
    errors = gaussian_filter1d(rng.normal(size=(clip.n_frames, N_TANGENT)), _SLOW * clip.fps, axis=0)
    return Clip(plus(clip.poses, scale * errors / errors.std(axis=0)), clip.fps, clip.name)
