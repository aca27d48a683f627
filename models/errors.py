"""What goes wrong with a model or a motion file."""


class ModelError(ValueError):
    """Base of the errors of this package: says what is wrong, where, and what would be right."""
