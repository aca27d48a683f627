"""Maps that change the pose of another map."""

from controllers.haptic_map.base import HapticMap
from controllers.haptic_map.map_stages import CompiledMap
from geometry.arrays import Array


class Wrapped(HapticMap):
    """A map whose kernel, called after those of another map, changes its pose, with the same numbers and memory.

    Parameters
    ----------
    base : HapticMap
        The other map.
    params : Array
        Parameters of the kernel.
    """

    def __init__(self, base: HapticMap, params: Array) -> None:
        self.base, self._params = base, params

    @property
    def nq(self) -> int:
        """Numbers of a configuration."""
        return self.base.nq

    @property
    def nv(self) -> int:
        """Numbers of a tangent."""
        return self.base.nv

    def compiled(self) -> CompiledMap:
        """The other map with one more stage, and the memory of a new run."""
        return self.base.compiled().followed_by(self.map_kernel, self._params)
