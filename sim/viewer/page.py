"""The interface of a live page, and a null implementation for runs without one."""

from typing import Protocol

from sim.viewer.shown import Moment


class Page(Protocol):
    """A page that shows a run in progress."""

    def show(self, shown: Moment) -> None:
        """Show a moment of the run."""
        ...

    def close(self) -> None:
        """Close the page."""
        ...


class NullPage:
    """The page of a run without display."""

    def show(self, shown: Moment) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""
