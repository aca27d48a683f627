"""Populations of simulated persons: seeded random draws, and named personas."""

import re
from dataclasses import replace

import numpy as np

from controllers.checks import check_kind
from sim.errors import SimError
from sim.users.person.person import INTERVALS, Person

_LOG_SPREAD = {
    "mass": 0.3, "stiffness": 0.35, "damping_ratio": 0.2, "anisotropy": 0.15, "grip_stiffness": 0.3,
    "grip_damping": 0.25, "strength": 0.25, "felt_noise": 0.25, "seen_noise": 0.2, "motor_noise": 0.2,
    "force_noise": 0.25, "tremor": 0.6, "tremor_frequency": 0.08, "reflex_delay": 0.12, "visual_delay": 0.07,
    "refractory": 0.1, "horizon": 0.12, "grip": 0.35, "entrainment": 0.3,
    "direction_noise": 0.25,
}  # fmt: skip
"""Standard deviation of the logarithm of each number between people: log-normal, so none is negative.

For tremor, as wide as the range of the normative study (a factor of 20 between the extremes of 97 people); for
impedance, the inter-subject variation of arm models (a factor of about two either way); for the others, coefficients of
variation of a healthy sample, some 10 to 30 %.
"""
_SKILL_BETA = (8.5, 1.5)  # of a beta distribution: adults know most, but not all, of their arm's inertia
_MEAN_SKILL = _SKILL_BETA[0] / sum(_SKILL_BETA)
_LEFT_HANDED_FRACTION = 0.1  # share of people who hold a pen in the left hand
_SLOWING_PER_YEAR = 0.006  # relative, from age 30 on: choice reaction and movement times rise 5 to 10 % a decade

PERSONAS = {
    "median": Person(),
    "expert": Person(name="expert", age=35.0, skill=1.0, motor_noise=0.0055, horizon=0.38, seen_noise=0.0003,
                     tremor=0.04, correction=0.9),
    "novice": Person(name="novice", age=24.0, skill=0.6, grip=4.0, motor_noise=0.0115, horizon=0.48, correction=0.65,
                     learning=0.15, entrainment=0.6),
    "elder": Person(name="elder", age=76.0, skill=0.8, grip=3.0, strength=9.0, motor_noise=0.01, visual_delay=0.235,
                    reflex_delay=0.05, refractory=0.2, horizon=0.54, tremor=0.14, tremor_frequency=7.0),
    "lefty": Person(name="lefty", hand="left"),
    "firm": Person(name="firm", grip=8.0, stiffness=420.0, strength=30.0),
    "light": Person(name="light", grip=1.0, stiffness=120.0, mass=0.4),
}  # fmt: skip
"""Named persons, each a point of the population that represents a kind of user."""


def persona(name: str) -> Person:
    """A person by name, or by ``seed`` and ``place`` in a population: ``"7"`` or ``"7:3"``.

    Raises
    ------
    SimError
        If there is no such person.
    """
    check_kind("name", name, str)
    if name in PERSONAS:
        return PERSONAS[name]
    if drawn := re.fullmatch(r"(\d{1,18})(?::(\d{1,6}))?", name):
        return _draw_person(int(drawn[1]), int(drawn[2] or "0"))
    known = ", ".join(PERSONAS)
    raise SimError(f"no person {name!r}; there are {known}, or SEED:PLACE of a population, such as 7:3")


_MAX_SIZE = 1_000_000  # largest size of a population


def population(number: int, seed: int) -> tuple[Person, ...]:
    """Draw a population; a larger one of the same seed begins with the same people.

    Age is uniform between 20 and 75, skill is Beta(8.5, 1.5), one in ten is left-handed. The numbers of `_LOG_SPREAD`
    are log-normal about the median person's, clipped to their intervals; all others are the median person's. Endpoint
    scatter and horizon grow as skill falls; delays, refractory period and horizon grow with age.

    Parameters
    ----------
    number : int
        Number of people, one or more.
    seed : int
        0 or more.

    Raises
    ------
    SimError
        If a number is outside its interval.
    """
    check_kind("number", number, int)
    check_kind("seed", seed, int)
    if not 1 <= number <= _MAX_SIZE:
        raise SimError(f"a population of {number}; expected 1 to {_MAX_SIZE} people")
    if seed < 0:
        raise SimError(f"the seed of a population is {seed}; expected 0 or more")
    return tuple(_draw_person(seed, place) for place in range(number))


def _draw_person(seed: int, place: int) -> Person:
    rng, name, median = np.random.default_rng([seed, place]), f"{seed}:{place}", Person()
    age, skill, is_left = rng.uniform(20.0, 75.0), rng.beta(*_SKILL_BETA), rng.random() < _LEFT_HANDED_FRACTION
    values = {key: getattr(median, key) * np.exp(spread * rng.normal()) for key, spread in _LOG_SPREAD.items()}
    slowing, scatter_factor = 1.0 + _SLOWING_PER_YEAR * max(0.0, age - 30.0), 1.0 + 0.8 * (_MEAN_SKILL - skill)
    for key in ("visual_delay", "reflex_delay", "refractory", "horizon"):
        values[key] *= slowing
    for key in ("motor_noise", "horizon"):
        values[key] *= scatter_factor
    clipped = {key: float(np.clip(value, *INTERVALS[key][:2])) for key, value in values.items()}
    return replace(
        median, name=name, age=float(age), hand="left" if is_left else "right", skill=float(skill), **clipped
    )
