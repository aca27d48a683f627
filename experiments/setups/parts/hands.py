"""The simulated hand of a run: where the stylus begins, and which pushes, grabs and turns the user makes."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from controllers.curves.trajectory import Trajectory
from experiments.config.run_config import PERSON_INTENTS, User
from experiments.setups.parts.expression import lap_turns
from geometry.arrays import Array
from sim.users.hand.actions import Grab, Push
from sim.users.hand.arm import Arm
from sim.users.intents import Bend, ChangeOver, Own, Press, Relax, Trace
from sim.users.intents.intent import PersonIntent
from sim.users.participant import Participant
from sim.users.person.person import Person

PUSH_FORCE = 2.5  # [N] of a hand that pushes twice a lap; more than the motors' continuous force
# [s] Longest push, that of a lap of 20 s: then the motors still have 2 N more. After 11 s they are too hot to hold the
# hand, and it is thrown out.
_MAX_PUSH_TIME = 6.0
# [N] of a push into another river: 0.5 N takes none of 12 hands there, 0.9 and 1.1 N ten and eleven, and 2 N throws
# all of them out (docs/validation/crossing-rivers.md).
RIVER_PUSH = 1.0
# [m] distance from its place within which a push into another river begins: a fifth of a tube
PUSH_START_DISTANCE = 3e-3
# [m/s] in slower rivers every push tried was too weak to change river, or threw the hand out
MIN_PUSHED_RIVER_SPEED = 0.0235
PAUSE_TIME = 0.5  # [s] between two actions of the default hand, and before a bent curve is performed
TRACE_SAMPLE_TIME = 0.01  # [s] between samples of a path that the hand traces

_CROSSING_PHASE = 0.5  # share of the lap at which the wave rises through the level river
# [s] from the start of a push to the crossing, and its duration
_LEAD_TIME, _PUSH_DURATION = 0.05, 0.3
_REFERENCE_SPEED = 0.0749  # [m/s] of the default rivers, at which these and `RIVER_PUSH` were measured
_MAX_SCALED_SPEED = 0.2  # [m/s] in faster rivers a push is the same as at this speed: a harder one throws the hand out
# Power of the speed's share with which a push is weaker: 0.1 throws hands out, 0.25 leaves some behind.
_SLOW_FORCE_EXPONENT = 0.2
_PEAK_SHARE = 0.25  # of the lap: where, at the latest, `lap_pushes` and `lap_turns` have their first peaks
_START_SPREAD = 1e-3  # [m] standard deviation of the start position
# [m/s] least speed that turns an offset into a phase; largest phase as a share of a lap
_MIN_START_SPEED, _MAX_START_PHASE = 1e-3, 0.05


class Beginning(NamedTuple):
    """Position [m], velocity [m/s] and acceleration [m/s²] of the stylus when a run begins, in H, shapes (3,)."""

    point: Array
    velocity: Array
    acceleration: Array


def beginning(curve: Trajectory, rng: np.random.Generator, moves: bool) -> Beginning:
    """Start state of the stylus: about a millimetre from the start of a curve.

    Parameters
    ----------
    curve : Trajectory
        φ, with the timing that the hand is to have.
    rng : numpy.random.Generator
        Source of the random offset.
    moves : bool
        Whether the run begins in motion. The offset is then along the curve, not beside it: the field pulls a hand back
        to its curve within a fiftieth of a second, which a figure at full speed cannot follow.
    """
    offset = rng.normal(scale=_START_SPREAD, size=3)
    if not moves:
        return Beginning(curve.point(curve.start) + offset, np.zeros(3), np.zeros(3))
    speed = float(np.linalg.norm(curve.velocity(curve.start)))
    phase = curve.start + min(
        float(np.linalg.norm(offset)) / max(speed, _MIN_START_SPEED), _MAX_START_PHASE * curve.duration
    )
    return Beginning(curve.point(phase), curve.velocity(phase), curve.acceleration(phase))


def resolved_user(
    user: User, curve: Trajectory, seconds: float, grabs: tuple[Grab, ...] = (), pushes: tuple[Push, ...] | None = None
) -> User:
    """The user with default pushes, turns and grabs filled in.

    Parameters
    ----------
    user : User
        The user as configured.
    curve : Trajectory
        φ, with the timing that the hand is to have.
    seconds : float
        Duration of the run [s].
    grabs : tuple of Grab
        Default grabs.
    pushes : tuple of Push, optional
        Default pushes of a hand that pushes; without them it pushes outwards and inwards once a lap.

    Raises
    ------
    ParameterError
        If the default grabs are for a hand that does not grab (see `User`).
    """
    grabs, turns, lap = user.grabs or grabs, user.turns, curve.duration
    if user.does == "turn" and not turns:
        begin = _first_acting(lap, lap, seconds)
        laps = range(max(1, int((seconds - begin) / lap)))
        turns = tuple(turn for k in laps for turn in lap_turns(begin + k * lap, lap, k))
    user_pushes = user.pushes
    if user.does == "push" and not user_pushes and pushes is not None:
        user_pushes = pushes
    elif user.does == "push" and not user_pushes:
        begin = first_pushed_lap(curve, grabs)
        begin = begin if grabs else _first_acting(begin, lap, seconds)
        laps = range(max(1, int((seconds - begin) / lap)))
        user_pushes = tuple(push for k in laps for push in lap_pushes(begin + k * lap, lap))
    return User(does=user.does, pushes=user_pushes, turns=turns, grabs=grabs, person=user.person)


def user_hand(
    user: User, curve: Trajectory, seconds: float, seed: int, other: Trajectory | None = None
) -> Arm | Participant:
    """The hand of a resolved user, for a run of given duration [s] and seed; a person changes over to an `other` curve.

    Raises
    ------
    SimError
        If a push or a grab is one that a person cannot do.
    """
    if user.person is not None:
        intent = intent_of(user)
        intent = ChangeOver(other) if isinstance(intent, ChangeOver) else intent
        return participant(user.person, intent, curve, seconds, seed)
    if user.does == "trace":
        # Beyond the end, where a path rests.
        times = np.arange(0.0, seconds + 2.0 * TRACE_SAMPLE_TIME, TRACE_SAMPLE_TIME)
        return Arm(path=curve.point(times), period=TRACE_SAMPLE_TIME, pushes=user.pushes, turns=user.turns)
    return Arm(pushes=user.pushes, grabs=user.grabs, turns=user.turns)


def participant(person: Person, intent: PersonIntent, curve: Trajectory, seconds: float, seed: int) -> Participant:
    """A person with an intent about a curve, for a run of given duration [s] and seed."""
    own = intent if isinstance(intent, Own) else None
    return Participant(person, intent.wishes(curve, seconds, seed), seed, own)


def intent_of(user: User) -> PersonIntent:
    """The intent of a person, from the user's grabs, pushes or kind.

    Raises
    ------
    SimError
        If a push or a grab is one that a person cannot do.
    """
    if user.grabs:
        return Bend(user.grabs)
    return Press(user.pushes) if user.pushes else _INTENTS[user.does]


_INTENTS: Mapping[str, PersonIntent] = {"relaxed": Relax(), "push": Relax(), "trace": Trace(), **PERSON_INTENTS}


def first_pushed_lap(curve: Trajectory, grabs: tuple[Grab, ...]) -> float:
    """Time at which the default hand begins to push [s]: one lap after the start, or after all grabs."""
    return curve.duration + (edited_until(grabs) if grabs else 0.0)


def _first_acting(begin: float, lap: float, seconds: float) -> float:
    """Time at which pushes or turns begin [s]: before `begin` if the run would end before the first one's peak."""
    return begin if begin + _PEAK_SHARE * lap < seconds else max(0.0, seconds - lap)


def handling_spans(user: User) -> tuple[tuple[float, float], ...]:
    """Intervals of time [s] in which a hand grabs or traces."""
    if user.traces:
        return ((0.0, np.inf),)
    return tuple((grab.at, grab.end) for grab in user.grabs)


def turning_remark(user: User, oriented: bool) -> tuple[str, ...]:
    """Remark, if the hand turns the stylus on a map that ignores its orientation."""
    if user.does == "turn" and not oriented:
        return ("the hand turns the stylus, but this map ignores its orientation; use --expressive",)
    return ()


def late_remark(user: User, seconds: float) -> tuple[str, ...]:
    """Remarks, if the first push or turn has its peak after the end of a run of this duration [s]."""
    peaks = {
        name: min((each.at + 0.5 * each.seconds for each in actions), default=0.0)
        for name, actions in (("push", user.pushes), ("turn", user.turns))
    }
    return tuple(
        f"the first {name} has its peak at {peak:.4g} s, after the run's end; give --seconds more than that"
        for name, peak in peaks.items()
        if peak >= seconds
    )


def edited_until(grabs: tuple[Grab, ...]) -> float:
    """End of all grabs and the pause after them [s]."""
    return max((grab.end for grab in grabs), default=0.0) + PAUSE_TIME


def lap_pushes(start: float, lap: float, force: float = PUSH_FORCE) -> tuple[Push, Push]:
    """A push outwards and one inwards, of peak `force` [N], in the lap that begins at `start` [s]."""
    duration = min(0.3 * lap, _MAX_PUSH_TIME)
    return (Push(start + 0.1 * lap, duration, force), Push(start + 0.6 * lap, duration, -force))


def river_pushes(curve: Trajectory, seconds: float) -> tuple[Push, ...]:
    r"""Upward pushes from one default river into another, where the wave rises through the curve, once a lap.

    At s times the default rivers' speed a push lasts 1/s times as long. Against a river's damping it then needs s times
    the force, and against its stiffness the same force, since distances are the same. In faster rivers, up to
    `_MAX_SCALED_SPEED`, damping dominates and the push gets s times the force; in slower ones it gets s^0.2 times the
    force, between the two cases. There are no pushes in rivers slower than `MIN_PUSHED_RIVER_SPEED`.

    Parameters
    ----------
    curve : Trajectory
        The default curve.
    seconds : float
        Duration of the run [s].
    """
    lap = curve.duration
    pace = curve.length / lap
    if pace < MIN_PUSHED_RIVER_SPEED:
        return ()
    speed_ratio = min(pace, _MAX_SCALED_SPEED) / _REFERENCE_SPEED
    x, y, z = (float(value) for value in curve.point(curve.start + _CROSSING_PHASE * lap - _LEAD_TIME / speed_ratio))
    duration = _PUSH_DURATION / speed_ratio
    force = speed_ratio ** (1.0 if speed_ratio > 1.0 else _SLOW_FORCE_EXPONENT) * RIVER_PUSH
    starts = lap * np.arange(0.25, max(1.0, seconds / lap))
    return tuple(
        Push(float(start), duration, force, (0.0, 0.0, 1.0), (x, y, z), PUSH_START_DISTANCE) for start in starts
    )
