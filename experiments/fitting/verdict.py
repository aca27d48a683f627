"""Trials, before a run, of how the physical figure follows a map's animation; results are cached."""

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from controllers.state import Array
from experiments.console.progress import working
from experiments.files.array_cache import cached_array
from models.mocap.motion.clip import Clip
from models.mocap.preparation.bounds import RESIDUAL_IN_FLIGHTS
from sim.compilation.sources import results_folder
from sim.compilation.unit_workers import compile_units

MAX_RESIDUAL = RESIDUAL_IN_FLIGHTS
"""Largest acceptable RMS of the residual force [body weights]."""

SECONDS, FPS = 20.0, 120.0
"""Duration of a trial [s], and frame rate of the animation that is followed [1/s]: that of prepared clips."""


class Verdict(NamedTuple):
    """How the physical figure follows a map.

    Attributes
    ----------
    residual : float
        RMS of the residual force [body weights].
    fell : float
        Time at which it fell [s]; infinite if it did not.
    """

    residual: float
    fell: float

    @property
    def falls(self) -> bool:
        """Whether it falls."""
        return bool(np.isfinite(self.fell))

    @property
    def bearable(self) -> bool:
        """Whether it does not fall and its residual is at most `MAX_RESIDUAL`."""
        return not self.falls and self.residual <= MAX_RESIDUAL

    def worse(self) -> tuple[float, float]:
        """Sort key that is larger for a worse verdict: first by an earlier fall, then by the residual."""
        return -self.fell, self.residual

    def __str__(self) -> str:
        """In words, as the end of a sentence about the figure."""
        return f"falls at {self.fell:.1f} s" if self.falls else f"lacks {100 * self.residual:.0f} % of weight"


def cached_verdict(
    module: str, show: Callable[[], Clip], seconds: float, made_of: Iterable[npt.NDArray[np.generic]]
) -> Verdict:
    """Let the physical figure follow an animation, and cache the verdict; needs compiled code.

    Parameters
    ----------
    module : str
        Dotted name of the module that makes the animation: a change of its code invalidates the cache.
    show : callable
        Makes the animation.
    seconds : float
        Duration for which the figure follows [s].
    made_of : iterable of arrays
        Everything else that the animation depends on.
    """

    def find() -> Array:
        from experiments.preparation.tracking_trial import followed  # imported late: loads signal processing

        with working("following the blend"):
            result = followed(show(), seconds, compile_units)
        return np.array([[result.residual, np.inf if result.fell is None else result.fell]])

    return Verdict(*cached_array(results_folder(module), "verdict", made_of, (1, 2), find)[0].tolist())
