"""What a run shows itself to while it goes on; and the page of a run that nobody watches."""

from typing import Protocol

from sim.viewer.shown import Shown


class Page(Protocol):
    """What a run shows itself to."""

    def show(self, shown: Shown) -> None:
        """Show a moment of it."""
        ...

    def close(self) -> None:
        """Show nothing more."""
        ...


class NullPage:
    """The page of a run that nobody watches."""

    def show(self, shown: Shown) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""
