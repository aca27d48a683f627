"""``hvf lift``: makes a haptic map from clips alone, writes it to a file, and reports its quality.

A closed clip shorter than a second is repeated along its curve, since no hand can be led evenly round a lap in half a
second: a captured run of 0.55 s a stride had a residual of 21 % of weight with one stride in a lap, and of 11 % with
two.
"""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from controllers.haptic_map.lifted import Lifted
from controllers.haptic_map.lifting.curve_measures import ArrangementMeasure
from controllers.haptic_map.lifting.lift import Lifting, closes, lift
from controllers.haptic_map.lifting.motion_features import Motion
from controllers.haptic_map.lifting.room import Room
from controllers.haptic_map.lifting.transitions import MapTransition
from controllers.motion.loops import checked_clip, there_and_back
from experiments.config.maps import MAP_SUFFIX
from experiments.files.map_files import save_map
from experiments.fitting.blendable import not_blendable
from experiments.fitting.figure_legs import figure_legs
from experiments.lifting.map_quality import SAMPLES, Layout, MapQuality, body_weights, lap_times, measure_map
from experiments.lifting.motion_measure import MotionMeasure
from experiments.setups.parts.clips import load_clips
from models.errors import ModelError
from models.humanoid.skeleton import figure_model
from models.mocap.dynamics.contacts import contacts
from models.mocap.motion.clip import Clip
from models.mocap.preparation.poses import around
from sim.errors import SimError
from sim.world.world import phantom_angles

_SHORTEST = 2.0  # [s] least duration of a lap: with 4 s a sprint goes round 8 times, and falls by encoder noise


@dataclass(frozen=True, eq=False)
class LiftedClips:
    """A lifted map and the clips of which it was made.

    Attributes
    ----------
    clips : tuple of Clip
        The clips as lifted.
    turned : tuple of bool
        Whether each is continued by its reversal (`there_and_back`).
    rounds : tuple of int
        How often each is repeated in a lap.
    names : tuple of str
        A unique name for each.
    remarks : tuple of str
        Remarks from loading the clips.
    lifting : Lifting
        Curves and measures.
    haptic_map : Lifted
        The map.
    seconds : float
        Time of lifting [s].
    """

    clips: tuple[Clip, ...]
    turned: tuple[bool, ...]
    rounds: tuple[int, ...]
    names: tuple[str, ...]
    remarks: tuple[str, ...]
    lifting: Lifting
    haptic_map: Lifted
    seconds: float

    def layout(self) -> Layout:
        """The places of the clips in the map, for `measure_map`."""
        steps = 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES
        sites = np.stack([self.haptic_map.site(i, steps) for i in range(len(self.clips))], axis=1)
        times = [lap_times(angles, clip.duration) for angles, clip in zip(self.lifting.angles, self.clips, strict=True)]
        return Layout(self.haptic_map, self.names, sites, np.stack(times, axis=1))


class LiftReport(NamedTuple):
    """Report of `hvf lift`."""

    lifted: LiftedClips
    quality: MapQuality

    def lines(self) -> list[str]:
        """The report in words, a line each."""
        lifting, names = self.lifted.lifting, self.lifted.names
        after, before = lifting.after, lifting.before
        lines = [f"1 curve in {self.lifted.seconds:.1f} s."]
        if len(names) > 1:
            lines = [
                f"{len(names)} curves in {self.lifted.seconds:.1f} s: {_apart(after)} (before the arrangement "
                f"{_apart(before)}); distances are those of the motions within {100 * after.stress:.0f} % "
                f"(before {100 * before.stress:.0f} %)."
            ]
        for name, clip, curve, turned, rounds, closed in zip(
            names, self.lifted.clips, after.curves, self.lifted.turned, self.lifted.rounds,
            self.lifted.haptic_map.closed, strict=True,
        ):  # fmt: skip
            kind = "there and back" if turned else "closed" if closed else "open, the hand is held at its end"
            kind = kind if rounds == 1 else f"{rounds} times round"
            lines.append(
                f"  {name}: {kind}, {clip.duration:.2f} s, radius of curvature from "
                f"{1e3 * curve.radius:.0f} mm, up to {curve.speed:.2f} m/s and {curve.acceleration:.2f} m/s²"
            )
        for meeting in after.meetings:
            at = meeting.transition
            lines.append(
                f"  transition {names[at.first]} – {names[at.second]} at {np.degrees(at.angle):.0f}°: poses "
                f"{at.pose:.2f}, velocities {at.velocity:.2f}, standing feet {at.support:.2f} apart (relative), the "
                f"figures at {at.speeds[0]:.1f} and {at.speeds[1]:.1f} m/s; the curves pass "
                f"{1e3 * meeting.distance:.1f} mm apart at {np.degrees(meeting.slant):.0f}°, "
                f"{meeting.speeds[0]:.2f} and {meeting.speeds[1]:.2f} m/s"
            )
        if not after.meetings and len(names) > 1:
            lines.append("  no transition: nowhere do two of these motions nearly agree in pose and velocity")
        lines += [
            f"  {', '.join(names[i] for i in group)} are the same motion: one of them would do"
            for group in _groups(lifting.same)
        ]
        lines += [f"  {names[i]} stands still: along its curve nothing changes" for i in lifting.still]
        lines += [f"  {remark}" for remark in not_blendable(self.lifted.clips)]
        quality = self.quality
        if len(names) > 1:
            on, between = quality.conditioning, quality.conditioning_between
            # Within the core of a curve only its clip plays, so the map may be singular there.
            along = f"{on[0]:.1f} in the median, 9 of 10 below {on[1]:.0f}" if np.isfinite(on[1]) else "singular"
            lines += [
                f"Condition number of h_* along the curves: {along}; half way between: {between[0]:.1f} in the median, "
                f"9 of 10 below {between[1]:.0f}.",
                f"h_* changes by {100 * quality.roughness[0]:.0f} % a millimetre in the median, 9 of 10 below "
                f"{100 * quality.roughness[1]:.0f} %.",
            ]
        lines += [
            *(f"  in-between {pair}: {_wrong(measure)}" for pair, measure in quality.between.items()),
            f"  the clips themselves: {_wrong(quality.clips)}",
        ]
        return lines

    def to_json(self) -> dict[str, object]:
        """The report as data for JSON."""
        lifting = self.lifted.lifting
        return {
            "clips": list(self.lifted.names),
            "closed": list(self.lifted.haptic_map.closed),
            "seconds": self.lifted.seconds,
            "before": _arrangement(lifting.before),
            "after": _arrangement(lifting.after),
            "same": [list(pair) for pair in lifting.same],
            "still": list(lifting.still),
            "quality": self.quality._asdict()
            | {
                "between": {pair: measure._asdict() for pair, measure in self.quality.between.items()},
                "clips": self.quality.clips._asdict(),
            },
        }


def _groups(pairs: Sequence[tuple[int, int]]) -> list[list[int]]:
    """Groups of clips that are the same motion."""
    groups: dict[int, list[int]] = {}
    for first, second in sorted(pairs):
        if not any(first in others for others in groups.values()):
            groups.setdefault(first, [first]).append(second)
    return list(groups.values())


def _apart(measure: ArrangementMeasure) -> str:
    return f"{1e3 * measure.separation:.1f} mm or more apart at one angle, {1e3 * measure.nearest:.1f} mm in space"


def _wrong(measure: MotionMeasure) -> str:
    return (
        f"joints {np.degrees(measure.limits):.1f}° beyond their limits, soles slide {100 * measure.slide:.1f} cm, "
        f"{100 * measure.penetration:.1f} cm below the floor, flights {100 * measure.ballistic:.1f} cm from free fall"
    )


def _arrangement(measure: ArrangementMeasure) -> dict[str, object]:
    return {
        "separation": measure.separation,
        "nearest": measure.nearest,
        "stress": measure.stress,
        "curves": [curve._asdict() for curve in measure.curves],
        "transitions": [
            meeting._asdict() | {"transition": meeting.transition._asdict()} for meeting in measure.meetings
        ],
    }


def check_workspace(room: Room) -> None:
    """Check that the Phantom reaches the whole hollow cylinder of a room.

    Raises
    ------
    SimError
        If it does not; the message names the point.
    """
    for z in np.linspace(*room.z_range, 9):
        for angle in np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False):
            for r in room.r_range:
                try:
                    phantom_angles(np.array([r * np.cos(angle), r * np.sin(angle), z]))
                except SimError as error:
                    raise SimError(
                        f"{error}; expected r {room.r_range}, z {room.z_range} m to lie within its reach: a smaller "
                        "--room.r-range or another --room.z-range"
                    ) from None


def lift_clips(
    names: Sequence[str], room: Room, cyclic: Sequence[str] = (), seed: int = 1, raw: bool = False
) -> LiftedClips:
    """Lift clips by name or file; an open clip nearly at rest at both ends is continued back (`there_and_back`).

    Parameters
    ----------
    names : sequence of str
        Names of embedded clips, or files.
    room : Room
        Where the curves may lie.
    cyclic : sequence of str
        Those of `names` that must be closed; of the others, clips that close are closed.
    seed : int
        Seed of the initial arrangement of the curves.
    raw : bool
        Take motion files as captured, not prepared.

    Raises
    ------
    ModelError, ControllerError, SimError
        If a clip cannot be read or lifted, or the Phantom does not reach the room.
    """
    unknown = [name for name in cyclic if name not in names]
    if unknown:
        raise ModelError(f"cyclic names {', '.join(unknown)}; expected some of the clips to lift: {', '.join(names)}")
    if seed < 0:
        raise SimError(f"the seed is {seed}; expected 0 or more")
    check_workspace(room)
    loaded, remarks = load_clips(names, raw)
    begin = time.perf_counter()
    clips = tuple(
        clip if name in cyclic else replace(clip, poses=there_and_back(clip.poses, clip.fps))
        for clip, name in zip(loaded, names, strict=True)
    )
    turned = tuple(clip.n_frames > as_loaded.n_frames for clip, as_loaded in zip(clips, loaded, strict=True))
    rounds = tuple(math.ceil(_SHORTEST / clip.duration) if clip.closes() else 1 for clip in clips)
    clips = tuple(_round(clip, times) for clip, times in zip(clips, rounds, strict=True))
    labels = _labels(names)
    motions = [_motion(clip, label, name in cyclic) for clip, label, name in zip(clips, labels, names, strict=True)]
    lifting = lift(motions, body_weights(), room, np.random.default_rng(seed))
    transitions = [MapTransition(at.first, at.second, at.angle, at.pose, at.velocity) for at in lifting.transitions]
    haptic_map = Lifted(
        [(clip.poses, clip.fps) for clip in clips], [motion.closed for motion in motions], lifting.angles,
        lifting.sites, figure_legs(figure_model()), labels, transitions=transitions,
    )  # fmt: skip
    return LiftedClips(clips, turned, rounds, labels, remarks, lifting, haptic_map, time.perf_counter() - begin)


def _round(clip: Clip, times: int) -> Clip:
    """A closed clip repeated several times."""
    poses, first = around(clip, (times - 1) * (clip.n_frames - 1))
    return replace(clip, poses=poses[first:])


def _labels(names: Sequence[str]) -> tuple[str, ...]:
    """A unique name for every clip: its name or file stem, with a number appended if it is taken."""
    labels: list[str] = []
    for name in names:
        stem = Path(name).stem if Path(name).suffix else name
        count = sum(label == stem or label.rpartition("-")[0] == stem for label in labels)
        labels.append(stem if count == 0 else f"{stem}-{count + 1}")
    return tuple(labels)


def _motion(clip: Clip, name: str, must_close: bool) -> Motion:
    closed = must_close or (clip.n_frames > 1 and closes(checked_clip(clip.poses, clip.fps, name)))
    return Motion(clip.poses, clip.fps, name, closed, contacts(clip).loaded)


def report_lift(lifted: LiftedClips, seed: int) -> LiftReport:
    """Measure a lifted map."""
    return LiftReport(lifted, measure_map(lifted.layout(), lifted.clips, np.random.default_rng(seed)))


def lift_into(
    names: Sequence[str],
    out: Path,
    room: Room,
    cyclic: Sequence[str],
    seed: int,
    overwrite: bool,
    raw: bool = False,
) -> LiftReport:
    """Lift clips, measure the map, and write it to a file at the very end; arguments as in `lift_clips`.

    Raises
    ------
    ModelError, ControllerError, SimError
        As `lift_clips`; or if the file is not a .npz, or exists and is not to be replaced.
    OSError
        If it cannot be written.
    """
    if out.suffix != MAP_SUFFIX:
        raise SimError(f"{out}: a map is written into a {MAP_SUFFIX} file; expected a name that ends so")
    if out.exists() and not overwrite:
        raise SimError(f"{out}: exists; choose another --out, or --overwrite it")
    report = report_lift(lift_clips(names, room, cyclic, seed, raw), seed)
    out.parent.mkdir(parents=True, exist_ok=True)
    save_map(report.lifted.haptic_map, out)
    return report
