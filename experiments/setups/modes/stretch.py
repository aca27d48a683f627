"""STRETCHY TUBES as a run: the field, and the grabs by which the default hand bends the curve."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.fields.follow import Follow
from controllers.fields.stretchy_tubes import StretchyTubes
from controllers.safety.energy_tank import river_power, spring_store
from controllers.safety.limiter import ForceLimiter
from controllers.state import stylus_path
from experiments.config.modes import Stretch, StretchThenFollow, StretchyTube
from experiments.config.run_config import Replay, RunConfig, User
from experiments.results.measures.stretch_measures import editing_summary, performance_summary
from experiments.results.measures.stretch_summary import stretch_summary
from experiments.results.measures.summary import RunSummary
from experiments.setups.modes.fixed_curve import with_walls
from experiments.setups.modes.lifted_runs import HELD_GAINS
from experiments.setups.parts import hands
from experiments.setups.parts.budget import WORKSPACE_WIDTH, fastest, tank_for
from experiments.setups.parts.defaults import tube_gains
from experiments.setups.parts.pace import course_of
from experiments.setups.parts.part_types import ClipMapParts, Measuring, Notes, Parts
from geometry.arrays import Array
from geometry.spans import spans
from models.mocap.dynamics.contacts import contacts
from models.mocap.motion.clip import Clip
from sim.users.hand.actions import Grab
from sim.world.world import FigureKind

# Time of the default hand to get to a place, a quarter of a lap away: at least that of a lap of 4 s [s], and a share of
# the lap, in which its greatest speed is 1.04 times the curve's own, as the figure follows it.
REACH_TIME, _REACH_SHARE = 1.8, 0.45
_MIN_BUMP, _BUMP_SHARE = 0.5, 0.125  # default half width of a bend: that of a lap of 4 s [s], and a share of the lap
# Distance from the curve, in tube radii, at which the hand aims to press; the seeking spring pulls it in by a third.
PRESS_RATIO = 2.2
EASE_TIME = 1.0  # [s] in which the bent curve reaches its pace: a figure in mid-step cannot resume full speed at once
_MAX_BUMP_SLOPE = 2.0  # steepest slope of a bump of height and half width 1, rounded up
# [s] shortest flight of a clip that counts: half or twice the value changes none of eight captures
_MIN_FLIGHT_DURATION = 0.05


def stretch_parts(config: RunConfig, mode: Stretch, maps: ClipMapParts) -> Parts:
    """Parts of a run in the mode "stretch"."""
    until = max((grab.end for grab in _resolve_user(config, mode, maps).grabs), default=0.0)
    late = f"the curve is bent until {until:.1f} s; give --seconds more than that"
    remarks = (late,) if config.seconds <= until else ()
    return _make_parts(config, mode, maps, maps.curve, _Performance(None, np.inf), remarks)


def stretch_then_follow_parts(config: RunConfig, mode: StretchThenFollow, maps: ClipMapParts) -> Parts:
    """Parts of a run in the mode "stretch-then-follow": FOLLOW on the bent curve once the last grab is over."""
    course = course_of(maps.curve, mode.damping, mode.stiffness)
    user = _resolve_user(config, mode, maps)
    until = hands.edited_until(user.grabs)
    carried = max((float(np.linalg.norm(grab.carry)) for grab in user.grabs), default=0.0)
    power = river_power(mode.damping, fastest(course) + _MAX_BUMP_SLOPE * carried / _bump(mode, course))
    late = f"the curve is bent until {until:.1f} s and performed then; give --seconds more than that"
    remarks = (late,) if config.seconds <= until else ()
    performance = _Performance(
        Follow(course, mode.stiffness, mode.damping, mode.tube), until, ((mode.stiffness, mode.tube),), power
    )
    return _make_parts(config, mode, maps, course, performance, remarks)


class _Performance(NamedTuple):
    """FOLLOW on the bent curve: its law, when it begins [s], its springs, and the power of its damper [W]."""

    law: Follow | None
    until: float
    springs: tuple[tuple[float, float], ...] = ()
    power: float = 0.0


def _bump(mode: StretchyTube, course: Trajectory) -> float:
    return max(_MIN_BUMP, _BUMP_SHARE * course.duration) if mode.bump is None else mode.bump


def _resolve_user(config: RunConfig, mode: StretchyTube, maps: ClipMapParts) -> User:
    if isinstance(config.device, Replay):
        return config.user
    by_default = stretch_grabs(maps.curve, mode.rubber_tube, maps.carry)
    if config.user.person is not None:  # a person makes no clicks without a place
        by_default = tuple(grab for grab in by_default if grab.place is not None)
    grabs = config.user.grabs or by_default
    return hands.resolved_user(config.user, maps.curve, config.seconds, grabs=grabs)


def _make_parts(
    config: RunConfig, mode: StretchyTube, maps: ClipMapParts, course: Trajectory,
    performance: _Performance, remarks: tuple[str, ...],
) -> Parts:  # fmt: skip
    bump = _bump(mode, course)
    if bump > 0.5 * course.duration:
        # The course is timed to lead the Phantom at the lap's pace, and is a little shorter.
        lap = maps.curve.duration
        least, most = np.ceil(21.0 * bump * lap / course.duration) / 10.0, np.floor(49.0 * course.duration) / 100.0
        raise ParameterError(
            f"a lap of {lap:g} s is too short for a bend of --bump {bump:g} s to either side; expected --lap "
            f"{least:g} or more, or --bump {most:g} or less"
        )
    user = _resolve_user(config, mode, maps)
    seek, damping = tube_gains(mode)
    tubes = StretchyTubes(
        course, seek, mode.rubber, damping,
        epsilon=mode.rubber_tube, width=bump, until=performance.until, then=performance.law, ease=EASE_TIME,
        hold=mode.rubber_from,
    )  # fmt: skip
    pushed = hands.first_pushed_lap(maps.curve, user.grabs)
    if user.does == "push" and not config.user.pushes and config.seconds <= pushed and not remarks:
        remarks = (f"the hand bends the curve first and pushes from {pushed:.1f} s on; give --seconds more than that",)
    # A press of the switch replaces the seeking spring by the rubber; its energy is allowed once a second.
    springs = ((max(seek, mode.rubber), WORKSPACE_WIDTH), *performance.springs)
    power = spring_store(mode.rubber, mode.rubber_tube) + performance.power
    notes = Notes(mode.kind.upper(), mode.rubber_tube, "tube", hand_does="traces" if user.traces else "grabs or pushes")

    def summarise(summary: RunSummary, of: Measuring) -> RunSummary:
        of.save_curve(tubes.edited(of.memory))
        return replace(
            summary, stretch=stretch_summary(tubes, of.memory),
            editing=editing_summary(of.recording, tubes, of.default_poses(), of.handled),
            performance=performance_summary(of.recording, tubes, of.default_poses(), of.handled),
        )  # fmt: skip

    return Parts(
        config=replace(config, mode=replace(mode, bump=bump), user=user), maps=maps, field=tubes,
        program=with_walls(tubes.program(), mode.walls, maps), course=course,
        user=hands.user_hand(user, maps.curve, config.seconds, config.seed),
        tank=tank_for(power, springs, maps.reach, ForceLimiter(config.clock.servo_period)), notes=notes,
        gains=HELD_GAINS, bends=True, held_seconds=float(np.nan_to_num(maps.lap_seconds)),
        handled=hands.handling_spans(user), summarise=summarise,
        # Bending keeps the phases, so the unedited animation is that at the same phase of the given curve.
        argument_at=lambda nearest, phases: stylus_path(course.point(phases)),
        remarks=flight_remarks(maps.clips, config.figure.kind) + remarks + hands.turning_remark(user, maps.oriented),
    )  # fmt: skip


def flight_remarks(clips: tuple[Clip, ...], figure: FigureKind) -> tuple[str, ...]:
    """Remarks on clips with flights where a hand may hold the figure: a body in the air cannot be held."""
    if figure == "none":
        return ()
    flying: list[str] = []
    over: list[str] = []
    for clip in clips:
        air = ~contacts(clip).supported
        if max((end - start for start, end in spans(air)), default=0) <= _MIN_FLIGHT_DURATION * clip.fps:
            continue
        flying.append(clip.name)
        # The vertical component of the root's z axis, 1 − 2 (x² + y²), is negative: upside down.
        if np.any(clip.poses[air, 4] ** 2 + clip.poses[air, 5] ** 2 > 0.5):
            over.append(clip.name)
    remarks: list[str] = []
    physical = figure == "physical"
    if flying:
        remarks.append(
            f"where the hand is slower than the clips, the flights of {', '.join(flying)} are lowered to the floor"
            + (", and the figure may fall there" if physical else "")
        )
    if over and physical:
        remarks.append(f"a figure that is held upside down in the air, as in {', '.join(over)}, falls")
    return tuple(remarks)


def stretch_grabs(curve: Trajectory, epsilon: float, share: float = 1.0) -> tuple[Grab, ...]:
    """Grabs of the default hand, in thirteen seconds on a lap of 4 s.

    The hand pulls the curve outwards, pulls it up, undoes and redoes that by a short and a long click, and pushes the
    curve inwards from outside.

    Parameters
    ----------
    curve : Trajectory
        φ, in the hand frame H.
    epsilon : float
        Radius of its tube [m].
    share : float
        Factor on the distances by which the hand bends the curve.
    """
    phases = curve.start + curve.duration * np.array([1.0, 3.0, 5.0]) / 8.0
    first, second, third = curve.point(phases)
    centre = curve.point(np.linspace(curve.start, curve.end, 64, endpoint=not curve.periodic)).mean(axis=0)
    away = (third - centre) / np.linalg.norm(third - centre)
    outwards = 0.02 * share * (first - centre) / np.linalg.norm(first - centre)
    still, pressed, reach = np.zeros(3), PRESS_RATIO * epsilon, max(REACH_TIME, _REACH_SHARE * curve.duration)
    actions = (
        (outwards, 1.3, 0.4, first),
        (np.array([0.0, 0.0, 0.015 * share]), 1.3, 0.4, second),
        (still, 0.15, 0.0, None),
        (still, 0.7, 0.0, None),
        (-(pressed - epsilon + share * (epsilon + 0.01)) * away, 1.3, 0.4, third + pressed * away),
    )
    grabs: list[Grab] = []
    for carry, duration, hold, place in actions:
        start = grabs[-1].end + hands.PAUSE_TIME if grabs else hands.PAUSE_TIME
        reached = None if place is None else _as_tuple(place)
        grabs.append(Grab(start, _as_tuple(carry), duration, hold, reached, reach))
    return tuple(grabs)


def _as_tuple(values: Array) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z
