"""Validation of a law's numbers and names in its constructor."""

import numpy as np

from controllers.errors import ParameterError


def checked(name: str, value: float, unit: str, least: float = 0.0, infinite: bool = False) -> float:
    """The value, a gain or length, if it is at least `least` and finite (or infinite, where allowed); else raises."""
    if np.isnan(value) or value < least or (np.isinf(value) and not infinite):
        raise ParameterError(
            f"{name} must be {'' if infinite else 'finite and '}at least {least:g} {unit}, got {value}"
        )
    return float(value)


def one_of(name: str, value: str, names: tuple[str, ...]) -> str:
    """The value if it is one of the known names; else raises."""
    if value not in names:
        raise ParameterError(f"{name} must be one of {', '.join(names)}, got {value!r}")
    return value
