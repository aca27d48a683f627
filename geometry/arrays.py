"""Type aliases of arrays, and their root mean square."""

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Array: TypeAlias = npt.NDArray[np.float64]
IntArray: TypeAlias = npt.NDArray[np.int64]
Mask: TypeAlias = npt.NDArray[np.bool_]


def rms(values: Array) -> float:
    """Root mean square of all numbers of an array; 0 if it is empty."""
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0
