"""The base error of this package: faults of a world, a device, a run or a recording."""


class SimError(ValueError):
    """Base class of this package's errors: the message says what is wrong, where, and what was expected."""
