"""The intent to hold and bend a stretchy tube."""

import itertools
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
        # A person plans ahead of her clock: before and after a grab the place is where it begins and ends.
        changes = [0.5 * (before.end + after.at) for before, after in itertools.pairwise(grabs)]
        nearest = np.searchsorted(changes, t)
        for k, grab in enumerate(grabs):
            grip_start = grab.at + grab.reach
            carried = between(t, grip_start, grip_start + grab.seconds)
            near, is_busy = nearest == k, (t >= grab.at) & (t < grab.end)
            rows[near, PLACE : PLACE + 3] = (np.array(grab.place) + carried[:, None] * np.array(grab.carry))[near]
            rows[is_busy, ENGAGED] = 1.0
            rows[is_busy & (t >= grip_start), SWITCH] = 1.0
        return Wishes(rows, WISH_PERIOD)
