"""The one base of all errors that are meant for people."""


class HvfError(ValueError):
    """Base of this project's errors: the message says what is wrong, where, and what would be right."""
