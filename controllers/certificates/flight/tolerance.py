"""Tolerances by which motions are judged: flights, contacts, and friction of the floor."""

from dataclasses import dataclass, field

import numpy as np

from controllers.checks import check_positive
from controllers.errors import ParameterError
from geometry.physics import FRICTION, GRAVITY


@dataclass(frozen=True)
class BallisticTolerance:
    """Tolerances of a flight.

    Parameters
    ----------
    gravity : (float, float)
        Smallest and largest gravity that viewers accept as natural [m/s²] (after Reitsma & Pollard 2003; its basis is
        explained in docs/explanation/ballistics.md).
    distance : float
        Largest distance of a body in real free fall from the recorded centre of mass [m].
    misfit : float
        RMS distance of the recorded centre of mass from its own parabola [m].
    drift : float
        Largest deviation of the body's orientation from that under constant angular momentum [rad].
    yaw : float
        The same about the vertical [rad]. Real flights in captures stay within 1.5°; a turn of 38° that begins and ends
        in the air gives 4°.
    clearance : float
        A body that never rises higher than this and does not fall may stand on a floor above the recorded one [m].

    Raises
    ------
    ParameterError
        If the interval of gravity does not contain the true value, or a tolerance is not positive.
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
        check_positive("BallisticTolerance", self, "distance", "misfit", "drift", "yaw", "clearance")


@dataclass(frozen=True)
class ContactTolerance:
    """Tolerances of contacts between flights.

    Chosen on 22 retargeted captures. In the six with real jumps, soles in stance are within 5 mm of the floor and stay
    within 17 mm of that height, a foot skates by up to 7 cm, and for up to 0.19 s no contact is at rest.

    Parameters
    ----------
    floor : float
        Largest distance of the median height of the supporting points from the floor [m].
    spread : float
        Largest deviation from that height for 90 % of the supported time, up and down [m].
    unheld : float
        Longest time for which no contact is at rest [s].
    skate : float
        Largest skate of a foot in a stance [m].
    push : float
        Largest acceleration of the centre of mass [m/s²]; legs can give about ten times g.
    leap, outlier : float
        A joint jumps if it turns by more than `leap` in a frame [rad], and by more than `outlier` times as much as in
        the frames before and after.

    Raises
    ------
    ParameterError
        If a tolerance is not positive and finite.
    """

    floor: float = 0.008
    spread: float = 0.02
    unheld: float = 0.24
    skate: float = 0.12
    push: float = 150.0
    leap: float = 0.5
    outlier: float = 8.0

    def __post_init__(self) -> None:
        check_positive("ContactTolerance", self)


@dataclass(frozen=True)
class JudgementCriteria:
    """Criteria by which a clip is judged.

    Parameters
    ----------
    tolerance : BallisticTolerance
        Tolerances of flights.
    friction : float
        Coefficient of friction of soles on the floor; by default that of the scene.
    contact : ContactTolerance
        Tolerances of contacts between flights.

    Raises
    ------
    ParameterError
        If the coefficient of friction is not positive.
    """

    tolerance: BallisticTolerance = field(default_factory=BallisticTolerance)
    friction: float = FRICTION
    contact: ContactTolerance = field(default_factory=ContactTolerance)

    def __post_init__(self) -> None:
        check_positive("the floor", self, "friction")


DEFAULT_CRITERIA = JudgementCriteria()
