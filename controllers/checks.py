"""Checks of a law's numbers and names when it is made."""

import numpy as np

from controllers.errors import ParameterError


def checked(name: str, value: float, unit: str, least: float = 0.0, infinite: bool = False) -> float:
    """Gain or length that must be finite (or may be infinite) and not below `least`."""
    if np.isnan(value) or value < least or (np.isinf(value) and not infinite):
        raise ParameterError(
            f"{name} must be {'' if infinite else 'finite and '}at least {least:g} {unit}, got {value}"
        )
    return float(value)


def one_of(name: str, value: str, names: tuple[str, ...]) -> str:
    """Name that must be one of those known."""
    if value not in names:
        raise ParameterError(f"{name} must be one of {', '.join(names)}, got {value!r}")
    return value
