"""Calibration of a rig's soles: a foot that stands on heel and toes has a level sole, and points along its toes."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from geometry import quaternions
from geometry.arrays import Array
from geometry.quaternions import unit
from models.mocap.retargeting.body_lines import AT_REST, BodyLines
from models.mocap.retargeting.segment_frames import with_constant_offset

_X, _Z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
_MAX_ANGULAR_SPEED = 1.5  # angular velocity above which a foot rolls over heel or toe [rad/s]: 3 to 8 in a walk
_SPEED_FACTORS = (1.0, 2.0, 4.0)  # factors on it and on `AT_REST`, tried in turn: runs and 16 frames a second need more
# Largest height of an ankle above the lowest ones of the motion, if the heel is on the floor [leg lengths]: half the
# value turns the joints of 19 captures by 0.5° RMS, twice by 0.02°.
_MAX_ANKLE_HEIGHT = 0.05
# Difference of sole normals that count as equal: captured soles roll by 2 to 3° in stance.
_NORMAL_TOLERANCE = np.deg2rad(5.0)
# Largest angle between a sole's normal and that expected from ankle or toes [rad]: from the mean ankle, up to 25° in
# the 28 captures of docs/validation/prepared-captures.md, and 30° in one of fifty others. A squat on the toes, and
# single poses with a foot in the air, have 37 to 114°.
_MAX_SOLE_ANGLE = np.deg2rad(35.0)
# Angle of the line from ankle to toes below the sole's plane [rad]: median 21°, 15 to 28° in half of 329 feet.
_TOE_PITCH = np.deg2rad(21.0)
MAX_TOE_PITCH = _TOE_PITCH + _MAX_SOLE_ANGLE
"""Angle of toes below a sole that stands, beyond which it is not the sole that is expected above them [rad]: 56°.

Of 404 feet with toe joints and reliable soles eleven exceed it: ten in high heels (61 to 63°), one that hangs (65°).
"""
# Least number of stance frames for a reliable sole: with fewer, it differs by up to 25° on legs 0.6 to 1.6 as long.
MIN_FLAT_FRAMES = 8
# A sole that is reliable lies flat if its toes differ from `_TOE_PITCH` by less than the first value; the second is
# then the largest angle to the expected normal. In held lunges, ankles are bent throughout: in five feet of some 720
# captures by 37 to 59°, with toes 3 to 15° off. Feet at such angles in lying bodies have toes 16 to 28° off, or rest
# for only 3 or 4 frames.
_TOE_PITCH_TOLERANCE, _MAX_BENT_SOLE_ANGLE = np.deg2rad([16.0, 65.0])
# Mean-shift iterations to the mode of a sole's normals: half or twice changes none of 17 captures.
_MEAN_SHIFT_COUNT = 20
# Standard deviation of a sole's inclination about that of the mean ankle: half or twice turns the joints of 19 captures
# by 0.3 or 0.2° RMS, in one of them by 3.5°.
_INCLINATION_SD = np.deg2rad(20.0)
# Least component along the sole of the toes' direction for a foot's heading to be taken from it: half or twice changes
# none of 19 captures.
_MIN_TOE_COMPONENT = 0.3
# Least number of frames from which a sole's orientation is taken: with 2 the joints of one of 17 captures turn by 0.7°
# RMS, with 6 those of a run, whose stances are short, by 4.6°.
_MIN_FRAME_COUNT = 3


def foot_flat_frames(lines: BodyLines, k: int, source: Array, up: Array, fps: float) -> npt.NDArray[np.intp]:
    """Frames in which a foot stands on heel and toes: at rest, with its ankle near the lowest of the motion.

    They are found from the file's joints, since the figure's soles, and with them `contacts`, follow from these frames.
    If a body walks on the spot, as on a treadmill, a foot stands while it moves with the ground. Padding (a pose that
    is held without any change) counts once, if the foot stands in other frames.
    """
    n = len(source)
    if n == 1:
        return np.array([0])
    padding = lines.padding(fps)
    places = [lines.lowest_joints[:, k]]
    if not np.isnan(lines.toes[:, k]).any():
        places.append(lines.toes[:, k])
    turning = np.linalg.norm(quaternions.velocities(source, fps), axis=1)
    heights = lines.lowest_joints @ up
    low = heights[:, k] < np.quantile(heights[~padding].min(axis=1), 0.05) + _MAX_ANKLE_HEIGHT * lines.leg
    ground = _ground_step(lines, up, fps)
    speeds = [np.linalg.norm(np.gradient(place, axis=0) - ground, axis=1) for place in places]
    slipping = np.max(speeds, axis=0) * fps / lines.leg
    for counted in (~padding, np.ones(n, dtype=np.bool_)):
        for factor in _SPEED_FACTORS:
            flat = np.flatnonzero(
                counted & low & (slipping < factor * AT_REST) & (turning < factor * _MAX_ANGULAR_SPEED)
            )
            if len(flat) >= _MIN_FRAME_COUNT:
                return flat
    return np.zeros(0, dtype=np.intp)


def _ground_step(lines: BodyLines, up: Array, fps: float) -> Array:
    """Displacement per frame of the ground under a body that walks on the spot, as on a treadmill; else 0, shape (3,).

    It is the median displacement of the lower ankle, if that ankle moves with it more often than it rests.
    """
    n, ankles, max_rest_step = len(lines.middle), lines.lowest_joints, AT_REST * lines.leg / fps
    lower = np.gradient(ankles, axis=0)[np.arange(n), np.argmin(ankles @ up, axis=1)]
    carried = np.median(lower, axis=0)
    carried = carried - (carried @ up) * up
    travels = np.linalg.norm(lines.middle[-1] - lines.middle[0]) > n * max_rest_step
    resting, drifting = (np.sum(np.linalg.norm(lower - ground, axis=1) < max_rest_step) for ground in (0.0, carried))
    return carried if not travels and drifting > resting and np.linalg.norm(carried) > max_rest_step else np.zeros(3)


class CalibratedFoot(NamedTuple):
    """A foot of the figure.

    Attributes
    ----------
    rotations : array of shape (frames, 4)
    used : int
        Number of stance frames from which the sole's normal is taken; 0 if it is guessed from an ankle in rest pose or
        from the toes of a single pose.
    has_heading : bool
        Whether its heading is that of its toes; otherwise it is the shank's.
    toe_pitch : float
        Angle of the line from ankle to toes below its sole [rad]; NaN if the file has no toes.
    """

    rotations: Array
    used: int
    has_heading: bool
    toe_pitch: float


def calibrated_foot(
    source: Array, toes: Array, shank: Array, up: Array, flat: npt.NDArray[np.intp], straight: Array,
    single: bool = False,
) -> CalibratedFoot:  # fmt: skip
    """Rotations of the figure's foot, whose sole is level in stance and which points along its toes.

    Parameters
    ----------
    source, shank : arrays of shape (frames, 4)
        Rotations of the file's foot and of the figure's shank.
    toes : array of shape (frames, 3)
        From the ankle to the toes, of any length; NaN if the file has no toes.
    up : array of shape (3,)
        Unit vector upwards.
    flat : array of int
        Stance frames, from `foot_flat_frames`.
    straight : array of shape (frames,)
        Weights of the frames, by how nearly thighs and trunk are in line: ankles are then likely near their rest pose.
    single : bool
        Whether the body holds one pose in all frames.
    """
    inverse = quaternions.conjugate(source)
    resting = with_constant_offset(source, shank, straight)
    neutral, forward = (quaternions.rotated(inverse, quaternions.rotated(resting, axis))[0] for axis in (_Z, _X))
    ahead = quaternions.rotated(inverse, unit(toes)).mean(axis=0)
    # A pose that is held has no mean ankle, and its feet may hang: whether they stand is decided by their toes.
    has_toes = bool(np.isfinite(ahead).all())
    expected = _normal_above_toes(ahead, np.cross(neutral, forward)) if single and has_toes else neutral
    normal, used = _sole_normal(quaternions.rotated(inverse[flat], up), neutral, min(_MIN_FRAME_COUNT, len(source)))
    pitch_error = abs(_toe_pitch(ahead, normal) - _TOE_PITCH)
    is_flat = used >= MIN_FLAT_FRAMES and pitch_error < _TOE_PITCH_TOLERANCE
    if used == 0 or normal @ expected < np.cos(_MAX_BENT_SOLE_ANGLE if is_flat else _MAX_SOLE_ANGLE):
        normal, used = expected, 0
    x = ahead - normal * (ahead @ normal)
    # No toes, or toes right below the ankle: use the heading of the shank.
    if not (has_heading := bool(np.linalg.norm(x) >= _MIN_TOE_COMPONENT)):
        x = forward - normal * (forward @ normal)
    x = unit(x)
    columns = np.column_stack((x, np.cross(normal, x), normal))
    constant = np.asarray(Rotation.from_matrix(columns).as_quat(scalar_first=True))
    return CalibratedFoot(quaternions.product(source, constant), used, has_heading, _toe_pitch(ahead, normal))


def _toe_pitch(toes: Array, normal: Array) -> float:
    """Angle of the toes' direction below a sole [rad]."""
    return float(np.arcsin(np.clip(-normal @ unit(toes), -1.0, 1.0)))


def _normal_above_toes(toes: Array, left: Array) -> Array:
    """Normal of a sole whose toes are `_TOE_PITCH` below it; unit vectors to the toes, and roughly to the left."""
    left = unit(left - toes * (left @ toes))
    return np.cos(_TOE_PITCH) * np.cross(toes, left) - np.sin(_TOE_PITCH) * toes


def _sole_normal(vertical: Array, neutral: Array, least: int) -> tuple[Array, int]:
    """Normal of a sole in the axes of the file's foot, and the number of frames from which it is taken.

    `vertical` (m, 3) is the vertical in the stance frames, `neutral` the mean normal of an ankle in rest pose: the
    result if fewer than `least` frames agree.
    """
    agreeing = vertical[:: 1 + len(vertical) // 500] @ vertical.T > np.cos(_NORMAL_TOLERANCE)
    # Feet that roll with spread legs give two clusters of normals: the one nearer to a neutral ankle is right.
    likelihood = np.exp(-((np.arccos(np.clip(vertical @ neutral, -1.0, 1.0)) / _INCLINATION_SD) ** 2) / 2.0)
    used = agreeing[np.argmax(agreeing @ likelihood)] if len(vertical) else np.zeros(0, dtype=bool)
    if used.sum() < least:
        return neutral, 0
    # Mean shift to the mode of the normals: a frame more or less of a rolling foot changes it little.
    normal = unit(vertical[used].mean(axis=0))
    for _ in range(_MEAN_SHIFT_COUNT):
        nearness = np.exp(-((np.arccos(np.clip(vertical @ normal, -1.0, 1.0)) / _NORMAL_TOLERANCE) ** 2) / 2.0)
        normal = unit((nearness * likelihood) @ vertical)
    return normal, int(used.sum())
