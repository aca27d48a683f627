"""The base error of this package: faults of a world, a device, a run or a recording."""

from geometry.errors import HvfError


class SimError(HvfError):
    """Base of the errors of this package."""
