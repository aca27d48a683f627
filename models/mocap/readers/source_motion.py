"""A motion on its source skeleton: what the readers return, before any retargeting."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from geometry import quaternions
from geometry.arrays import Array

MAX_GAP_TIME = 0.1  # longest gap that is interpolated [s]
_MAX_ZERO_ROTATION = 1e-4  # half the largest angle [rad] that counts as zero: files have four decimals


@dataclass(frozen=True, eq=False)
class SourceMotion:
    """Joint rotations and offsets per frame, in the file's own axes and unit of length.

    With all rotations zero every joint's frame is parallel to the file's axes, so a joint's global rotation is its
    rotation from that zero pose.

    Attributes
    ----------
    path : Path
        The file it was read from.
    joints : tuple of str
        Names as the file gives them; a parent comes before its children.
    parents : tuple of int
        Index of each joint's parent; −1 for the first.
    offsets : array of shape (joints, 3)
        From the parent to the joint in the zero pose, in the file's unit.
    tips : array of shape (joints, 3)
        From the joint to the end of its segment (End Site, ASF bone); zero where the file gives none.
    rotations : array of shape (frames, joints, 4)
        Rotation of each joint relative to its parent, unit quaternions wxyz.
    translations : array of shape (frames, joints, 3)
        From the parent to the joint in the parent's frame: the offset, unless the file moves the joint.
    fps : float
        Frames per second [1/s].
    unit : float or None
        The file's unit of length [m], if the format defines it.
    up : str or None
        The file's axis that points up, such as ``+Y``, if the format defines it.
    loops : bool or None
        Whether the motion is cyclic, if the file states it.
    timed : bool
        Whether the file states its frame rate.
    remarks : tuple of str
        Faults of the file that did not prevent reading it.
    further_tips : mapping from joint to array of shape (m, 3)
        Further ends of a segment, such as those of a foot with heel and toes.
    """

    path: Path
    joints: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: Array
    tips: Array
    rotations: Array
    translations: Array
    fps: float
    unit: float | None
    up: str | None = None
    loops: bool | None = None
    timed: bool = True
    remarks: tuple[str, ...] = ()
    further_tips: Mapping[int, Array] = field(default_factory=dict[int, Array])

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return len(self.rotations)

    def at_rest(self, joints: Sequence[int]) -> npt.NDArray[np.bool_]:
        """Frames in the zero pose: none of these joints is rotated, though some are in other frames; shape (n,)."""
        turned = np.abs(self.rotations[:, list(joints), 1:]).max(axis=2, initial=0.0) > _MAX_ZERO_ROTATION
        return ~turned.any(axis=1) & turned.any()

    @property
    def still_joints(self) -> frozenset[int]:
        """Joints that do not turn relative to their parents in any frame."""
        turns = np.ptp(self.rotations, axis=0).max(axis=1)
        return frozenset(int(joint) for joint in np.flatnonzero(turns < _MAX_ZERO_ROTATION))

    def of_joints(self, kept: Sequence[int]) -> "SourceMotion":
        """The motion of some joints in the given order; each joint's parent must be among them."""
        new = {-1: -1} | {joint: k for k, joint in enumerate(kept)}
        chosen = list(kept)
        return replace(
            self,
            joints=tuple(self.joints[joint] for joint in kept),
            parents=tuple(new[self.parents[joint]] for joint in kept),
            offsets=self.offsets[chosen],
            tips=self.tips[chosen],
            further_tips={new[joint]: tips for joint, tips in self.further_tips.items() if joint in new},
            rotations=self.rotations[:, chosen],
            translations=self.translations[:, chosen],
        )

    def global_rotations(self) -> Array:
        """Rotation of every joint from the zero pose in the file's axes, shape (frames, joints, 4)."""
        rotations = np.empty_like(self.rotations)
        for joint, parent in enumerate(self.parents):
            local = self.rotations[:, joint]
            rotations[:, joint] = local if parent < 0 else quaternions.product(rotations[:, parent], local)
        return rotations

    def global_positions(self, rotations: Array) -> Array:
        """Positions of the joints in the file's axes and unit, from global rotations; shape (frames, joints, 3)."""
        positions = np.empty_like(self.translations)
        for joint, parent in enumerate(self.parents):
            step = self.translations[:, joint]
            if parent >= 0:
                step = positions[:, parent] + quaternions.rotated(rotations[:, parent], step)
            positions[:, joint] = step
        return positions
