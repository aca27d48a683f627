r"""Rotation of the poses of a flight about their centre of mass so that angular momentum is constant.

Each pose is rotated as a whole by R_k, R = 1 at take-off and landing. With L_k and I_k of the given poses,

.. math:: R_k I_k R_k^T \omega_k = \bar L - R_k L_k, \qquad R_{k+1} = e^{[\omega_k \Delta t]} R_k

and the constant momentum \bar L is that for which R = 1 at the last frame, so that the body lands as in the clip: three
equations in three unknowns, solved by `scipy.optimize.root`.
"""

import numpy as np
from scipy.optimize import root
from scipy.spatial.transform import Rotation

from geometry import quaternions
from geometry.arrays import Array
from models.mocap.dynamics.momentum import Momentum, momentum
from models.mocap.motion.clip import Clip

ROUNDS = 4  # iterations, since momentum by finite differences also depends on the rotations of neighbouring frames


def with_constant_momentum(clip: Clip, flights: list[tuple[int, int]]) -> Clip:
    """The clip with constant angular momentum in flights (first frame, last frame), and unchanged centres of mass.

    A flight for which there is no solution is left as it is.
    """
    poses = clip.poses.copy()
    for _ in range(ROUNDS):
        dynamics = momentum(Clip(poses, clip.fps, clip.name))
        for start, end in flights:
            rotations = _flight_rotations(dynamics, start, end, 1.0 / clip.fps)
            if rotations is not None:
                span, q = slice(start, end + 1), rotations.as_quat(scalar_first=True)
                com = dynamics.com[span]
                poses[span, :3] = com + quaternions.rotated(q, poses[span, :3] - com)
                poses[span, 3:7] = quaternions.product(q, poses[span, 3:7])
    return Clip(poses, clip.fps, clip.name)


def _flight_rotations(dynamics: Momentum, start: int, end: int, step: float) -> Rotation | None:
    """R of each frame of a flight; None if no momentum gives R = 1 at the last frame."""
    # Momentum and inertia at the midpoints between frames.
    angular = 0.5 * (dynamics.angular[start:end] + dynamics.angular[start + 1 : end + 1])
    angular[0], angular[-1] = dynamics.angular[start + 1], dynamics.angular[end - 1]
    inertia = 0.5 * (dynamics.inertia[start:end] + dynamics.inertia[start + 1 : end + 1])

    def rotations_for(mean: Array) -> list[Rotation]:
        R = [Rotation.identity()]
        for frame_angular, frame_inertia in zip(angular, inertia, strict=True):
            missing = R[-1].inv().apply(mean) - frame_angular
            R.append(R[-1] * Rotation.from_rotvec(np.linalg.solve(frame_inertia, missing) * step))
        return R

    def landing_rotation(mean: Array) -> Array:
        return rotations_for(mean)[-1].as_rotvec()

    found = root(landing_rotation, angular.mean(axis=0), tol=1e-10)
    return Rotation.concatenate(rotations_for(np.asarray(found.x))) if found.success else None
