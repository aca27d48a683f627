"""A participant: a simulated person together with her wishes, given to the loop in place of an arm."""

import math
from dataclasses import dataclass, field

import numpy as np

from sim.errors import SimError
from sim.users.intents.own import Own
from sim.users.person import person_state as at
from sim.users.person.body import arm_matrices, check_steps
from sim.users.person.eye import IMAGE_INTERVAL, no_eye
from sim.users.person.person import Person
from sim.users.person.person_state import PersonState
from sim.users.person.random_numbers import initial_rng
from sim.users.person.wishes import Wishes

MAX_PERSON_PERIOD = 0.01  # [s] longest servo period at which a person is stepped: a third of the shortest reflex delay
_TREMOR_QUALITY = 4.0  # quality factor of the tremor's resonance: a peak about 2 Hz wide


@dataclass(frozen=True)
class Participant:
    """A person and what she wants.

    Parameters
    ----------
    person : Person
        Her arm, senses and motor system.
    wishes : Wishes
        What she wants.
    seed : int
        Seed of her noise: the same seed gives the same run.
    own : Own, optional
        A user-defined intent that writes her wishes.
    """

    person: Person = field(default_factory=Person)
    wishes: Wishes = field(default_factory=Wishes)
    seed: int = 1
    own: Own | None = None

    turns: tuple[()] = ()
    """Empty: a person lets the gimbal swing freely."""

    def holding(self, period: float, physics_step: float) -> PersonState:
        """The person's state for the servo loop, without the address of her compiled time step.

        Parameters
        ----------
        period, physics_step : float
            Servo period and physics step [s].

        Raises
        ------
        SimError
            If either is too long for this person, or her own intent cannot be compiled.
        """
        person = self.person
        if period > MAX_PERSON_PERIOD:
            raise SimError(
                f"a servo period of {period:g} s is too long for a person, who has reflexes within 0.03 s; "
                f"expected {MAX_PERSON_PERIOD:g} s or less"
            )
        check_steps(person, physics_step)
        inertia, stiffness, damping = arm_matrices(person)
        reflex, seen = (max(1, round(delay / period)) for delay in (person.reflex_delay, person.visual_delay))
        address = 0 if self.own is None else self.own.address()
        return PersonState(
            units=np.array([0, address], dtype=np.int64), numbers=self._numbers(period, reflex, seen),
            memory=np.zeros(at.N_MEMORY), vectors=np.zeros((at.N_VECTORS, 3)),
            inertia=inertia, mobility=np.linalg.inv(inertia).astype(np.float64), stiffness=stiffness, damping=damping,
            wishes=self.wishes.rows.copy(), past=np.zeros((max(reflex, seen) + 1, at.PAST_SIZE)),
            plans=np.zeros((2, 6, 3)), learned=np.zeros((at.LEARNED_PARTS, 3)), rng=initial_rng(self.seed),
            eye=no_eye(),
        )  # fmt: skip

    def _numbers(self, period: float, reflex: int, seen: int) -> at.Array:
        person, n = self.person, np.zeros(at.N_NUMBERS)
        for name in ("grip", "stiffening", "grip_stiffness", "grip_damping", "strength", "fatigue", "reflex_gain",
                     "skill", "felt_noise", "felt_force_noise", "direction_noise", "seen_noise", "refractory",
                     "horizon", "motor_noise", "force_noise", "correction", "caution", "entrainment",
                     "learning"):  # fmt: skip
            n[getattr(at, name.upper())] = getattr(person, name)
        n[at.PERIOD], n[at.WISH_PERIOD], n[at.LAP] = period, self.wishes.period, self.wishes.lap
        n[at.REFLEX_TICKS], n[at.SEEN_TICKS] = reflex, seen
        n[at.LOOK_TICKS] = max(1, round(IMAGE_INTERVAL / period))
        n[at.TREMOR_A], n[at.TREMOR_B], n[at.TREMOR_GAIN] = tremor_filter(person, period)
        return n


def tremor_filter(person: Person, period: float) -> tuple[float, float, float]:
    """Coefficients a, b, g of y = a y₋₁ + b y₋₂ + g w, which turns white noise w into the tremor of one axis.

    The person's `tremor` is the RMS of the vector of three axes, hence the factor 3 of the variance.
    """
    radius = math.exp(-math.pi * person.tremor_frequency / _TREMOR_QUALITY * period)
    angle = 2.0 * math.pi * person.tremor_frequency * period
    a, b = 2.0 * radius * math.cos(angle), -radius * radius
    variance = (1.0 - b) / ((1.0 + b) * ((1.0 - b) ** 2 - a * a))
    return a, b, person.tremor / math.sqrt(3.0 * variance)
