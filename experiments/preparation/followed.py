"""How the physical figure followed an animation, without a hand."""

from typing import NamedTuple

import numpy as np

from models.mocap.preparation.bounds import MAX_RESIDUAL, MAX_RESIDUAL_IN_FLIGHTS, exceeding_text

TRIAL_SECONDS = 20.0  # default duration of a trial
MAX_ROOT_TRACKING_ERROR = 1.0  # distance of the root from its reference that counts as a fall [m]


class Followed(NamedTuple):
    """How the physical figure followed an animation.

    Attributes
    ----------
    residual : float
        RMS residual force while the reference stands, until the end of a clip that is not repeated [body weights].
    fell : float or None
        Time at which it fell, or its root was `MAX_ROOT_TRACKING_ERROR` from its reference [s]; None if neither.
    seconds : float
        Duration of the trial [s].
    """

    residual: float
    fell: float | None = None
    seconds: float = TRIAL_SECONDS

    @property
    def stands(self) -> bool:
        """Whether it did not fall and its residual is at most `MAX_RESIDUAL_IN_FLIGHTS`."""
        return self.fell is None and self.residual <= MAX_RESIDUAL_IN_FLIGHTS

    def is_better(self, other: "Followed", gain: float) -> bool:
        """Whether it falls later than in another trial, or else its residual is smaller by more than `gain`."""
        fell, other_fell = (np.inf if result.fell is None else result.fell for result in (self, other))
        return (-fell, self.residual) < (-other_fell, other.residual - gain)

    def __str__(self) -> str:
        """Its fall, or else its residual, as the end of a sentence about the figure."""
        if self.fell is not None:
            return f"falls at {self.fell:.1f} s"
        return f"has a residual of {100 * self.residual:.0f} % of weight"

    def line(self) -> str:
        """The result in words."""
        residual = f"{100 * self.residual:.1f} % of weight"
        if self.fell is not None:
            return f"the physical figure falls at {self.fell:.1f} s, with a residual of {residual} up to then"
        return f"the physical figure follows it for {self.seconds:.0f} s with a residual of {residual}"

    def faults(self, leaps: bool) -> tuple[str, ...]:
        """Faults, a line each; `leaps` says whether the clip has flights, which raises the bound of the residual."""
        bound = MAX_RESIDUAL_IN_FLIGHTS if leaps else MAX_RESIDUAL
        if self.fell is not None:
            return (f"the physical figure {self}",)
        if self.residual > bound:
            residual = exceeding_text(100 * self.residual, 100 * bound)
            return (f"the physical figure has a residual of {residual} % of weight; {100 * bound:.0f} at most",)
        return ()
