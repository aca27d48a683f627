"""The C² window that fades a river out at its tube's edge (Donald & Henle 2000, section 2.3)."""

import numpy as np
from numba import njit


@njit
def window(s2: float) -> float:
    r"""Window w = (1 − s²)³ inside the tube and 0 outside, as a function of s² = (d/ε)².

    C² everywhere: zero slope at the centre; value, slope and curvature vanish at the edge. The argument s² avoids the
    square root, so w is smooth at d = 0 too; ε = ∞ gives s² = 0, a river that fills the space.
    """
    inside = np.maximum(0.0, 1.0 - s2)
    return inside * inside * inside
