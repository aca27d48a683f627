"""Calibration of a rig's soles: a foot that stands on heel and toes has a level sole, and points along its toes."""

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from models.arrays import Array
from models.mocap.motion import quaternions
from models.mocap.retargeting.body_lines import AT_REST, BodyLines, unit
from models.mocap.retargeting.segment_frames import carried

_X, _Z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
_TURNS = 1.5  # angular velocity above which a foot rolls over heel or toe [rad/s]: 3 to 8 in a walk
_PATIENCE = (1.0, 2.0, 4.0)  # factors on it and `AT_REST`, tried in turn: runs, and 16 frames a second, need more
# Height of an ankle over the lowest ones of the motion, with the heel on the floor [leg lengths]: half of it turns
# the joints of 19 captures by 0.5° RMS, twice by 0.02°.
_LOW = 0.05
_ALIKE = np.deg2rad(5.0)  # difference of sole normals that count as equal: captured soles roll by 2 to 3° in stance
# Largest angle of a sole from what ankle or toes let expect [rad]: from the mean ankle up to 25° in the 28 captures of
# docs/validation/prepared-captures.md, 30° in one of fifty others. A squat on the toes, and single poses with a foot in
# the air, have 37 to 114°.
_STRANGE = np.deg2rad(35.0)
# Angle of the line from ankle to toes beneath the sole [rad]: 21° in the median, 15 to 28 in half of 329 feet.
_PITCH = np.deg2rad(21.0)
# Difference of toes from `_PITCH` within which a sole lies, in how many stance frames at least, and its largest angle
# to what the ankle lets expect then. In lunges that are held ankles are bent throughout: five feet of some 720 captures
# by 37 to 59°, with toes 3 to 15° off. Feet of bodies that lie there have toes 16 to 28° off or rest for 3 or 4 frames.
_LIES, _LASTS, _BENT = np.deg2rad(16.0), 8, np.deg2rad(65.0)
_SHIFTS = 20  # iterations of the mean shift to the mode of a sole's normals: half or twice changes none of 17 captures
# Standard deviation of a sole's likely inclination about that of the mean ankle: half or twice turns the joints of 19
# captures by 0.3 or 0.2° RMS, in one of them by 3.5°.
_ANKLE = np.deg2rad(20.0)
# Least component of the toes' direction along the sole from which a foot's heading is taken: half or twice changes
# none of 19 captures.
_POINTING = 0.3
# Least number of frames from which a sole's orientation is taken: with 2 the joints of one of 17 captures turn by 0.7°
# RMS, with 6 those of a run, whose stances are short, by 4.6°.
_LEAST = 3


def flat_frames(lines: BodyLines, k: int, source: Array, up: Array, fps: float) -> npt.NDArray[np.intp]:
    """Frames in which a foot stands on heel and toes: at rest, with its ankle near the lowest of the motion.

    By the file's joints, since the figure's soles, and with them `contacts`, follow from these frames. The feet of a
    body that walks on the spot stand where they move with the ground under it. A pose that is held without any change,
    as programs fill a motion up, counts once, if others stand.
    """
    n = len(source)
    if n == 1:
        return np.array([0])
    held = lines.filled(fps)
    places = [lines.lowest_joints[:, k]]
    if not np.isnan(lines.toes[:, k]).any():
        places.append(lines.toes[:, k])
    turning = np.linalg.norm(quaternions.velocities(source, fps), axis=1)
    heights = lines.lowest_joints @ up
    low = heights[:, k] < np.quantile(heights[~held].min(axis=1), 0.05) + _LOW * lines.leg
    ground = _ground(lines, up, fps)
    off = [np.linalg.norm(np.gradient(place, axis=0) - ground, axis=1) for place in places]
    passing = np.max(off, axis=0) * fps / lines.leg
    for counted in (~held, np.ones(n, dtype=np.bool_)):
        for factor in _PATIENCE:
            flat = np.flatnonzero(counted & low & (passing < factor * AT_REST) & (turning < factor * _TURNS))
            if len(flat) >= _LEAST:
                return flat
    return np.zeros(0, dtype=np.intp)


def _ground(lines: BodyLines, up: Array, fps: float) -> Array:
    """Displacement per frame of the ground under a body that walks on the spot, as on a treadmill; else 0, shape (3,).

    It is that of the lower ankle in the median, if that ankle moves with it more often than it rests.
    """
    n, ankles, rest = len(lines.middle), lines.lowest_joints, AT_REST * lines.leg / fps
    lower = np.gradient(ankles, axis=0)[np.arange(n), np.argmin(ankles @ up, axis=1)]
    carried = np.median(lower, axis=0)
    carried = carried - (carried @ up) * up
    travels = np.linalg.norm(lines.middle[-1] - lines.middle[0]) > n * rest
    still, moved = (np.sum(np.linalg.norm(lower - ground, axis=1) < rest) for ground in (0.0, carried))
    return carried if not travels and moved > still and np.linalg.norm(carried) > rest else np.zeros(3)


def calibrated_foot(
    source: Array, toes: Array, shank: Array, up: Array, flat: npt.NDArray[np.intp], straight: Array
) -> tuple[Array, int]:  # fmt: skip
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
        Stance frames, as of `flat_frames`.
    straight : array of shape (frames,)
        Weights of the frames, by how nearly thighs and trunk are in line: ankles are likely near their rest pose there.

    Returns
    -------
    rotations : array of shape (frames, 4)
    used : int
        Number of stance frames from which the sole's normal is taken; 0 if it is a guess, by an ankle in rest
        pose or the toes of a single pose.
    """
    back = quaternions.conjugate(source)
    resting = carried(source, shank, straight)
    neutral, forward = (quaternions.rotated(back, quaternions.rotated(resting, axis))[0] for axis in (_Z, _X))
    ahead = quaternions.rotated(back, unit(toes)).mean(axis=0)
    # A single pose has no mean ankle, and its feet may hang: they stand if that is how their toes lie.
    single, has_toes = len(source) == 1, bool(np.isfinite(ahead).all())
    expected = _along_toes(ahead, np.cross(neutral, forward)) if single and has_toes else neutral
    flat = flat if has_toes or not single else flat[:0]
    normal, used = _normal(quaternions.rotated(back[flat], up), neutral, min(_LEAST, len(source)))
    off = np.abs(np.arcsin(np.clip(-normal @ unit(ahead), -1.0, 1.0)) - _PITCH)
    lies = used >= _LASTS and bool(off < _LIES)
    if used == 0 or normal @ expected < np.cos(_BENT if lies else _STRANGE):
        normal, used = expected, 0
    x = ahead - normal * (ahead @ normal)
    if not np.linalg.norm(x) >= _POINTING:  # no toes, or toes below the ankle: the heading of the shank
        x = forward - normal * (forward @ normal)
    x = unit(x)
    columns = np.column_stack((x, np.cross(normal, x), normal))
    constant = np.asarray(Rotation.from_matrix(columns).as_quat(scalar_first=True))
    return quaternions.product(source, constant), used


def _along_toes(toes: Array, left: Array) -> Array:
    """Normal of a sole whose toes are `_PITCH` beneath it; unit vector to the toes, and about to the left."""
    left = unit(left - toes * (left @ toes))
    return np.cos(_PITCH) * np.cross(toes, left) - np.sin(_PITCH) * toes


def _normal(vertical: Array, neutral: Array, least: int) -> tuple[Array, int]:
    """Normal of a sole in the axes of the file's foot, and the number of frames from which it is taken.

    `vertical` (m, 3) is the vertical in the stance frames, `neutral` the normal of an ankle in rest pose on average:
    the result where fewer than `least` frames agree.
    """
    alike = vertical[:: 1 + len(vertical) // 500] @ vertical.T > np.cos(_ALIKE)
    # Captured feet that roll with spread legs give two clusters of normals: the one nearer to a neutral ankle is right.
    likely = np.exp(-((np.arccos(np.clip(vertical @ neutral, -1.0, 1.0)) / _ANKLE) ** 2) / 2.0)
    used = alike[np.argmax(alike @ likely)] if len(vertical) else np.zeros(0, dtype=bool)
    if used.sum() < least:
        return neutral, 0
    # Mean shift to the mode of the likely normals: a frame more or less of a rolling foot changes it little.
    normal = unit(vertical[used].mean(axis=0))
    for _ in range(_SHIFTS):
        near = np.exp(-((np.arccos(np.clip(vertical @ normal, -1.0, 1.0)) / _ALIKE) ** 2) / 2.0)
        normal = unit((near * likely) @ vertical)
    return normal, int(used.sum())
