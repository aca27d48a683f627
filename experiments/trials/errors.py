"""What goes wrong with a study as a whole; what goes wrong in one of its trials is a row of its table."""

from sim.errors import SimError


class StudyError(SimError):
    """A study that cannot be planned, run, continued or read: says which and what to do."""
