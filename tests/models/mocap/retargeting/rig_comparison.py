"""The figure's motion from a rig, compared with that from a plain rig and with the source.

Trunk, head, hands and feet, whose orientations in a rig's frames are calibrated from the motion, are compared with
those of a plain rig, which has the rest pose of the figure and lacks the same parts; limbs and the path of the root
with the source. They are compared before the figure is placed on the floor, where ankles bend to keep toes above it by
as much as the proportions of the legs require. What a remark calls a guess is not compared.
"""

from typing import NamedTuple

import numpy as np

from geometry import quaternions
from models.humanoid.skeleton import BODIES
from models.mocap.library import embedded, embedded_names, load
from models.mocap.motion.clip import Clip
from models.mocap.motion.kinematics import global_rotations
from models.mocap.readers.formats import READABLE_SUFFIXES
from tests.captures import MOCAP

MAX_ANGLE = 2.0  # deg
MAX_ROOT_DEVIATION = 0.01  # largest distance of the root from its path in the source [m per m of leg]
MAX_SOLE_DEVIATION = 0.01  # largest change of height on the floor [m]
LEG_LENGTH = 0.86  # leg length of the figure [m]
LIMBS = {"upper_arm": (0.0, 1.0, 0.0), "forearm": (0.0, 1.0, 0.0), "thigh": (0.0, 0.0, -1.0), "shank": (0.0, 0.0, -1.0)}


class Motions:
    """Source motions at 24 to 60 frames per second, whole or parts of 1 s: embedded clips, and captures if present."""

    def __init__(self):
        files = [path for folder in ("animated_drawings", "cmu_amc", "cmu_bvh", "deepmimic", "snu", "xia")
                 for path in sorted((MOCAP / folder).glob("*")) if path.suffix in READABLE_SUFFIXES]  # fmt: skip
        skipped = ("humanoid3d_character.txt", "xia_rest_1frame.bvh")
        self.files = {path.name: path for path in files if path.name not in skipped}
        self._clips = {}

    def clip(self, name, fps=40.0):
        if name not in self._clips:
            motion = embedded(name) if name in embedded_names() else load(self.files[name]).clip
            self._clips[name] = Clip(motion.poses[: int(5.0 * motion.fps)], motion.fps, name)
        motion = self._clips[name]
        every = max(1, round(motion.fps / fps))
        return Clip(motion.poses[::every][:160], motion.fps / every, name)

    def random_clip(self, rng):
        name = str(rng.choice([*embedded_names(), *embedded_names(), *self.files]))
        motion = self.clip(name, float(rng.choice([24.0, 25.0, 30.0, 40.0, 60.0])))
        second = round(motion.fps)
        if rng.random() < 0.4 and motion.n_frames > second:
            first = int(rng.integers(motion.n_frames - second))
            motion = Clip(motion.poses[first : first + second], motion.fps, f"{name} from frame {first} on")
        return motion


class CalibratedMotion(NamedTuple):
    """A file's motion before the figure is placed on the floor (root, segments) and after (clip), and its remarks."""

    root: np.ndarray
    segments: np.ndarray
    clip: Clip
    remarks: str


class Deviation(NamedTuple):
    """Deviation of segments [deg] and of heights on the floor, `soles` [m], from those of a plain rig; of limbs [deg]
    and root [m per m of leg] from the source. It is 0 where the report calls the value a guess.
    """

    segments: float
    limbs: float
    root: float
    soles: float

    def exceeds_bounds(self):
        return (
            max(self.segments, self.limbs) >= MAX_ANGLE
            or self.root >= MAX_ROOT_DEVIATION
            or self.soles >= MAX_SOLE_DEVIATION
        )


def deviation_of(ours, plain, clip):
    """The Deviation of a CalibratedMotion from that of a plain rig and from the clip."""
    guessed = ours.remarks + plain.remarks
    soles = "soles' orientation is estimated" in guessed
    limbs_without_end = {
        body for body in BODIES if body.replace("_", " ") in guessed.partition("does not define the ends of")[2]
    }
    judged = [k for k, body in enumerate(BODIES) if not (soles and body.endswith("foot"))]
    assert ours.segments.shape == plain.segments.shape
    difference = quaternions.logarithm(quaternions.product(quaternions.conjugate(plain.segments), ours.segments))
    segments = np.quantile(np.linalg.norm(difference, axis=2), 0.95, axis=0)[judged].max()
    source = global_rotations(clip.poses)
    limbs = [(k, np.array(axis)) for k, body in enumerate(BODIES) for part, axis in LIMBS.items()
             if body.endswith(part) and body not in limbs_without_end]  # fmt: skip
    source_limbs, rig_limbs = (np.stack([quaternions.rotated(s[:, k], axis) for k, axis in limbs], axis=1)
                     for s in (source, ours.segments))  # fmt: skip
    # The heading is that of the pelvis, which is calibrated: a turn about the vertical does not count.
    half = (
        np.arctan2(np.sum(np.cross(source_limbs, rig_limbs)[..., 2]), np.sum((source_limbs * rig_limbs)[..., :2])) / 2.0
    )
    turn = np.array([np.cos(half), 0.0, 0.0, np.sin(half)])
    angles = np.arccos(np.clip(np.sum(quaternions.rotated(turn, source_limbs) * rig_limbs, axis=2), -1.0, 1.0))
    path = quaternions.rotated(turn, clip.poses[:, :3] - clip.poses[0, :3])
    # Repaired frames and a removed floor slope change the path, with a remark.
    path_changed = "did not belong" in guessed or "floor slopes" in guessed
    root = 0.0 if path_changed else np.linalg.norm(ours.root - path, axis=1).max() / LEG_LENGTH
    heights = np.abs(ours.clip.poses[:, 2] - plain.clip.poses[:, 2]).max()
    return Deviation(np.rad2deg(segments), np.rad2deg(np.quantile(angles, 0.95, axis=0).max()), root,
               0.0 if soles or path_changed else heights)  # fmt: skip


def assert_same_motion(deviation):
    assert not isinstance(deviation, str), deviation
    assert not deviation.exceeds_bounds(), deviation
