r"""Rotation of the poses of a flight about their centre of mass so that angular momentum is constant.

Each pose is rotated as a whole by R_k, R = 1 at take-off and landing. With L_k and I_k of the given poses,

.. math:: R_k I_k R_k^T \omega_k = \bar L - R_k L_k, \qquad R_{k+1} = e^{[\omega_k \Delta t]} R_k

and the constant momentum \bar L is that for which R = 1 at the last frame, so that the body lands as in the clip: three
equations for three numbers, solved by `scipy.optimize.root`.
"""

import numpy as np
from scipy.optimize import root
from scipy.spatial.transform import Rotation

from controllers.state import Array
from models.mocap.dynamics.momentum import Momentum, momentum
from models.mocap.motion import quaternions
from models.mocap.motion.clip import Clip

ROUNDS = 4  # iterations: momentum by finite differences also changes with the rotation of neighbouring frames


def with_constant_momentum(clip: Clip, flights: list[tuple[int, int]]) -> Clip:
    """The clip with constant angular momentum in flights (first frame, last frame), and unchanged centres of mass.

    A flight for which there is no solution is left as it is.
    """
    poses = clip.poses.copy()
    for _ in range(ROUNDS):
        moved = momentum(Clip(poses, clip.fps, clip.name))
        for start, end in flights:
            turn = _turns(moved, start, end, 1.0 / clip.fps)
            if turn is not None:
                span, q = slice(start, end + 1), turn.as_quat(scalar_first=True)
                com = moved.com[span]
                poses[span, :3] = com + quaternions.rotated(q, poses[span, :3] - com)
                poses[span, 3:7] = quaternions.product(q, poses[span, 3:7])
    return Clip(poses, clip.fps, clip.name)


def _turns(moved: Momentum, start: int, end: int, step: float) -> Rotation | None:
    """R of each frame of a flight; None if there is no momentum with R = 1 at the last frame."""
    # Momentum and inertia at the midpoints between frames.
    own = 0.5 * (moved.angular[start:end] + moved.angular[start + 1 : end + 1])
    own[0], own[-1] = moved.angular[start + 1], moved.angular[end - 1]
    inertia = 0.5 * (moved.inertia[start:end] + moved.inertia[start + 1 : end + 1])

    def turned(mean: Array) -> list[Rotation]:
        R = [Rotation.identity()]
        for angular, own_inertia in zip(own, inertia, strict=True):
            missing = R[-1].inv().apply(mean) - angular
            R.append(R[-1] * Rotation.from_rotvec(np.linalg.solve(own_inertia, missing) * step))
        return R

    def landed(mean: Array) -> Array:
        return turned(mean)[-1].as_rotvec()

    found = root(landed, own.mean(axis=0), tol=1e-10)
    return Rotation.concatenate(turned(np.asarray(found.x))) if found.success else None
