"""A limb of three joints, such as a leg: its geometry, its limits, and their packed form for kernels."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from controllers.errors import ParameterError
from controllers.state import Vec3
from geometry.arrays import Array

# A packed limb (`Limb.packed`): indices of its three joints, their offsets (3, 3), flexion axis, centre of the end's
# points, limits (3, 3, 2); for a limb that steps, the points of its sole follow (`footsteps`).
FIRST, MIDDLE, LAST, OFFSETS, AXIS, CENTRE, LIMITS, LIMB_SIZE = 0, 1, 2, 3, 12, 15, 18, 36
THIGH, SHANK = OFFSETS + 3, OFFSETS + 6  # offsets of the middle and the last joint: the limb's two segments
N_END_CHANNELS = 4  # channels that a limb adds to a clip: its end's position (3), λ (`limb_ends`)

_NO_LIMIT = 2.0 * np.pi  # [rad] beyond any rotation vector: no limit
# [rad] margin on the range that a clip uses, for poses between its frames: at 120 frames per second a joint that
# accelerates by a = 1000 rad/s² exceeds them by a Δt²/8 = 0.009 rad.
_RANGE_MARGIN = 0.01


@dataclass(frozen=True, eq=False)
class Limb:
    """Kinematic chain of three joints, such as hip, knee and ankle, the first on the root.

    Parameters
    ----------
    joints : tuple of three int
        Indices of the joints: joint k has the numbers 3 + 4k to 6 + 4k of a pose, the root is 0.
    offsets : Array, shape (3, 3)
        Origin of each joint in the segment before it, in the rest pose [m].
    axis : Vec3
        Flexion axis of the middle joint, in the frame of its own segment.
    points : Array, shape (k, 3)
        Points of the last segment that may touch the ground (sole), in its frame [m]; their centre is the end that the
        inverse kinematics places.
    limits : Array, shape (3, 3, 2), optional
        Limits of the components of the joints' rotation vectors (`joint_limits`) [rad]. By default there are none.

    Raises
    ------
    ParameterError
        If numbers are not finite, limits do not increase, or flexion cannot change the limb's length.
    """

    joints: tuple[int, int, int]
    offsets: Array
    axis: Vec3
    points: Array
    limits: Array = field(default_factory=lambda: np.tile([-_NO_LIMIT, _NO_LIMIT], (3, 3, 1)))

    def __post_init__(self) -> None:
        numbers = self.packed()
        if numbers.shape != (LIMB_SIZE,) or not np.isfinite(numbers).all():
            raise ParameterError(
                f"a limb has {LIMB_SIZE} finite numbers (joints 3, offsets 3 × 3, axis 3, centre 3, limits 3 × 3 × 2), "
                f"got {numbers.tolist()}"
            )
        if not (self.limits[..., 0] <= self.limits[..., 1]).all():
            raise ParameterError(f"the limits of a limb's joints must increase, got {self.limits.tolist()}")
        if min(self.joints) < 1 or len(set(self.joints)) != 3:
            raise ParameterError(f"a limb has three joints, counted from 1; got {self.joints}")
        for offset in self.offsets[1:]:
            if np.linalg.norm(np.cross(self.axis, offset)) < 1e-6:
                raise ParameterError(f"flexion about {self.axis} does not move a limb with offsets {self.offsets}")

    def packed(self) -> Array:
        """The limb packed for the kernel: joints, offsets, unit axis, centre of the points, limits; shape (36,)."""
        axis = np.asarray(self.axis, dtype=np.float64)
        unit = axis / max(float(np.linalg.norm(axis)), 1e-300)
        centre, limits = np.mean(self.points, axis=0), np.ravel(self.limits)
        return np.concatenate([self.joints, np.ravel(self.offsets), unit, centre, limits])

    def with_limits_for(self, clips: Sequence[Array]) -> "Limb":
        """The same limb with limits extended to include all poses of clips, each of shape (n, nq).

        Raises
        ------
        ParameterError
            If the poses lack one of its joints.
        """
        joint_count = min(((poses.shape[1] - 7) // 4 for poses in clips), default=max(self.joints))
        if max(self.joints) > joint_count:
            raise ParameterError(f"the poses have {joint_count} joints, a limb needs {self.joints}")
        limits = self.limits.copy()
        for joint, interval in zip(self.joints, limits, strict=True):
            for poses in clips:
                quaternions = poses[:, 3 + 4 * joint : 7 + 4 * joint]
                vectors = Rotation.from_quat(quaternions, scalar_first=True).as_rotvec()
                interval[:, 0] = np.minimum(interval[:, 0], vectors.min(axis=0) - _RANGE_MARGIN)
                interval[:, 1] = np.maximum(interval[:, 1], vectors.max(axis=0) + _RANGE_MARGIN)
        return replace(self, limits=limits)
