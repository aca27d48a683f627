"""The hand of a run: what the simulated user does, and how the stylus is held."""

from typing import NamedTuple

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.state import Array
from experiments.config.run_config import User
from experiments.setups.expression import lap_turns
from sim.users.arm import Arm
from sim.users.intent import Grab, Push
from sim.users.intents import (
    Bend,
    ChangeOver,
    CutCorner,
    Exaggerate,
    GetLost,
    Own,
    Press,
    Relax,
    Resist,
    Trace,
)
from sim.users.intents.intent import PersonIntent
from sim.users.participant import Participant
from sim.users.person import Person

PUSH_FORCE = 2.5  # of the hand that pushes twice a lap [N]; the motors can answer that for ever
RIVER_PUSH = 1.0  # over into another river: in the middle of what takes a hand there and does not throw it out [N]
PAUSE = 0.5  # [s] between two doings of the default hand, and before a bent curve is performed

_CROSSING = 0.5  # of the lap, where the wave rises through the level river
_LEAD, _OVER = 0.05, 0.3  # [s] before it, when a push across begins, and [s] that it lasts
_PLACE = 3e-3  # [m] a hand this near the place where it means to begin does
_AWAY = 1e-3  # [m] by which beginnings differ
_SLOW, _FURTHEST = 1e-3, 0.05  # [m/s] below which they differ less along a curve, share of a lap by which at most


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


def resolved_user(
    user: User, curve: Trajectory, seconds: float, grabs: tuple[Grab, ...] = (), pushes: tuple[Push, ...] | None = None
) -> User:
    """A user with all that it does by default written out.

    Parameters
    ----------
    user : User
        As it was asked for.
    curve : Trajectory
        Timed as the hand is to move.
    seconds : float
        Of the run [s].
    grabs : tuple of Grab
        What it takes hold of by default.
    pushes : tuple of Push, optional
        What one that pushes does by default, where that is not outwards and inwards once a lap.

    Raises
    ------
    ParameterError
        If a hand that traces should grab.
    """
    grabs, turns, lap = user.grabs or grabs, user.turns, curve.duration
    if user.traces and grabs:
        raise ParameterError("a hand that traces cannot grab; choose --user relaxed, push or turn")
    if user.does == "turn" and not turns:
        laps = range(1, max(2, int(seconds / lap)))
        turns = tuple(turn for k in laps for turn in lap_turns(k * lap, lap, k - 1))
    done = user.pushes
    if user.does == "push" and not done and pushes is not None:
        done = pushes
    elif user.does == "push" and not done:
        begin = first_pushed_lap(curve, grabs)
        laps = range(max(1, int((seconds - begin) / lap)))
        done = tuple(push for k in laps for push in lap_pushes(begin + k * lap, lap))
    return User(does=user.does, pushes=done, turns=turns, grabs=grabs, person=user.person)


def user_hand(user: User, curve: Trajectory, seconds: float, seed: int) -> Arm | Participant:
    """Hand and intent of a user whose doings are written out, for a run of so long [s] and its seed.

    Raises
    ------
    SimError
        If a push or a grab is none that a person can do.
    """
    if user.person is not None:
        return participant(user.person, intent_of(user), curve, seconds, seed)
    if user.does == "trace":
        times = np.arange(0.0, seconds, 0.01)
        return Arm(path=curve.point(times), period=0.01, pushes=user.pushes, turns=user.turns)
    return Arm(pushes=user.pushes, grabs=user.grabs, turns=user.turns)


def participant(person: Person, intent: PersonIntent, curve: Trajectory, seconds: float, seed: int) -> Participant:
    """A person who means to do something about a curve, for a run of so long [s] and its seed."""
    own = intent if isinstance(intent, Own) else None
    return Participant(person, intent.wishes(curve, seconds, seed), seed, own)


def intent_of(user: User) -> PersonIntent:
    """What a person means to do, by what is asked for.

    Raises
    ------
    SimError
        If a push or a grab is none that a person can do.
    """
    if user.grabs:
        return Bend(user.grabs)
    return Press(user.pushes) if user.pushes else _INTENTS[user.does]


_INTENTS: dict[str, PersonIntent] = {
    "relaxed": Relax(), "push": Relax(), "trace": Trace(), "exaggerate": Exaggerate(), "cut": CutCorner(),
    "change": ChangeOver(), "resist": Resist(), "lost": GetLost(),
}  # fmt: skip


def first_pushed_lap(curve: Trajectory, grabs: tuple[Grab, ...]) -> float:
    """When the default hand that pushes begins to [s]: with the second lap, the first one after all grabs left out."""
    return curve.duration + (edited_until(grabs) if grabs else 0.0)


def handled(user: User) -> tuple[tuple[float, float], ...]:
    """From and until when [s] a hand does something else than push: it grabs or traces."""
    if user.traces:
        return ((0.0, np.inf),)
    return tuple((grab.at, grab.end) for grab in user.grabs)


def turning_remark(user: User, expressive: bool) -> tuple[str, ...]:
    """What is said of a hand that turns a stylus whose orientation does nothing."""
    if user.does == "turn" and not expressive:
        return ("the hand turns the stylus, and this map does not look at that; --expressive does",)
    return ()


def edited_until(grabs: tuple[Grab, ...]) -> float:
    """When a hand has done all its grabs, and a pause after them [s]."""
    return max((grab.end for grab in grabs), default=0.0) + PAUSE


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
