"""Maps of a figure of another size: the same joint angles, the root's position in proportion to the body's lengths."""

import numpy as np
from numba import njit

from controllers.checks import check_kind
from controllers.errors import ParameterError
from controllers.haptic_map.base import HapticMap, Wrapped
from controllers.haptic_map.map_stages import CompiledMap
from geometry.arrays import Array

_SIZE = 0


@njit
def size_pose(params: Array, x: Array, memory: Array, pose: Array, jacobian: Array) -> None:
    """Kernel of `Sized`: scale the root's position of the wrapped map's pose, and its derivative unless it is empty.

    Parameters
    ----------
    params : Array
        Parameters of a `Sized`.
    x, memory : Array
        Stylus pose (7,) and memory of the wrapped map; neither is used.
    pose, jacobian : Array, shapes (nq,), (nv, 6)
        Pose and derivative of the wrapped map; updated.
    """
    for i in range(3):
        pose[i] *= params[_SIZE]
    for i in range(min(3, jacobian.shape[0])):
        for k in range(jacobian.shape[1]):
            jacobian[i, k] *= params[_SIZE]


class Sized(Wrapped):
    r"""A map for a figure whose lengths are all s times those of the figure of its clips.

    .. math:: h_s(x) = (s\,p(x),\; q(x)), \qquad h(x) = (p(x),\; q(x))

    p is the position of the root, q all rotations. Every point of the body is then at s times its place, so soles that
    stand on the floor still do, and do not skate.

    Parameters
    ----------
    base : HapticMap
        A map to poses of root position, root quaternion, then joint quaternions (wxyz).
    size : float
        s [1].

    Raises
    ------
    ParameterError
        If the size is not a number, not positive, or not finite.
    """

    map_kernel = staticmethod(size_pose)

    def __init__(self, base: HapticMap, size: float) -> None:
        check_kind("size", size, float)
        if not 0.0 < size < np.inf:
            raise ParameterError(f"size is {size:g}; expected more than 0, and finite")
        super().__init__(base, np.array([float(size)]))
        self.size = float(size)

    def compiled(self) -> CompiledMap:
        """The other map with one more stage, the memory of a new run, and the size."""
        return super().compiled()._replace(size=self.size)
