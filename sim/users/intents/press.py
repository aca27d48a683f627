"""The intent to push the stylus at given times."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controllers.checks import check_field_types
from controllers.curves.trajectory import Trajectory
from sim.errors import SimError
from sim.users.hand.actions import Push
from sim.users.intents.intent import WISH_PERIOD, centre, moments
from sim.users.person.wishes import FORCE, Wishes, resting


@dataclass(frozen=True)
class Press:
    """Be led by the field, and push the stylus at given times with an additional force.

    Parameters
    ----------
    pushes : sequence of Push
        Pushes without a place; those without a direction are directed away from the curve's centre.

    Raises
    ------
    SimError
        If there is no push, or one has a place.
    """

    pushes: Sequence[Push]

    def __post_init__(self) -> None:
        check_field_types(self)
        if len(self.pushes) == 0:
            raise SimError("a person who pushes has no pushes; expected one or more")
        if any(push.place is not None for push in self.pushes):
            raise SimError("a person's push has a position; expected a time and a direction")

    def wishes(self, curve: Trajectory, seconds: float, seed: int) -> Wishes:
        """See `PersonIntent`."""
        t, middle = moments(seconds), centre(curve)
        rows = resting(len(t))
        outward = curve.point(curve.start + t) - middle
        outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-9)
        for push in self.pushes:
            phase = np.clip((t - push.at) / push.seconds, 0.0, 1.0)
            direction = outward if push.direction is None else np.array(push.direction) / np.linalg.norm(push.direction)
            rows[:, FORCE : FORCE + 3] += (push.force * np.sin(np.pi * phase) ** 2)[:, None] * direction
        return Wishes(rows, WISH_PERIOD, curve.duration)
