"""BVH on the figure's own skeleton: a writer with exactly its 57 channels, and recognition of such files.

Files are Y up, facing +Z, left = +X, in centimetres, as most programs expect of BVH: with world (x, y, z) in metres,
the file's (X, Y, Z) is 100 (y, z, x), a permutation of axes that loses no digit. The rotation order of each joint is
chosen so that its middle angle, which has gimbal lock at ±90°, moves least; a locked pose is still written exactly.
"""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from geometry.arrays import Array
from geometry.whole_files import atomic_file
from models.errors import ModelError
from models.humanoid.skeleton import DEFAULT_STATURE, SEGMENTS, figure_model
from models.mocap.motion.clip import Clip
from models.mocap.readers.source_motion import SourceMotion

_CENTIMETRES = 100.0  # in a metre: the file's unit of length, as is usual for BVH
# Tolerance of the skeleton's size: bones of a skeleton of 1 m have six digits after the point [cm].
_SIZE_TOLERANCE = 1e-6
_TIPS = {"head": (0.0, 0.0, 0.25), "left_wrist": (0.0, 0.175, 0.0), "right_wrist": (0.0, -0.175, 0.0),
         "left_ankle": (0.165, 0.0, -0.048), "right_ankle": (0.165, 0.0, -0.048)}  # fmt: skip
_TO_FILE = [1, 2, 0]  # file axis k is world axis _TO_FILE[k]
_FILE_AXES = {
    "own": np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    "Blender's": np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),  # Z up, facing −Y
}
"""Rotations from a file's axes to the world's: as written here, and as Blender exports the same skeleton."""


def _rotation_order(joint: str) -> tuple[int, int, int]:
    """File axes of a joint's rotations, first to last. World x, y, z are the file's Z, X, Y."""
    if joint == "root":
        return (1, 2, 0)  # turn, lean, then somersault: locks only when lying on a side
    if joint.endswith("shoulder"):
        return (2, 0, 1)  # raise, twist, swing: a twist rarely reaches 90°
    return (0, 2, 1)  # bend, lean, turn


def _euler_angles(q: Array, order: tuple[int, int, int]) -> Array:
    """Angles [rad] of intrinsic rotations about three different axes, shape (n, 3).

    Bernardes & Viollet (2022), without their threshold: in gimbal lock the split between the outer two angles is
    arbitrary, but the product of all three is still the rotation.
    """
    k, j, i = order  # intrinsic rotations are extrinsic ones in reverse
    sign = 1.0 if (i, j, k) in ((0, 1, 2), (1, 2, 0), (2, 0, 1)) else -1.0
    w, x, y, z = q[:, 0], q[:, 1 + i], q[:, 1 + j], sign * q[:, 1 + k]
    a, b, c, d = w - y, x + z, y + w, z - x
    middle = 2.0 * np.arctan2(np.hypot(c, d), np.hypot(a, b)) - np.pi / 2
    half_sum, half_difference = np.arctan2(b, a), np.arctan2(d, c)
    first, last = sign * (half_sum + half_difference), half_sum - half_difference
    return np.column_stack((first, middle, last))


def write_bvh(clip: Clip, path: Path) -> None:
    """Write a clip; reading it again gives the same poses to 1e-9 rad.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    write_bvh_blocks(path, clip.n_frames, clip.fps, [clip.poses])


def write_bvh_blocks(
    path: Path, n_frames: int, fps: float, blocks: Iterable[Array], stature: float = DEFAULT_STATURE
) -> None:
    """Write a motion given block by block, with memory independent of its length.

    Parameters
    ----------
    path : Path
        File to write.
    n_frames : int
        Total number of frames.
    fps : float
        Frames per second [1/s].
    blocks : iterable of array (k, 75)
        Poses, in order.
    stature : float
        Stature of the figure [m], which determines the bones.

    Raises
    ------
    ModelError
        If the blocks do not have n_frames frames in all.
    OSError
        If the file cannot be written.
    """
    written, last = 0, None
    with atomic_file(path) as file:
        header = [*_hierarchy(stature), "MOTION", f"Frames: {n_frames}", f"Frame Time: {1.0 / fps!r}"]
        file.write(("\n".join(header) + "\n").encode())
        for poses in blocks:
            angles = _joint_angles(poses, last)
            rows = np.hstack((poses[:, _TO_FILE] * _CENTIMETRES, np.rad2deg(angles)))
            file.writelines((" ".join(f"{value:.9f}" for value in row) + "\n").encode() for row in rows)
            written, last = written + len(poses), angles[-1:]
        if written != n_frames:
            raise ModelError(f"{path}: {written} frames were given; expected {n_frames}")


def _joint_angles(poses: Array, last: Array | None) -> Array:
    """Angles of all joints [rad], shape (k, 54), unwrapped; `last` (1, 54): those of the previous frame, if any."""
    columns: list[Array] = []
    for index, segment in enumerate(SEGMENTS):
        quaternion = poses[:, 3 + 4 * index : 7 + 4 * index]
        columns.append(
            _euler_angles(quaternion[:, [0, *(1 + axis for axis in _TO_FILE)]], _rotation_order(segment.joint))
        )
    angles = np.hstack(columns)
    if last is None:
        return np.unwrap(angles, axis=0)
    return np.unwrap(np.vstack((last, angles)), axis=0)[1:]


def _hierarchy(stature: float) -> list[str]:
    lines, model = ["HIERARCHY"], figure_model(stature)
    open_segments: list[int] = []
    for index, segment in enumerate(SEGMENTS):
        while open_segments and open_segments[-1] != segment.parent:
            open_segments.pop()
            lines.append("\t" * len(open_segments) + "}")
        channels = " ".join(f"{'XYZ'[axis]}rotation" for axis in _rotation_order(segment.joint))
        indent = "\t" * len(open_segments)
        # The model's pelvis has an offset, its rest height; the offset of a BVH root is 0.
        offset = model.body(segment.body).pos if index else np.zeros(3)
        positions = "3" if index else "6 Xposition Yposition Zposition"
        lines += [f"{indent}{'JOINT' if index else 'ROOT'} {segment.joint}", f"{indent}{{",
                  f"{indent}\tOFFSET {_vector(offset)}", f"{indent}\tCHANNELS {positions} {channels}"]  # fmt: skip
        if segment.joint in _TIPS:
            tip = _vector(np.array(_TIPS[segment.joint]) * stature / DEFAULT_STATURE)
            lines += [f"{indent}\tEnd Site", f"{indent}\t{{", f"{indent}\t\tOFFSET {tip}", f"{indent}\t}}"]
        open_segments.append(index)
    return lines + ["\t" * depth + "}" for depth in reversed(range(len(open_segments)))]


def _vector(world: Array) -> str:
    return " ".join(f"{value:.6f}" for value in world[_TO_FILE] * _CENTIMETRES)


def own_clip(motion: SourceMotion) -> Clip | None:
    """The clip, if `write_bvh` wrote the file or Blender re-exported it (same joints and bones); else None.

    If the bones are those of a figure of another stature, it is the same motion on the default figure.
    """
    if motion.joints != tuple(segment.joint for segment in SEGMENTS):
        return None
    if motion.parents != tuple(segment.parent for segment in SEGMENTS):
        return None
    model = figure_model()
    bones = np.array([model.body(segment.body).pos for segment in SEGMENTS])[1:] * _CENTIMETRES
    size = float(np.linalg.norm(motion.offsets[1:]) / np.linalg.norm(bones))
    size = 1.0 if abs(size - 1.0) < _SIZE_TOLERANCE else size
    for turn in _FILE_AXES.values():
        if np.abs(motion.offsets[1:] @ turn.T - size * bones).max() <= 1e-4:
            quaternion = np.concatenate((motion.rotations[..., :1], motion.rotations[..., 1:] @ turn.T), axis=-1)
            position = motion.translations[:, 0] @ turn.T / (_CENTIMETRES * size)
            return Clip(np.hstack((position, quaternion.reshape(motion.n_frames, -1))), motion.fps, motion.path.stem)
    return None
