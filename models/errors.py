"""Errors of models and motion files."""


class ModelError(ValueError):
    """Base of the errors of this package: says what is wrong, where, and what would be right."""
