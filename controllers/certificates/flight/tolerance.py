"""What passes for a motion of a body: tolerances on flights, and the floor that it stands on."""

from dataclasses import dataclass, field

import numpy as np

from controllers.errors import ParameterError

GRAVITY = 9.81


@dataclass(frozen=True)
class BallisticTolerance:
    """What passes for a flight.

    Parameters
    ----------
    gravity : (float, float)
        Least and greatest gravity that viewers take for natural [m/s²] (after Reitsma & Pollard 2003; what that rests
        on is said in docs/explanation/ballistics.md).
    distance : float
        How far a body that really falls may stray from the recorded centre of mass [m].
    misfit : float
        RMS distance of the recorded centre of mass from its own parabola [m].
    drift : float
        How far the body may turn away from where constant angular momentum would have turned it [rad].
    clearance : float
        A body that never rises higher than this and does not fall is taken to stand on a floor that was missed [m].

    Raises
    ------
    ParameterError
        If the interval of gravity does not hold the true one, or a tolerance is not positive.
    """

    gravity: tuple[float, float] = (9.0, 12.7)
    distance: float = 0.05
    misfit: float = 0.06
    drift: float = float(np.deg2rad(30.0))
    clearance: float = 0.08

    def __post_init__(self) -> None:
        if not 0.0 < self.gravity[0] < GRAVITY < self.gravity[1]:
            raise ParameterError(f"tolerance of gravity {self.gravity} m/s²; expected 0 < low < {GRAVITY} < high")
        for name in ("distance", "misfit", "drift", "clearance"):
            value = float(getattr(self, name))
            if not (np.isfinite(value) and value > 0.0):
                raise ParameterError(f"BallisticTolerance.{name} is {value}; expected a finite number > 0")


@dataclass(frozen=True)
class Judging:
    """By what a clip is judged.

    Parameters
    ----------
    tolerance : BallisticTolerance
        What passes for a flight.
    friction : float
        Coefficient of friction of soles on the floor; 0.9 is that of the scene.

    Raises
    ------
    ParameterError
        If the coefficient of friction is not positive.
    """

    tolerance: BallisticTolerance = field(default_factory=BallisticTolerance)
    friction: float = 0.9

    def __post_init__(self) -> None:
        if not (np.isfinite(self.friction) and self.friction > 0.0):
            raise ParameterError(f"the coefficient of friction is {self.friction}; expected a finite number > 0")


JUDGING = Judging()
