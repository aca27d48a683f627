"""A published law of movement, and the measurement of simulated people against it."""

import math
from dataclasses import dataclass, field

from geometry.arrays import Array


@dataclass(frozen=True)
class Law:
    """One measured parameter of a law, with its published interval.

    Attributes
    ----------
    name : str
        Name of the law and the parameter.
    value : float
        Value measured here.
    least, most : float
        Published interval.
    unit : str
        Unit of all three.
    source : str
        Source of the interval; "(a)" marks a paper of which the abstract was read, "(q)" one quoted from another author
        who read it, or from its authors' slides, and "(m)" one from memory; see docs/validation/published-numbers.md.
    built_in : bool
        Whether the person is modelled by this very law, so that the test shows only what arm and device leave of it.
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
    """Result of one experiment.

    Attributes
    ----------
    key, title : str
        Short name, and title of the figure.
    laws : tuple of Law
        Measured parameters.
    x, y : Array
        Data of the figure, shape (n,).
    labels : tuple of str
        Labels of both axes.
    line : tuple of (float, float), optional
        Slope and intercept of the fitted line; in logarithms if `log`.
    log : bool
        Whether both axes are logarithmic.
    joined : bool
        Whether the points are joined to a curve.
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
