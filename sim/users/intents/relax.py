"""Relax: let the stylus go where it goes."""

from dataclasses import dataclass

from controllers.curves.trajectory import Trajectory
from sim.users.intents.intent import PERIOD, moments
from sim.users.wishes import Wishes, resting


@dataclass(frozen=True)
class Relax:
    """Hold the stylus and let it be led: the arm is slack and takes any place for its own."""

    def wishes(self, curve: Trajectory, seconds: float, seed: int) -> Wishes:
        """See `PersonIntent`."""
        return Wishes(resting(len(moments(seconds))), PERIOD, curve.duration)
