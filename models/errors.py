"""Errors of models and motion files."""

from geometry.errors import HvfError


class ModelError(HvfError):
    """Base of the errors of this package."""
