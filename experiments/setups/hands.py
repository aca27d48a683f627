"""The hand of a run: what the simulated user does, and how the stylus is held."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from experiments.config.run_config import STRETCHING, RunConfig
from experiments.setups.expression import lap_turns
from experiments.setups.stretch import edited_until
from sim.users.arm import Arm
from sim.users.intent import Grab, Push

Array = npt.NDArray[np.float64]

PUSH_FORCE = 2.5  # of the hand that pushes twice a lap [N]; the motors can answer that for ever
RIVER_PUSH = 1.0  # over into another river: in the middle of what takes a hand there and does not throw it out [N]
UPRIGHT = (1.0, 0.0, 0.0, 0.0)  # orientation of the stylus along the default curve

_CROSSING = 0.5  # of the lap, where the wave rises through the level river
_LEAD, _OVER = 0.05, 0.3  # [s] before it, when a push across begins, and [s] that it lasts
_PLACE = 3e-3  # [m] a hand this near the place where it means to begin does
_AWAY = 1e-3  # [m] by which beginnings differ
_SLOW, _FURTHEST = 1e-3, 0.05  # [m/s] below which they differ less along a curve, share of a lap by which at most


def stylus_path(points: Array) -> Array:
    """Stylus poses at points of H with the stylus upright, shape (n, 3) → (n, 7)."""
    return np.hstack((points, np.tile(UPRIGHT, (len(points), 1))))


class Beginning(NamedTuple):
    """Where the stylus is when a run begins, and how it moves, in H.

    Attributes
    ----------
    point, velocity, acceleration : Array
        [m], [m/s], [m/s²], shape (3,).
    """

    point: Array
    velocity: Array
    acceleration: Array


def beginning(curve: Trajectory, rng: np.random.Generator, moves: bool) -> Beginning:
    """Where a run begins: about a millimetre from the start of a curve.

    Parameters
    ----------
    curve : Trajectory
        Timed as the hand is to move.
    rng : numpy.random.Generator
        Of where exactly.
    moves : bool
        Whether it begins in motion: then further along the curve, not beside it, for a hand is drawn back to its curve
        within a fiftieth of a second, and a figure at full speed cannot follow it there.
    """
    away = rng.normal(scale=_AWAY, size=3)
    if not moves:
        return Beginning(curve.point(curve.start) + away, np.zeros(3), np.zeros(3))
    speed = float(np.linalg.norm(curve.velocity(curve.start)))
    phase = curve.start + min(float(np.linalg.norm(away)) / max(speed, _SLOW), _FURTHEST * curve.duration)
    return Beginning(curve.point(phase), curve.velocity(phase), curve.acceleration(phase))


def user_arm(config: RunConfig, curve: Trajectory, grabs: tuple[Grab, ...]) -> Arm:
    """Arm and intent of the user that a configuration names.

    Raises
    ------
    ParameterError
        If a hand that traces should grab.
    """
    pushes, turns, lap = config.pushes, config.turns, curve.duration
    laps = range(1, max(2, int(config.seconds / lap)))
    if config.user == "turn" and not turns:
        turns = tuple(turn for k in laps for turn in lap_turns(k * lap, lap, k - 1))
    if config.user == "push" and not pushes and config.mode == "rivers":
        pushes = river_pushes(curve, config.seconds)
    elif config.user == "push" and not pushes:
        begin = first_pushed_lap(curve, grabs)
        laps = range(max(1, int((config.seconds - begin) / lap)))
        pushes = tuple(push for k in laps for push in lap_pushes(begin + k * lap, lap))
    if config.user == "trace" and grabs:
        raise ParameterError("a hand that traces cannot grab; choose --user relaxed, push or turn")
    if config.user == "trace":
        times = np.arange(0.0, config.seconds, 0.01)
        return Arm(path=curve.point(times), period=0.01, pushes=pushes, turns=turns)
    return Arm(pushes=pushes, grabs=grabs, turns=turns)


def first_pushed_lap(curve: Trajectory, grabs: tuple[Grab, ...]) -> float:
    """When the default hand that pushes begins to [s]: with the second lap, the first one after all grabs left out."""
    return curve.duration + (edited_until(grabs) if grabs else 0.0)


def handled(config: RunConfig) -> tuple[tuple[float, float], ...]:
    """From and until when [s] the hand does something else than push: it grabs, traces or leads."""
    if config.user == "trace" or config.mode == "lead":
        return ((0.0, np.inf),)
    return tuple((grab.start, grab.end) for grab in config.grabs)


def hand_remarks(config: RunConfig, curve: Trajectory) -> tuple[str, ...]:
    """What is said of a hand whose doings come too late, or are of no effect."""
    remarks: list[str] = []
    performed, pushed = edited_until(config.grabs), first_pushed_lap(curve, config.grabs)
    if config.mode == "stretch-then-follow" and config.seconds <= performed:
        remarks.append(f"the curve is bent until {performed:.1f} s and performed then; give --seconds more than that")
    elif config.mode in STRETCHING and config.user == "push" and not config.pushes and config.seconds <= pushed:
        remarks.append(
            f"the hand bends the curve first and pushes from {pushed:.1f} s on; give --seconds more than that"
        )
    if config.user == "turn" and not config.expressive:
        remarks.append("the hand turns the stylus, and this map does not look at that; --expressive does")
    return tuple(remarks)


def lap_pushes(start: float, lap: float, force: float = PUSH_FORCE) -> tuple[Push, Push]:
    """A push outwards and one inwards [N] in the lap that begins at a time [s]."""
    return (
        Push(start + 0.1 * lap, 0.3 * lap, force),
        Push(start + 0.6 * lap, 0.3 * lap, -force),
    )


def river_pushes(curve: Trajectory, seconds: float) -> tuple[Push, ...]:
    """Pushes from one default river into another: up where the wave rises through the curve, if the hand is there.

    Parameters
    ----------
    curve : Trajectory
        The default curve.
    seconds : float
        Of the run [s].
    """
    lap = curve.duration
    x, y, z = (float(value) for value in curve.point(curve.start + _CROSSING * lap - _LEAD))
    starts = lap * np.arange(0.25, max(1.0, seconds / lap))
    return tuple(Push(float(start), _OVER, RIVER_PUSH, (0.0, 0.0, 1.0), (x, y, z), _PLACE) for start in starts)
