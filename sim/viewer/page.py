"""What a run shows itself to while it goes on; and the page of a run that nobody watches."""

from typing import Protocol

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


class Page(Protocol):
    """What a run shows itself to."""

    def show(self, qpos: Array, p_H: Array, force_H: Array) -> None:
        """Show the world's configuration, and in the hand frame the stylus tip and the force of the field."""
        ...

    def close(self) -> None:
        """Show nothing more."""
        ...


class NullPage:
    """The page of a run that nobody watches."""

    def show(self, qpos: Array, p_H: Array, force_H: Array) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""
