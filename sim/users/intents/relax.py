"""The intent to be passive: the stylus is led by the field."""

from dataclasses import dataclass

from controllers.curves.trajectory import Trajectory
from sim.users.intents.intent import PERIOD, moments
from sim.users.person.wishes import Wishes, resting


@dataclass(frozen=True)
class Relax:
    """Hold the stylus and be led: the arm is slack, and its rest position follows the hand."""

    def wishes(self, curve: Trajectory, seconds: float, seed: int) -> Wishes:
        """See `PersonIntent`."""
        return Wishes(resting(len(moments(seconds))), PERIOD, curve.duration)
