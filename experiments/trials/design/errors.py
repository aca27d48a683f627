"""Error of a study as a whole; a failure of a single trial is a row of the table instead."""

from sim.errors import SimError


class StudyError(SimError):
    """A study that cannot be planned, run, continued or read; the message names it and says what to do."""
