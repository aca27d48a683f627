"""Effect sizes: standardised differences of means."""

import numpy as np

from geometry.arrays import Array

EQUAL_TOLERANCE = 1e-6  # relative spread below which differences count as equal


def has_spread(sample: Array) -> bool:
    """Whether the values of a sample differ by more than rounding errors."""
    return bool(np.ptp(sample) > EQUAL_TOLERANCE * np.max(np.abs(sample)))


def cohen_dz(differences: Array) -> float:
    """Cohen's d_z: mean over standard deviation of paired differences (Cohen, *Statistical Power Analysis*, 1988)."""
    spread = float(np.std(differences, ddof=1)) if len(differences) > 1 else 0.0
    mean = float(np.mean(differences)) if len(differences) else 0.0
    return mean / spread if spread > EQUAL_TOLERANCE * abs(mean) else float("nan")


def hedges_g(one: Array, other: Array) -> float:
    """Hedges' g: difference of means over pooled standard deviation, corrected for small samples (Hedges, 1981)."""
    dof = len(one) + len(other) - 2
    if dof < 1:
        return float("nan")
    pooled = np.sqrt(((len(one) - 1) * np.var(one, ddof=1) + (len(other) - 1) * np.var(other, ddof=1)) / dof)
    if not pooled > 0.0:
        return float("nan")
    return float((np.mean(one) - np.mean(other)) / pooled * (1.0 - 3.0 / (4.0 * dof - 1.0)))
