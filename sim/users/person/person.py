"""Parameters of a simulated person at the stylus: arm, senses and motor system. Pure data; see also `population`."""

from dataclasses import dataclass, fields
from typing import Literal, NamedTuple

from controllers.checks import check_kind
from sim.errors import SimError


class Interval(NamedTuple):
    """The admissible interval of a parameter.

    Attributes
    ----------
    least, most : float
        Bounds, inclusive.
    unit : str
        Unit of both.
    source : str
        Source of the interval. "(a)" marks a paper of which the abstract was read, "(q)" one as quoted by another
        author, "(m)" one quoted from memory; see docs/validation/published-numbers.md.
    """

    least: float
    most: float
    unit: str
    source: str


INTERVALS = {
    "age": Interval(18.0, 90.0, "years", "adults"),
    "skill": Interval(
        0.0, 1.0, "", "fraction of the arm's inertia that the motor command compensates; most: Gordon et al. 1994 II"
    ),
    "grip": Interval(0.5, 10.0, "N", "Fu & Cavusoglu 2012 (a): 1 to 3 N on this very device; up to 10 N when asked to"),
    "mass": Interval(0.1, 2.5, "kg", "Speich et al. 2005: 1.46 kg (m); hand and wrist alone some 0.1 to 0.5 kg"),
    "stiffness": Interval(20.0, 800.0, "N/m", "Mussa-Ivaldi et al. 1985, Tsuji et al. 1995 (m): some 50 to 800 N/m"),
    "damping_ratio": Interval(
        0.1, 1.2, "", "Perreault et al. 2004: alike for all people (q), 0.3 (m); Tsuji et al. 1995 (m): 0.2 to 0.6"
    ),
    "anisotropy": Interval(1.0, 5.0, "", "Mussa-Ivaldi et al. 1985 (m): axes of the stiffness ellipse, 1.5 to 4"),
    "grip_stiffness": Interval(
        100.0, 3000.0, "N/m", "Speich et al. 2005 (m): 375 N/m; Hajian & Howe 1997 (m): to 1255"
    ),
    "grip_damping": Interval(1.0, 20.0, "N s/m", "Speich et al. 2005 (m): 7.9 N s/m; Hajian & Howe 1997 (m): 2 to 8"),
    "stiffening": Interval(
        0.0, 1.0, "1/N", "Hasser & Cutkosky 2002 (a), Tsuji et al. 1995 (q): stiffness and damping rise with grip"
    ),
    "strength": Interval(
        2.0, 60.0, "N", "a hand on a pen: below tip pinch, 78 N of men of 30 to 34 years (Mathiowetz et al. 1985, q)"
    ),
    "fatigue": Interval(
        0.0, 4.0, "1/min", "Frey-Law et al. 2012 (a): F of a three-compartment model, 0.35 to 1.1; 0 for none"
    ),
    "reflex_delay": Interval(
        0.03, 0.06, "s", "Kurtzer 2015 (a): short latency reflex of the arm 20 to 45 ms, long latency from 50 ms on"
    ),
    "reflex_gain": Interval(0.0, 0.5, "", "fraction of stiffness and damping that is reflex, not muscle"),
    "visual_delay": Interval(
        0.15,
        0.25,
        "s",
        "until a seen error is corrected: Saunders & Knill 2005 (a) 0.12 to 0.2, Keele & Posner 1968 (q) 0.26",
    ),
    "felt_noise": Interval(
        0.0, 0.02, "m", "van Beers et al. 1998 (a): shoulder and elbow are felt to 0.6 to 1.1°, 5 to 10 mm at the hand"
    ),
    "felt_force_noise": Interval(
        0.0, 0.2, "", "Pang, Tan & Durlach 1991 (a): the just noticeable difference of a force is roughly 7 % of it"
    ),
    "seen_noise": Interval(0.0, 0.01, "m", "van Beers et al. 1998 (m): visual localisation 1 to 3 mm"),
    "direction_noise": Interval(
        0.0, 0.2, "rad", "Gordon et al. 1994 I (a): an angle, the same for short ways and long ones; 3 to 6° (m)"
    ),
    "refractory": Interval(0.1, 0.25, "s", "Miall, Weir & Stein 1993 (a): some 170 ms between corrections in tracking"),
    "horizon": Interval(
        0.15, 0.8, "s", "duration of a submovement in tracking: Miall, Weir & Stein 1993 (a) find them at 0.5 to 1.8 Hz"
    ),
    "motor_noise": Interval(0.0, 0.05, "s", "Meyer et al. 1988 (a): the spread of endpoints is linear in A/T"),
    "force_noise": Interval(0.0, 0.1, "", "Jones et al. 2002 (m): coefficient of variation of force, 2 to 5 %"),
    "tremor": Interval(
        0.0, 0.35, "m/s²", "Wade, Gresty & Findley 1982, postural tremor of 97 people (a): 0.015 to 0.34"
    ),
    "tremor_frequency": Interval(6.0, 12.0, "Hz", "Lakie et al. 2015 (a): a clear peak between 6 and 12 Hz"),
    "correction": Interval(0.0, 1.0, "", "fraction of a perceived error that the next submovement corrects"),
    "caution": Interval(1.0, 4.0, "", "standard deviations of a person's own scatter kept within a target"),
    "entrainment": Interval(0.0, 5.0, "1/s", "rate at which a person's clock adapts to a motion ahead or behind"),
    "learning": Interval(
        0.0, 0.5, "", "fraction learned per repetition: Smith et al. 2006 (q): 0.23, of which 0.21 is soon forgotten"
    ),
}
"""Interval of every numeric parameter of a `Person`, with its unit and source."""


@dataclass(frozen=True)
class Person:
    """A person at the stylus; every number has an interval with its source in `INTERVALS`.

    Parameters
    ----------
    name : str
        Name, for tables.
    age : float
        Age [years]; its effects are already in the other numbers as drawn by `population`.
    hand : {"right", "left"}
        The hand that holds the stylus: the ellipsoids of inertia and stiffness are mirrored.
    skill : float
        Share of the arm's own inertia that the motor command foresees.
    grip : float
        Force of the fingers on the stylus [N].
    mass : float
        Inertia of hand and arm at the stylus, across its heaviest direction [kg].
    stiffness : float
        Stiffness of the arm in its stiffest direction, at a grip of 2 N [N/m].
    damping_ratio : float
        Damping ratio of the arm.
    anisotropy : float
        Ratio of largest to smallest stiffness in the horizontal plane; for the inertia, its square root.
    grip_stiffness, grip_damping : float
        Stiffness and damping of the fingers between hand and stylus, at a grip of 2 N [N/m], [N s/m].
    stiffening : float
        Relative rise of stiffness and damping with grip [1/N].
    strength : float
        Largest force on the stylus [N].
    fatigue : float
        Share of the muscle that tires while all of it is active [1/min]; 0 for none.
    reflex_delay : float
        Delay of felt force and motion [s].
    reflex_gain : float
        Share of the arm's stiffness that answers with this delay.
    visual_delay : float
        Delay of vision [s].
    felt_noise, seen_noise : float
        Standard deviation of a felt and of a seen position [m].
    felt_force_noise : float
        Standard deviation of a felt force, relative to the force.
    direction_noise : float
        Standard deviation of the error of a movement's felt direction [rad].
    refractory : float
        Refractory period: shortest time between two decisions [s].
    horizon : float
        Duration of a submovement in tracking [s].
    motor_noise : float
        K in σ = K A/T [s], the standard deviation of a submovement's endpoint along its direction (0.85 σ across), with
        A its length and T its duration.
    force_noise : float
        Standard deviation of an exerted force, relative to the force.
    tremor, tremor_frequency : float
        RMS acceleration of the tremor [m/s²], and its frequency [Hz].
    correction : float
        Share of a perceived error that the next submovement corrects.
    caution : float
        Number of standard deviations of her own scatter that she keeps within a target or a tunnel.
    entrainment : float
        Rate at which her own clock adapts to the motion [1/s].
    learning : float
        Share of a repeated error that is learned per repetition; 0 for none.

    Raises
    ------
    SimError
        If a number is outside its interval, or `hand` is neither right nor left.
    """

    name: str = "median"
    age: float = 30.0
    hand: Literal["right", "left"] = "right"
    skill: float = 0.85
    grip: float = 2.0
    mass: float = 0.6
    stiffness: float = 250.0
    damping_ratio: float = 0.5
    anisotropy: float = 2.0
    grip_stiffness: float = 800.0
    grip_damping: float = 8.0
    stiffening: float = 0.15
    strength: float = 15.0
    fatigue: float = 0.0
    reflex_delay: float = 0.04
    reflex_gain: float = 0.15
    visual_delay: float = 0.2
    felt_noise: float = 0.006
    felt_force_noise: float = 0.07
    seen_noise: float = 0.0004
    direction_noise: float = 0.1
    refractory: float = 0.15
    horizon: float = 0.42
    motor_noise: float = 0.0078
    force_noise: float = 0.03
    tremor: float = 0.06
    tremor_frequency: float = 9.0
    correction: float = 0.8
    caution: float = 2.5
    entrainment: float = 1.0
    learning: float = 0.0

    def __post_init__(self) -> None:
        check_kind("name", self.name, str)
        check_kind("hand", self.hand, str)
        if self.hand not in ("right", "left"):
            raise SimError(f"the hand of person {self.name!r} is {self.hand!r}; expected right or left")
        for option in fields(self):
            if option.name not in INTERVALS:
                continue
            value, (least, most, unit, _) = getattr(self, option.name), INTERVALS[option.name]
            check_kind(f"{option.name} of person {self.name!r}", value, float)
            if not least <= value <= most:
                expected = f"expected {least:g} to {most:g} {unit}".rstrip()
                raise SimError(f"{option.name} of person {self.name!r} is {value:g}; {expected}")
