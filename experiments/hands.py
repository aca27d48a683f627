"""The hand of a run: what the simulated user does, and how the stylus is held."""

import numpy as np
import numpy.typing as npt

from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from experiments.config import RunConfig
from experiments.expression import lap_turns
from sim.users.arm import Arm
from sim.users.intent import Grab, Push

Array = npt.NDArray[np.float64]

PUSH_FORCE = 2.5  # of the hand that pushes twice a lap [N]; the motors can answer that for ever
UPRIGHT = (1.0, 0.0, 0.0, 0.0)  # orientation of the stylus along the default curve


def stylus_path(points: Array) -> Array:
    """Stylus poses at points of H with the stylus upright, shape (n, 3) → (n, 7)."""
    return np.hstack((points, np.tile(UPRIGHT, (len(points), 1))))


def user_arm(config: RunConfig, curve: Trajectory, grabs: tuple[Grab, ...]) -> Arm:
    """Arm and intent of the user that a configuration names.

    Raises
    ------
    ParameterError
        If a hand that traces should grab.
    """
    pushes, turns = config.pushes, config.turns
    laps = range(1, max(2, int(config.seconds / curve.duration)))
    if config.user == "turn" and not turns:
        turns = tuple(turn for lap in laps for turn in lap_turns(lap * curve.duration, curve.duration, lap - 1))
    if config.user == "push" and not pushes:
        pushes = tuple(push for lap in laps for push in lap_pushes(lap * curve.duration, curve.duration))
    if config.user == "trace" and grabs:
        raise ParameterError("a hand that traces cannot grab; choose --user relaxed or push")
    if config.user == "trace":
        times = np.arange(0.0, config.seconds, 0.01)
        return Arm(path=curve.point(times), period=0.01, pushes=pushes, turns=turns)
    return Arm(pushes=pushes, grabs=grabs, turns=turns)


def lap_pushes(start: float, lap: float, force: float = PUSH_FORCE) -> tuple[Push, Push]:
    """A push outwards and one inwards [N] in the lap that begins at a time [s]."""
    return (
        Push(start + 0.1 * lap, 0.3 * lap, force),
        Push(start + 0.6 * lap, 0.3 * lap, -force),
    )
