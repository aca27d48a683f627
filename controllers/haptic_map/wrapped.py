"""Maps that change the pose of another map."""

from controllers.haptic_map.base import CompiledMap, HapticMap
from controllers.state import Array


class Wrapped(HapticMap):
    """A map whose kernel changes the pose of another one, with as many numbers and the same memory.

    Parameters
    ----------
    base : HapticMap
        The other map.
    kind : int
        Kind of the kernel.
    params : Array
        Its parameters, with kind and parameters of the other map's kernel.
    """

    def __init__(self, base: HapticMap, kind: int, params: Array) -> None:
        self.base, self._kind, self._params = base, kind, params

    @property
    def nq(self) -> int:
        """Numbers of a configuration."""
        return self.base.nq

    @property
    def nv(self) -> int:
        """Numbers of a tangent."""
        return self.base.nv

    def compiled(self) -> CompiledMap:
        """The map in the form of its kernel, with the memory of a new run."""
        return CompiledMap(self._kind, self._params, self.base.compiled().memory)
