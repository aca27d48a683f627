"""Runs on a lifted map: FOLLOW along one of its curves, or rivers along all of them."""

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.fields.bundle import RiverBundle
from controllers.fields.river import River
from controllers.haptic_map.lifted import Lifted
from controllers.haptic_map.lifting.transitions import MapTransition
from controllers.state import stylus_path
from experiments.config.modes import Rivers
from experiments.setups.modes.rivers import SIDE_BY_SIDE_HYSTERESIS, SIDE_BY_SIDE_SIGMA, river_time
from experiments.setups.parts.budget import fastest
from experiments.setups.parts.defaults import river_gains
from experiments.setups.parts.hands import PUSH_START_DISTANCE
from experiments.setups.parts.pace import check_reach, paced
from experiments.setups.parts.part_types import RiverChoice
from sim.body.figure import FigureGains
from sim.reference.cross_track import packed_cross_track
from sim.reference.reference import map_poses
from sim.users.hand.actions import Push

# Admissible speeds over the river's own: a hand from a neighbouring river has that river's speed.
_SPEED_RANGE = (0.5, 2.0)
EASE_TIME = 2.0
"""Time in which a river brings a hand to its own pace [s]: from the embedded walk to the run the figure falls at all of
six angles, if the pace changes as fast as the hand goes over (`experiments.studies.gait_changes`)."""
CROSS_RATE = 2.0
"""ω with which the figure follows a hand that goes from river to river [1/s]: half of the way after 0.84 s.

Pushed between two pairs of captured gaits, there and back, it has 6.8 to 12.5 % of weight. When it was chosen, on laps
that were closed otherwise, it had 7.0 to 11.2 %; with 3/s and a pace within 1 s it fell in one of four runs and had 9
to 22 % in the others, with 2.5/s and 1.5 s 9.5 to 10.9 %."""

_PUSH_DURATION = 0.6  # [s] duration of a push from one curve to another
# [s] from the start of a push to the transition: with 0.26 to 0.56 thirteen of fourteen figures that followed the hand
# at once stayed up, on the default layout and its mirror image
_PUSH_LEAD_TIME = 0.36
_CROSSING_RATE = 3.6  # [1/s] push force over (drag × distance of the curves) with which a hand just reaches the other
_STAY_LAPS = 3  # laps on the other curve
# [m]; embedded clips are 12 and 17 mm apart at their transitions; captures are 1.6 m apart at one, where a figure that
# changes over within a second fell.
_MAX_CARRY_DISTANCE = 0.25

# A foot that rises by 2 mm in mid-stance still bears load: with the default a runner counted as in flight and fell.
HELD_GAINS = FigureGains(contact_reach=0.004)
"""Gains of the physical figure on a lifted map, or on a curve that is bent."""


def curve_number(haptic_map: Lifted, curve: str) -> int:
    """Index of the curve of a given name or number as text; 0 for an empty string.

    Raises
    ------
    ParameterError
        If the map has none of that name.
    """
    if not curve:
        return 0
    if curve in haptic_map.names:
        return haptic_map.names.index(curve)
    if curve.isdecimal() and int(curve) < len(haptic_map.names):
        return int(curve)
    raise ParameterError(
        f"no curve {curve!r} in the map; there are {', '.join(haptic_map.names)}, or 0 to {len(haptic_map.names) - 1}"
    )


def lifted_curve(haptic_map: Lifted, curve: str) -> Trajectory:
    """The curve on which a run begins, timed at its clip's pace.

    Raises
    ------
    ParameterError
        If the map has none of that name.
    SimError
        If the Phantom does not reach it.
    """
    return check_reach(haptic_map.curve(curve_number(haptic_map, curve)))


def lifted_choice(haptic_map: Lifted, mode: Rivers) -> RiverChoice:
    """A river for every clip, named like it, timed to lead the Phantom at the clip's pace (`paced`).

    Raises
    ------
    SimError
        If the Phantom does not reach a curve.
    """
    stiffness, damping = river_gains(mode)
    given = tuple(haptic_map.curve(i) for i in range(len(haptic_map.names)))
    rivers = tuple(lifted_river(paced(curve, damping, stiffness), mode) for curve in given)
    choice = side_by_side(RiverBundle(rivers, haptic_map.names), given)
    return choice._replace(cross_track=packed_cross_track(CROSS_RATE, haptic_map.sites))


def side_by_side(bundle: RiverBundle, given: tuple[Trajectory, ...]) -> RiverChoice:
    """Rivers that lie side by side; their reference speed is the greatest, so that hands at that speed are taken."""
    pace = max(fastest(river.curve) for river in bundle.rivers)
    return RiverChoice(bundle, given, pace, SIDE_BY_SIDE_HYSTERESIS * pace, EASE_TIME, SIDE_BY_SIDE_SIGMA * pace)


def lifted_river(course: Trajectory, mode: Rivers) -> River:
    """The river of a clip along its course; it takes a hand at half to twice its own speed."""
    speeds = np.linalg.norm(course.velocity(np.linspace(course.start, course.end, 65)), axis=1)
    return River(course, mode.river_tube, river_time(mode), river_gains(mode)[1], np.outer(speeds, _SPEED_RANGE))


def best_transition(haptic_map: Lifted, curve: str) -> MapTransition:
    """The best transition of a curve.

    Raises
    ------
    ParameterError
        If the curve has none.
    """
    first = curve_number(haptic_map, curve)
    own = [at for at in haptic_map.transitions if first in (at.first, at.second)]
    if not own:
        pairs = [f"{haptic_map.names[at.first]} – {haptic_map.names[at.second]}" for at in haptic_map.transitions]
        raise ParameterError(
            f"the curve {haptic_map.names[first]!r} has no transition to push over at; there are: "
            f"{', '.join(pairs) or 'none'}; leave out --user push{', or begin on another --curve' * bool(pairs)}"
        )
    return own[0]


def places_apart(haptic_map: Lifted, transition: MapTransition) -> float:
    """Distance over the floor between the places of two motions at their transition [m]; needs compiled code.

    With q_i the point of curve i at the transition's θ, it is that of the roots of h(q_first) and h(q_second) in one
    frame of the lap. Transitions are found regardless of it: motions that travel there and back within a lap may be far
    apart.
    """
    points = np.array([haptic_map.curve_point(i, transition.angle) for i in (transition.first, transition.second)])
    first, second = map_poses(haptic_map, stylus_path(points), haptic_map.compiled().memory)[:, :2]
    return float(np.linalg.norm(second - first))


def carried_over(haptic_map: Lifted, transition: MapTransition) -> tuple[Lifted, tuple[str, ...]]:
    """The map, and a remark if a change at a transition moves the figure too far to be followed."""
    apart = places_apart(haptic_map, transition)
    if apart < _MAX_CARRY_DISTANCE:
        return haptic_map, ()
    names = f"{haptic_map.names[transition.first]} and {haptic_map.names[transition.second]}"
    return haptic_map, (
        f"where {names} agree, their positions on the floor are {apart:.1f} m apart: a push over carries the figure "
        "there within two seconds, and it may fall; clips that stay in place, or keep going, suit better",
    )


def default_pushes(haptic_map: Lifted, curve: str, mode: Rivers) -> tuple[Push, ...]:
    """Default pushes on rivers: over at the curve's best transition in the second lap, and back three laps later.

    Raises
    ------
    ParameterError
        If the curve has no transition.
    """
    first, damping = curve_number(haptic_map, curve), river_gains(mode)[1]
    best = best_transition(haptic_map, curve)
    second = best.second if best.first == first else best.first
    laps = [haptic_map.curve(i).duration for i in (first, second)]
    begin = laps[0]
    return (
        pushed_over(haptic_map, first, second, best.angle, begin, damping),
        pushed_over(haptic_map, second, first, best.angle, begin + _STAY_LAPS * laps[1], damping),
    )


def pushed_over(haptic_map: Lifted, first: int, second: int, angle: float, start: float, drag: float) -> Push:
    """A push that takes a hand from one curve's river to another's about the transition between them.

    Its direction is towards the other curve. Its force, proportional to the rivers' drag b, takes the hand there within
    about a quarter of a second: a figure cannot break into a run faster.

    Parameters
    ----------
    haptic_map : Lifted
        The map.
    first, second : int
        Indices of the two curves.
    angle : float
        θ of the transition [rad].
    start : float
        Earliest time [s]; the push begins when the hand next comes to its place.
    drag : float
        b of the rivers [N s/m].
    """
    curve, angles = haptic_map.curve(first), haptic_map.angles[first]
    # A closed clip may begin at any angle of the lap.
    frame = float(np.interp(angle if angle >= angles[0] else angle + 2.0 * np.pi, angles, np.arange(len(angles))))
    at = frame / haptic_map.clips[first][1] - _PUSH_LEAD_TIME
    place = curve.point(np.mod(at, curve.duration) if curve.periodic else max(at, 0.0))
    displacement = haptic_map.curve_point(second, angle) - haptic_map.curve_point(first, angle)
    distance = float(np.linalg.norm(displacement))
    x, y, z = (float(value) for value in displacement)
    p, q, r = (float(value) for value in place)
    return Push(start, _PUSH_DURATION, _CROSSING_RATE * drag * distance, (x, y, z), (p, q, r), PUSH_START_DISTANCE)
