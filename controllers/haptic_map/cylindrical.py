"""The cylindrical map: an angle is the frame, radius and height blend four clips (Donald & Henle 2000, Fig. 3)."""

from collections.abc import Sequence

import numpy as np
from numba import njit

from controllers.errors import ParameterError
from controllers.haptic_map.animation import AnimationMap
from controllers.haptic_map.blending import blend
from controllers.haptic_map.cylinder import blend_weight, checked_interval, cylinder
from controllers.haptic_map.limbs import Limb
from controllers.state import Array

CYLINDRICAL = 1
_CLIPS = 4
_R_MIN, _R_MAX, _Z_MIN, _Z_MAX, _BLEND = range(5)


@njit
def cylindrical_map(params: Array, x: Array, memory: Array, pose: Array, jacobian: Array) -> None:
    """Kernel of `Cylindrical`: h(x), and h_*(x) unless `jacobian` has no rows."""
    chain = np.empty((3, 6))
    radius, angle = cylinder(x, chain)
    a, a_slope = blend_weight(radius, params[_R_MIN], params[_R_MAX])
    b, b_slope = blend_weight(x[2], params[_Z_MIN], params[_Z_MAX])
    weights, changes = np.empty((1, _CLIPS)), np.zeros((1, 3, _CLIPS))
    for i in range(_CLIPS):
        w_r, d_r = (a, a_slope) if i % 2 == 1 else (1.0 - a, -a_slope)
        w_z, d_z = (b, b_slope) if i >= 2 else (1.0 - b, -b_slope)
        weights[0, i], changes[0, 1, i], changes[0, 2, i] = w_r * w_z, d_r * w_z, w_r * d_z
    blend(params[_BLEND:], angle, weights, changes, chain, memory, pose, jacobian)


class Cylindrical(AnimationMap):
    r"""Four clips round a cylinder about the z axis of H.

    θ = atan2(y, x) is the phase: one lap of the hand is one lap of every clip. The weights w_i(r, z) blend the four
    clips bilinearly and ease in at the edges (C²); beyond them they stay, so no limb is ever extrapolated. How poses
    are blended is told in `blending`.

    A ∈ SE(2) is the frame of the lap, kept in the memory: it moves by exp(Σ w_i ξ_i) each time the hand goes over
    the seam θ = 0 forwards, and back backwards, so the figure walks on. Pose, velocity and acceleration are
    continuous over the seam. If no clip travels or turns, A stays the identity and h is a function of the stylus
    position alone. h does not depend on the stylus orientation. On the axis r = 0 the phase, hence h, is not defined.

    Parameters
    ----------
    clips : sequence of four (Array, float)
        Poses (n, nq) and frames per second: at (r_min, z_min), (r_max, z_min), (r_min, z_max), (r_max, z_max). A
        pose is root position, root quaternion, then joint quaternions (wxyz). Clips that do not close are closed
        (`closed_loop`), and all are aligned to the first in time (`alignment`).
    r_range, z_range : tuple of two floats
        Intervals [m] over which the clips blend; r_min > 0.
    limbs : sequence of Limb
        Limbs whose ends are to be where they are in the clips on average: feet that stand (see `limbs`).

    Raises
    ------
    ParameterError
        If there are not four clips of the same kind of pose, an interval is empty, or a limb is not one of the pose's.
    """

    def __init__(
        self,
        clips: Sequence[tuple[Array, float]],
        r_range: tuple[float, float],
        z_range: tuple[float, float],
        limbs: Sequence[Limb] = (),
    ) -> None:
        if len(clips) != _CLIPS:
            raise ParameterError(
                f"the cylindrical map blends {_CLIPS} clips, got {len(clips)}; give one more than once"
            )
        numbers = (*checked_interval("r_range", r_range, 1e-3), *checked_interval("z_range", z_range, -np.inf))
        super().__init__(CYLINDRICAL, cylindrical_map, clips, numbers, (), limbs)
