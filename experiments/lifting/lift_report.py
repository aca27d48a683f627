"""Lifting of clips into a file, and its report: curves, transitions and in-betweens, in words and as data."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from controllers.checks import check_kind
from controllers.haptic_map.lifting.curve_measures import ArrangementMeasure
from controllers.haptic_map.lifting.room import Room
from experiments.config.maps import MAP_SUFFIX
from experiments.files.given_path import given_path
from experiments.files.made_folder import made_folder
from experiments.files.map_files import save_map
from experiments.fitting.blendable import not_blendable
from experiments.fitting.motion_faults import MAX_JOINT_EXCESS, MAX_PENETRATION
from experiments.lifting.lift import LiftedClips, lift_clips
from experiments.lifting.map_quality import MapQuality, MotionMeasure, measure_map
from sim.errors import SimError

_MAX_SLIDE = 0.02  # largest slide of an in-between [m]


class LiftReport(NamedTuple):
    """Report of `hvf lift`."""

    lifted: LiftedClips
    quality: MapQuality

    def __str__(self) -> str:
        return "\n".join(self.lines())

    def lines(self) -> list[str]:
        """The report in words, a line each."""
        return [*self._curve_lines(), *self._transition_lines(), *self._quality_lines()]

    def _curve_lines(self) -> Iterator[str]:
        lifted, after, before = self.lifted, self.lifted.lifting.after, self.lifted.lifting.before
        if len(lifted.names) == 1:
            yield f"1 curve in {lifted.seconds:.1f} s."
        else:
            yield (
                f"{len(lifted.names)} curves in {lifted.seconds:.1f} s: {_separation(after)} (before the arrangement "
                f"{_separation(before)}); distances are those of the motions within {100 * after.stress:.0f} % "
                f"(before {100 * before.stress:.0f} %)."
            )
        for name, clip, curve, turned, rounds, closed in zip(
            lifted.names, lifted.clips, after.curves, lifted.turned, lifted.rounds, lifted.haptic_map.closed,
            strict=True,
        ):  # fmt: skip
            kind = "there and back" if turned else "closed" if closed else "open, the hand is held at its end"
            kind = kind if rounds == 1 else f"{rounds} times in a lap"
            yield (
                f"  {name}: {kind}, {clip.duration:.2f} s, radius of curvature from "
                f"{1e3 * curve.radius:.0f} mm, up to {curve.speed:.2f} m/s and {curve.acceleration:.2f} m/s²"
            )

    def _transition_lines(self) -> Iterator[str]:
        lifting, names = self.lifted.lifting, self.lifted.names
        for meeting in lifting.after.meetings:
            at = meeting.transition
            yield (
                f"  transition {names[at.first]} – {names[at.second]} at {np.degrees(at.angle):.0f}°: poses "
                f"{at.pose:.2f}, velocities {at.velocity:.2f}, standing feet {at.support:.2f} apart (relative), the "
                f"figures at {at.speeds[0]:.1f} and {at.speeds[1]:.1f} m/s; the curves pass "
                f"{1e3 * meeting.distance:.1f} mm apart at {np.degrees(meeting.slant):.0f}°, "
                f"{meeting.speeds[0]:.2f} and {meeting.speeds[1]:.2f} m/s"
            )
        if not lifting.after.meetings and len(names) > 1:
            yield "  no transition: nowhere do two of these motions nearly agree in pose and velocity"
        for group in _same_motion_groups(lifting.same):
            yield f"  {', '.join(names[i] for i in group)} are the same motion: one of them is enough"
        for i in lifting.still:
            yield f"  {names[i]} stands still: along its curve nothing changes"
        yield from (f"  {remark}" for remark in not_blendable(self.lifted.clips))

    def _quality_lines(self) -> Iterator[str]:
        quality = self.quality
        if len(self.lifted.names) > 1:
            along, between = map(_conditioning_text, (quality.conditioning, quality.conditioning_between))
            yield f"Condition number of h_* along the curves: {along}; half way between: {between}."
            yield (
                f"h_* changes by {100 * quality.roughness[0]:.0f} % a millimetre in the median, 9 of 10 below "
                f"{100 * quality.roughness[1]:.0f} %."
            )
        for pair, measure in quality.between.items():
            yield f"  in-between {pair}: {_fault_text(measure)}"
        yield f"  the clips themselves: {_fault_text(quality.clips)}"
        if broken := [pair for pair, measure in quality.between.items() if not _is_motion(measure)]:
            yield (
                f"No motion half way: {', '.join(broken)} (feet slide by more than {100 * _MAX_SLIDE:.0f} cm, a "
                f"joint is {np.degrees(MAX_JOINT_EXCESS):.0f}° or more beyond its limits, or the body "
                f"{100 * MAX_PENETRATION:.0f} cm below ground). "
                "A run with the physical figure tries the map first, and plays the legs of a curve's own clip where it "
                "does not follow the whole."
            )

    def to_json(self) -> dict[str, object]:
        """The report as data for JSON."""
        lifting = self.lifted.lifting
        return {
            "clips": list(self.lifted.names),
            "closed": list(self.lifted.haptic_map.closed),
            "seconds": self.lifted.seconds,
            "before": _arrangement_data(lifting.before),
            "after": _arrangement_data(lifting.after),
            "same": [list(pair) for pair in lifting.same],
            "still": list(lifting.still),
            "quality": self.quality._asdict()
            | {
                "between": {pair: measure._asdict() for pair, measure in self.quality.between.items()},
                "clips": self.quality.clips._asdict(),
            },
        }


def _same_motion_groups(pairs: Sequence[tuple[int, int]]) -> list[list[int]]:
    """Groups of clips that are the same motion."""
    groups: dict[int, list[int]] = {}
    for first, second in sorted(pairs):
        if not any(first in others for others in groups.values()):
            groups.setdefault(first, [first]).append(second)
    return list(groups.values())


def _conditioning_text(quantiles: tuple[float, float]) -> str:
    """Median and 90th percentile of condition numbers in words.

    A map is singular within the core of a curve, where only its clip plays, and everywhere if it has two clips, which
    differ in one direction only.
    """
    median, p90 = quantiles
    return f"{median:.1f} in the median, 9 of 10 below {p90:.0f}" if np.isfinite(p90) else "singular"


def _separation(measure: ArrangementMeasure) -> str:
    return f"{1e3 * measure.separation:.1f} mm or more apart at one angle, {1e3 * measure.nearest:.1f} mm in space"


def _fault_text(measure: MotionMeasure) -> str:
    return (
        f"joints {np.degrees(measure.limits):.1f}° beyond their limits, soles slide {100 * measure.slide:.1f} cm, "
        f"{100 * measure.penetration:.1f} cm below the floor, flights {100 * measure.ballistic:.1f} cm from free fall"
    )


def _is_motion(measure: MotionMeasure) -> bool:
    """Whether a measured motion keeps its feet, its joints and the floor, within the tolerances of `verdict`."""
    return measure.slide <= _MAX_SLIDE and measure.limits <= MAX_JOINT_EXCESS and measure.penetration <= MAX_PENETRATION


def _arrangement_data(measure: ArrangementMeasure) -> dict[str, object]:
    return {
        "separation": measure.separation,
        "nearest": measure.nearest,
        "stress": measure.stress,
        "curves": [curve._asdict() for curve in measure.curves],
        "transitions": [
            meeting._asdict() | {"transition": meeting.transition._asdict()} for meeting in measure.meetings
        ],
    }


def report_lift(lifted: LiftedClips, seed: int) -> LiftReport:
    """Measure a lifted map."""
    return LiftReport(lifted, measure_map(lifted.layout(), lifted.clips, np.random.default_rng(seed)))


_DEFAULT_ROOM = Room()


def lift_into(
    names: Sequence[str | Path], out: str | Path, *, room: Room = _DEFAULT_ROOM, cyclic: Sequence[str | Path] = (),
    seed: int = 1, overwrite: bool = False, raw: bool = False,
) -> LiftReport:  # fmt: skip
    """Lift clips: a curve for each, and one haptic map with all of them, which is measured and written to a file.

    Parameters
    ----------
    names : sequence of str or path
        Names of embedded clips, or motion files, which are prepared.
    out : path
        File to write (.npz); it is written last.
    room : Room
        Where the curves may lie.
    cyclic : sequence of str or path
        Those of `names` that must be closed; of the others, clips that close are closed.
    seed : int
        Seed of the initial arrangement of the curves.
    overwrite : bool
        Replace an existing file.
    raw : bool
        Take motion files as captured, not prepared.

    Raises
    ------
    HvfError
        As `lift_clips`; or if an argument is of the wrong kind, or the file is not a .npz or exists and is not to be
        replaced.
    OSError
        If it cannot be written.
    """
    for name, value, kind in (
        ("names", names, Sequence[str | Path]), ("room", room, Room), ("cyclic", cyclic, Sequence[str | Path]),
        ("seed", seed, int), ("overwrite", overwrite, bool), ("raw", raw, bool),
    ):  # fmt: skip
        check_kind(name, value, kind)
    out, clips = given_path("out", out), tuple(map(str, names))
    if out.suffix != MAP_SUFFIX:
        raise SimError(f"{out}: a map is written into a {MAP_SUFFIX} file; expected a name that ends so")
    if out.exists() and not overwrite:
        raise SimError(f"{out}: exists; choose another --out, or --overwrite it")
    with made_folder(out.parent):
        report = report_lift(lift_clips(clips, room, tuple(map(str, cyclic)), seed, raw), seed)
        save_map(report.lifted.haptic_map, out)
    return report
