"""Whether compiled code keeps arrays alive as long as Python does, and no longer."""

import gc
import weakref

import numpy as np


class ArrayLifetimes:
    """Watches arrays without keeping them alive.

    A reference that compiled code loses frees an array that is in use, one that it leaks keeps it alive for ever.
    """

    def __init__(self, *arrays: np.ndarray):
        self._references = [weakref.ref(array) for array in arrays]

    def all_alive(self) -> bool:
        gc.collect()
        return all(reference() is not None for reference in self._references)

    def all_freed(self) -> bool:
        gc.collect()
        return all(reference() is None for reference in self._references)
