"""Errors raised for invalid curves, fields, maps and gains."""

from geometry.errors import HvfError


class ControllerError(HvfError):
    """Base of the errors of this package."""


class ParameterError(ControllerError):
    """A gain or a length that is negative, not finite, or out of its interval."""


class CurveError(ControllerError):
    """A curve that cannot be followed: too few samples, no length, not finite, outside the workspace."""
