"""A published law of movement, and how people of this project hold it."""

import math
from dataclasses import dataclass, field

from controllers.state import Array


@dataclass(frozen=True)
class Law:
    """One number of a law, measured, beside its published interval.

    Attributes
    ----------
    name : str
        Of the law and its number.
    value : float
        Measured here.
    least, most : float
        Published interval.
    unit : str
        Of all three.
    source : str
        Of the interval; "(a)" marks a paper of which the abstract was read, "(q)" one as it is quoted by who read it,
        or in its authors' slides, and "(m)" one quoted from memory; see docs/validation/published-numbers.md.
    built_in : bool
        Whether the person is made by this very law, so that only what arm and device leave of it is tested.
    """

    name: str
    value: float
    least: float
    most: float
    unit: str
    source: str
    built_in: bool = False

    @property
    def holds(self) -> bool:
        """Whether the value lies within the published interval."""
        return bool(math.isfinite(self.value) and self.least <= self.value <= self.most)


@dataclass(frozen=True)
class Study:
    """What one experiment gave.

    Attributes
    ----------
    key, title : str
        Its short name, and what is over its figure.
    laws : tuple of Law
        Its numbers.
    x, y : Array
        What is drawn, shape (n,).
    labels : tuple of str
        Of both axes.
    line : tuple of (float, float), optional
        Slope and intercept of the line that is fitted; in logarithms where `log`.
    log : bool
        Whether both axes are logarithmic.
    joined : bool
        Whether the points are a curve.
    """

    key: str
    title: str
    laws: tuple[Law, ...]
    x: Array
    y: Array
    labels: tuple[str, str]
    line: tuple[float, float] | None = None
    log: bool = False
    joined: bool = field(default=False)
