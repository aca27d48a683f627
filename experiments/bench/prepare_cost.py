"""Cost of preparing captures, relative to the duration of the clips and to simulating them."""

import tempfile
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter1d

from experiments.preparation.tracking_trial import followed
from models.humanoid.skeleton import N_TANGENT
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip
from models.mocap.preparation.poses import add_tangents
from models.mocap.preparation.prepare import prepared
from models.mocap.readers.own_bvh import write_bvh

_CLIPS = ("walk", "run", "jump", "squat_dance")  # gaits, a flight, and a dance in place
# RMS error of joints [rad] and of the root [m], and its correlation time [s]: the soles then slide and hover by
# centimetres, as in captures.
_JOINT_ERROR, _ROOT_ERROR, _CORRELATION_TIME = np.deg2rad(2.0), 0.01, 0.1
_FOLLOWING_TIME = 5.0  # [s] for which the physical figure follows each clip


def prepare_cost() -> tuple[float, float]:
    """Prepare clips with errors like those of captures, and let the physical figure follow them for as long.

    Returns the processor time of preparing, over the clips' duration and over the processor time of following.
    """
    rng = np.random.default_rng(0)
    preparing_time = clip_time = simulating_time = 0.0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "capture.bvh"
        for number, name in enumerate((_CLIPS[0], *_CLIPS)):
            write_bvh(_add_capture_errors(embedded(name), rng), path)
            result = prepared(path)
            cost = followed(result.clip, _FOLLOWING_TIME).cost
            if number == 0:
                continue  # warm-up: compiles
            preparing_time, clip_time = preparing_time + result.seconds, clip_time + result.clip.duration
            simulating_time += result.clip.duration * cost
    return preparing_time / clip_time, preparing_time / simulating_time


def _add_capture_errors(clip: Clip, rng: np.random.Generator) -> Clip:
    """The clip with smooth random errors of the root and of all joints, so that its ends do not match."""
    scale = np.where(np.arange(N_TANGENT) < 3, _ROOT_ERROR, _JOINT_ERROR)
    errors = gaussian_filter1d(rng.normal(size=(clip.n_frames, N_TANGENT)), _CORRELATION_TIME * clip.fps, axis=0)
    return Clip(add_tangents(clip.poses, scale * errors / errors.std(axis=0)), clip.fps, clip.name)
