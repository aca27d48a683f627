"""What goes wrong with a world, a device, a run or a recording."""


class SimError(ValueError):
    """Base of the errors of this package: says what is wrong, where, and what would be right."""
