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
    yaw : float
        The same about the vertical [rad]: captures that fly stay within 1.5°, a turn of 38° that begins and ends in the
        air makes 4°.
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
    yaw: float = float(np.deg2rad(4.0))
    clearance: float = 0.08

    def __post_init__(self) -> None:
        if not 0.0 < self.gravity[0] < GRAVITY < self.gravity[1]:
            raise ParameterError(f"tolerance of gravity {self.gravity} m/s²; expected 0 < low < {GRAVITY} < high")
        for name in ("distance", "misfit", "drift", "yaw", "clearance"):
            value = float(getattr(self, name))
            if not (np.isfinite(value) and value > 0.0):
                raise ParameterError(f"BallisticTolerance.{name} is {value}; expected a finite number > 0")


@dataclass(frozen=True)
class ContactTolerance:
    """What passes for contact between flights.

    Chosen on 22 captures as they are retargeted: of the six whose jumps fly, soles stand within 5 mm of the floor and
    stay within 17 mm of where they stand, a foot slides by up to 9 cm and nothing is at rest for up to 0.12 s.

    Parameters
    ----------
    floor : float
        How far the median height of what stands may be from the floor [m].
    spread : float
        How far from there it may be for nine tenths of the supported time, up and down [m].
    unheld : float
        Longest time for which nothing that touches is at rest [s].
    skate : float
        Furthest that a foot may slide in a stance [m].
    push : float
        Greatest acceleration of the centre of mass [m/s²]: legs give some ten times g.
    leap, outlier : float
        A joint that turns by more than this in a frame [rad], and so many times as far as before and after, leaps.

    Raises
    ------
    ParameterError
        If one is not positive and finite.
    """

    floor: float = 0.008
    spread: float = 0.02
    unheld: float = 0.15
    skate: float = 0.12
    push: float = 150.0
    leap: float = 0.5
    outlier: float = 8.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value > 0.0):
                raise ParameterError(f"ContactTolerance.{name} is {value}; expected a finite number > 0")


@dataclass(frozen=True)
class Judging:
    """By what a clip is judged.

    Parameters
    ----------
    tolerance : BallisticTolerance
        What passes for a flight.
    friction : float
        Coefficient of friction of soles on the floor; 0.9 is that of the scene.
    contact : ContactTolerance
        What passes for contact between flights.

    Raises
    ------
    ParameterError
        If the coefficient of friction is not positive.
    """

    tolerance: BallisticTolerance = field(default_factory=BallisticTolerance)
    friction: float = 0.9
    contact: ContactTolerance = field(default_factory=ContactTolerance)

    def __post_init__(self) -> None:
        if not (np.isfinite(self.friction) and self.friction > 0.0):
            raise ParameterError(f"the coefficient of friction is {self.friction}; expected a finite number > 0")


JUDGING = Judging()
