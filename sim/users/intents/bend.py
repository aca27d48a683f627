"""The intent to hold and bend a stretchy tube."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controllers.checks import check_field_types
from controllers.curves.trajectory import Trajectory
from sim.errors import SimError
from sim.users.hand.actions import Grab, grab_table
from sim.users.intents.intent import WISH_PERIOD, between, moments
from sim.users.person.wishes import ENGAGED, PLACE, SWITCH, Wishes, resting


@dataclass(frozen=True)
class Bend:
    """Grab the curve with the switch at given places, carry it, release it; in between be led by the field.

    Parameters
    ----------
    grabs : sequence of Grab
        Each must have a place.

    Raises
    ------
    SimError
        If there is no grab, grabs overlap, or one has no place, since a person decides where she grabs the curve.
    """

    grabs: Sequence[Grab]

    def __post_init__(self) -> None:
        check_field_types(self)
        if len(self.grabs) == 0:
            raise SimError("a person who bends a curve has no grabs; expected one or more")
        grab_table(self.grabs)
        if any(grab.place is None for grab in self.grabs):
            raise SimError("a person's grab has no position; expected where it takes hold, in H [m]")

    def wishes(self, curve: Trajectory, seconds: float, seed: int) -> Wishes:
        """See `PersonIntent`."""
        t, grabs = moments(seconds), sorted(self.grabs, key=lambda grab: grab.at)
        rows = resting(len(t))
        # A person plans ahead of her clock, by the place's velocity and acceleration: it moves smoothly all the time.
        left, place = 0.0, np.array(grabs[0].place)
        path = np.tile(place, (len(t), 1))
        for grab in grabs:
            grip_start, reached, carry = grab.at + grab.reach, np.array(grab.place), np.array(grab.carry)
            arrived = between(t, left, max(grab.at, left + grab.reach))
            carried = between(t, grip_start, grip_start + grab.seconds)
            path += arrived[:, None] * (reached - place) + carried[:, None] * carry
            is_busy = (t >= grab.at) & (t < grab.end)
            rows[is_busy, ENGAGED] = 1.0
            rows[is_busy & (t >= grip_start), SWITCH] = 1.0
            left, place = grab.end, reached + carry
        rows[:, PLACE : PLACE + 3] = path
        return Wishes(rows, WISH_PERIOD)
