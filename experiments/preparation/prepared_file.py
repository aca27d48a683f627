"""A prepared capture with its measures, and what was changed, in words."""

from typing import NamedTuple, cast

import numpy as np

from experiments.flights.ballistics import ClipBallistics
from experiments.preparation.followed import Followed
from geometry import quaternions
from geometry.physics import GRAVITY
from models.mocap.motion.clip import Clip
from models.mocap.motion.ranges import beyond_ranges
from models.mocap.preparation.bounds import MAX_RESIDUAL_IN_FLIGHTS, MAX_SLIDE, exceeding_text
from models.mocap.preparation.laps import frame_distances
from models.mocap.preparation.prepare import Prepared
from models.mocap.preparation.well_formed import WellFormed
from models.mocap.retargeting.retarget_report import two_digits

_ADDED_MOTION = {"way back": "the way back", "open": "coming to rest at both ends"}
_MAX_NAMED = 3  # largest number of flights whose reasons are in the line for the terminal
_MIN_OWN_FRACTION = 0.5  # fraction of the file's own motion in the clip below which it is reported
_MIN_LEFT_OUT = 0.5  # time of the capture that its cycle lacks, from which it is reported [s]
# Turn without which a cycle is not called the same motion [°]: 89 of 100 cycles lack at most 26°, the others 34 to 329.
_MAX_LOST_TURN = 30.0
_MIN_LAP_TURN = 15.0  # turn of a cycle that is told [°]: straight walks and runs drift by up to 10 in a lap
# Acceleration in flights below which a wrong frame rate is more likely than dancers' hovering feet [m/s²]: jumps have 8
# to 12, dancers' steps 4 to 7.
_MAX_SLOW_FALL = 4.0
# Departure of flights from parabolas beyond which they are none, at whatever rate [1]: those of the jumps among 28
# captures and 136 files of other people have at most 0.08, and feet that climb or hover 0.13 to 0.54.
_MAX_DEPARTURE = 0.1
# Least distance by which every body misses a refuted turn that is reported [m]: a path counts as followed within it in
# `experiments.studies.turn_trials`, and no capture is known better.
_MIN_MISS = 5e-4
_MIN_ROOT_SHIFT = 0.02  # displacement of the root that is reported [m]: stances are extended over as much


class Measured(NamedTuple):
    """Measures of a clip, how the physical figure follows it, and how far its feet slide [m]."""

    measures: WellFormed
    followed: Followed
    slide: float


class PreparedFile(NamedTuple):
    """A prepared clip with its measures.

    Attributes
    ----------
    prepared : Prepared
        The clip and the steps of its preparation.
    measures : WellFormed
        Measures of the clip.
    followed : Followed
        How the physical figure follows it.
    slide : float
        How far a foot slides over the floor at most (`models.mocap.motion.foot_skate`), under load or not [m].
    flights : tuple of str
        Flights that the certificate refutes, and why, a line each.
    doubts : tuple of str
        Other properties that are not certified, and why, a line each (`doubts`).
    """

    prepared: Prepared
    measures: WellFormed
    followed: Followed
    slide: float
    flights: tuple[str, ...]
    doubts: tuple[str, ...]

    @property
    def clip(self) -> Clip:
        """The prepared clip."""
        return self.prepared.clip

    def __str__(self) -> str:
        return "\n".join(summary(self))

    def faults(self) -> tuple[str, ...]:
        """What makes the clip unusable, then what can be seen, then how far it is from the capture, a line each."""
        return (
            *self.followed.faults(self.measures.flights > 0),
            *infeasible(self.prepared),
            *self._sliding(),
            *self.measures.faults(),
            *self.flights,
            *self.prepared.fidelity.faults(),
        )

    def _sliding(self) -> tuple[str, ...]:
        slide, bound = 1000 * self.slide, 1000 * MAX_SLIDE
        line = f"a foot slides by {exceeding_text(slide, bound)} mm along the floor; {bound:g} at most"
        return (line,) if slide > bound else ()

    def advice(self) -> tuple[str, ...]:
        """What the clip lacks of the capture, and what may help if the figure does not stand with it, a line each."""
        if self.prepared.near and self.followed.stands:
            return losses(self.prepared)
        whole = "" if self.prepared.looped.kind == "open" else "--loop open if it does not repeat, "
        return (
            *losses(self.prepared),
            f"try --loop START:END for a part without what is not feasible, {whole}"
            "or a capture whose support is feet and hands alone",
        )


def summary(outcome: PreparedFile) -> tuple[str, ...]:
    """Lines for the terminal: whether the clip is well-formed and what was done; below, faults, doubts and advice."""
    prepared, flights = outcome.prepared, outcome.flights
    if len(flights) > _MAX_NAMED + 1:
        flights = (*flights[:_MAX_NAMED], f"{len(flights) - _MAX_NAMED} more flights are refuted, as the report lists")
    faults = outcome._replace(flights=flights).faults()
    return (
        f"{prepared.clip.name}: {'not ' if faults else ''}well-formed; {'; '.join(changes(prepared))}; "
        f"contact leaves a residual of {100 * outcome.measures.residual:.1f} % of weight; {outcome.followed.line()}; "
        f"{prepared.seconds:.0f} s of processor time",
        *(f"  {line}" for line in (*faults, *outcome.doubts, *outcome.advice())),
    )


def doubts(found: ClipBallistics) -> tuple[str, ...]:
    """Flights that are unknown, and turns that every body misses by `_MIN_MISS` or more, a line each."""
    ballistic, turns = (found.certificate.verdicts[name] for name in ("ballistic", "turns"))
    certified = {flight.reason for flight in found.flights if flight.verdict == "certified"}
    lines: list[str] = []
    if ballistic.verdict == "unknown":
        why = "; ".join(part for part in ballistic.reason.split("; ") if part not in certified)
        lines.append(f"whether it is ballistic is unknown: {why}")
    if turns.verdict == "refuted" and cast(float, turns.counterexample["distance"]) >= _MIN_MISS:
        lines.append(f"turns are {turns.verdict}: {turns.reason}")
    return tuple(lines)


def changes(prepared: Prepared) -> tuple[str, ...]:
    """Changes made to the capture, a line each."""
    part, pace, change = prepared.looped, prepared.paced, prepared.attempt.change
    after = " after the frames that are left out" if prepared.report and prepared.report.dropped else ""
    when = f"{part.start:.2f} to {part.end:.2f} s{after}"
    words = {
        "cycle": f"cycle {when}, whose ends were {np.rad2deg(part.gap):.1f}° apart",
        "half stride": f"half a stride, {when}, and its mirror image",
        "way back": "the whole motion, and back",
        "open": "the whole motion, at rest at both ends",
    }
    rotations = prepared.clip.poses[:, 3:7]
    headings = quaternions.without_jumps(quaternions.heading(rotations), rotations)
    turn = np.rad2deg(headings[-1] - headings[0]) if part.kind == "cycle" else 0.0
    turning = f", turns {'left' if turn > 0.0 else 'right'} by {abs(turn):.0f}° in each lap"
    lines = [f"{words[part.kind]}{turning if abs(turn) > _MIN_LAP_TURN else ''}: {prepared.clip.duration:.2f} s"]
    own_fraction = (part.end - max(part.start, 0.0)) / prepared.clip.duration
    if part.kind in _ADDED_MOTION and own_fraction < _MIN_OWN_FRACTION:
        what = f"of {prepared.clip.duration:.2f} s the file's motion is {part.end - max(part.start, 0.0):.2f} s"
        lines.append(f"{what}; the rest is {_ADDED_MOTION[part.kind]}, which is not in the file")
    if pace.pace != 1.0:
        lines.append(f"played {pace.pace:.2f} times as fast, since its flights fall at {pace.falls:.1f} m/s²")
    if prepared.root_shift > _MIN_ROOT_SHIFT:
        lines.append(f"moved over the floor by up to {100 * prepared.root_shift:.0f} cm, since a loaded foot slides")
    if not prepared.near:
        return (*lines, "dynamics and feet as captured")
    if not any(change):
        return (*lines, "unchanged")
    if prepared.hands.seconds > 0.0:
        lines.append(
            f"hands are loaded for {prepared.hands.seconds:.2f} s, at points up to "
            f"{100 * prepared.hands.moved:.0f} cm from where their palms were captured"
        )
    lines.append(
        f"dynamics moved joints {np.rad2deg(change.turned):.1f}°, the root {100 * change.raised:.1f} cm in height and "
        f"{100 * change.moved:.1f} cm over the floor RMS; " + prepared.fidelity.line()
    )
    return tuple(lines)


def gaps(prepared: Prepared) -> tuple[str, str]:
    """Distance d (`laps`) between the ends of the loop, in the capture and in the clip, in words."""
    part, last = prepared.looped, prepared.clip.n_frames - 1
    if part.kind == "open":
        return "no loop", "no loop: at rest at both ends"
    gap = float(frame_distances(prepared.clip, np.array([0, last]))[0][0, 1])
    mirror = " mirrored" if part.kind == "half stride" else ""
    was = f"ends {np.rad2deg(part.gap):.1f}° apart{mirror}" if np.isfinite(part.gap) else "as stated"
    return f"{was}, {max(part.start, 0.0):.2f} to {part.end:.2f} s", f"ends {np.rad2deg(gap):.1f}° apart"


def infeasible(prepared: Prepared) -> tuple[str, ...]:
    """How far the nearest feasible motion that was found is from the capture, if none is near."""
    tried, change = prepared.attempt, prepared.attempt.change
    if prepared.near:
        return ()
    excess = max(0.0, float(np.rad2deg(beyond_ranges(tried.clip.poses).max())))
    residual = f"{100 * tried.residual:.0f} % of weight"
    if tried.residual > MAX_RESIDUAL_IN_FLIGHTS:
        bound = 100 * MAX_RESIDUAL_IN_FLIGHTS
        residual = f"{exceeding_text(100 * tried.residual, bound)} % of weight, more than {bound:.0f}"
    return (
        f"no feasible motion is near: the last one tried turns joints by {np.rad2deg(change.turned):.0f}° and raises "
        f"or lowers the root by {100 * change.raised:.0f} cm RMS, takes a joint {excess:.0f}° beyond its "
        f"range, and leaves a residual of {residual}",
    )


def losses(prepared: Prepared) -> tuple[str, ...]:
    """What of the capture the clip lacks, or has at another pace, and how to keep it, a line each."""
    part, (_, pace, falls, departure) = prepared.looped, prepared.paced
    lines: list[str] = []
    seconds, since = part.left_out
    if seconds > _MIN_LEFT_OUT:
        what = f"{seconds:.1f} s of the capture, the first at {since:.2f} s, are unlike the cycle"
        lines.append(f"{what}: --loop open keeps them")
    if (turn := np.rad2deg(part.lost_turn.angle)) > _MAX_LOST_TURN:
        what = f"at {part.lost_turn.at:.2f} s the capture has turned {turn:.0f}° further than its cycle ever does"
        lines.append(f"{what}: --loop open keeps its turns")
    unsupported = pace == 1.0 and departure < _MAX_DEPARTURE and not prepared.hands.seconds
    if unsupported and falls is not None and 0.0 < falls < _MAX_SLOW_FALL:
        rate = prepared.captured.fps * float(np.sqrt(GRAVITY / falls))
        lines.append(
            f"its flights fall at {two_digits(falls)} m/s², and would fall freely at {rate:.0f} frames a second: "
            "if they are jumps, give --frame-rate"
        )
    return tuple(lines)
