"""STRETCHY TUBES as a run: the field, what a hand does in it by default, and what is kept of the bent curve."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from controllers.curves.trajectory import Trajectory
from controllers.errors import CurveError
from controllers.fields.follow import Follow
from controllers.fields.stretchy_tubes import StretchyTubes
from experiments.config.run_config import RunConfig
from models.mocap.clip import Clip
from models.mocap.dynamics.contacts import contacts
from sim.errors import SimError
from sim.users.intent import Grab

Array = npt.NDArray[np.float64]

CURVE_FILE = "curve.json"
DAMPING = 14.0  # [N s/m] an edit that is undone takes the hand along in a tenth of a second, not in a fortieth
REACH = 1.8  # [s] in which the default hand gets to a place: a quarter of a lap at about the curve's own pace
OUTSIDE = (
    2.2  # radii of the tube beside the curve, where it means to press; until then the search pulls it in by a third
)
EASE = 1.0  # [s] in which the performance of the bent curve comes to its pace
LIFTED_CARRY = 0.3  # of the default hand's ways on a lifted map, whose curves are near each other
_BLINK = 0.05  # [s] a flight lasts longer
PAUSE = 0.5  # [s] between two doings of the default hand, and before the bent curve is performed


def law(config: RunConfig, curve: Trajectory, grabs: tuple[Grab, ...], lifted: bool = False) -> StretchyTubes:
    """Field of the modes "stretch", and "stretch-then-follow", which performs once the last grab is over.

    On a lifted map the search is as soft as rivers there are: what the hand does, the figure has to do, and curves
    that are near each other hold different motions.

    Raises
    ------
    ControllerError
        If a number is out of its interval.
    """
    then = until = None
    if config.mode == "stretch-then-follow":
        then = Follow(curve, config.stiffness, config.damping, config.tube)
        until = edited_until(grabs)
    seek, damping = (config.lifted_stiffness, config.lifted_damping) if lifted else (config.seek, DAMPING)
    return StretchyTubes(
        curve, seek, config.rubber, damping, epsilon=config.rubber_tube, width=config.bump,
        until=np.inf if until is None else until, then=then, ease=EASE,
    )  # fmt: skip


def flight_remarks(clips: tuple[Clip, ...]) -> tuple[str, ...]:
    """What is said of clips that fly where a hand may hold them: a body in the air falls with g."""
    flying: list[str] = []
    over: list[str] = []
    for clip in clips:
        air = ~contacts(clip).supported
        longest = max((len(run) for run in "".join("x" if flies else " " for flies in air).split()), default=0)
        if longest <= _BLINK * clip.fps:
            continue
        flying.append(clip.name)
        # The height of the root's own vertical axis.
        if np.any(clip.poses[air, 4] ** 2 + clip.poses[air, 5] ** 2 > 0.5):
            over.append(clip.name)
    remarks: list[str] = []
    if flying:
        remarks.append(
            f"nobody hovers: where the hand is slower than the clips, the flights of {', '.join(flying)} are let down "
            "to the floor, and a run may fall there"
        )
    if over:
        remarks.append(f"who turns over in the air ({', '.join(over)}) and is held there falls")
    return tuple(remarks)


def edited_until(grabs: tuple[Grab, ...]) -> float:
    """When a hand has done all its grabs, and a pause after them [s]."""
    return max((grab.end for grab in grabs), default=0.0) + PAUSE


def stretch_grabs(curve: Trajectory, epsilon: float, share: float = 1.0) -> tuple[Grab, ...]:
    """What a hand does by default, in thirteen seconds.

    It pulls the curve outwards, pulls it up, takes that back and does it again by a short and a long click, and pushes
    it inwards from outside.

    Parameters
    ----------
    curve : Trajectory
        φ, in the hand frame H.
    epsilon : float
        Radius of its tube [m].
    share : float
        Of the ways by which it bends the curve.
    """
    phases = curve.start + curve.duration * np.array([1.0, 3.0, 5.0]) / 8.0
    first, second, third = curve.point(phases)
    centre = curve.point(np.linspace(curve.start, curve.end, 64, endpoint=not curve.periodic)).mean(axis=0)
    away = (third - centre) / np.linalg.norm(third - centre)
    outwards = 0.02 * share * (first - centre) / np.linalg.norm(first - centre)
    still = np.zeros(3)
    doings = (
        (outwards, 1.3, 0.4, first),
        (np.array([0.0, 0.0, 0.015 * share]), 1.3, 0.4, second),
        (still, 0.15, 0.0, None),
        (still, 0.7, 0.0, None),
        (-(OUTSIDE * epsilon - epsilon + share * (epsilon + 0.01)) * away, 1.3, 0.4, third + OUTSIDE * epsilon * away),
    )
    grabs: list[Grab] = []
    for carry, duration, hold, place in doings:
        start = grabs[-1].end + PAUSE if grabs else PAUSE
        grabs.append(Grab(start, _vector(carry), duration, hold, None if place is None else _vector(place), REACH))
    return tuple(grabs)


def _vector(values: Array) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z


@dataclass(frozen=True)
class StretchSummary:
    """How a curve was bent.

    Attributes
    ----------
    edits : int
        In force at the end.
    largest_mm : float
        Largest distance of a point of the bent curve from where it was.
    changed : float
        Share of the curve's phases at which it is not where it was.
    held_off_m : float
        Largest distance of a held point from the stylus.
    length_before_mm, length_after_mm : float
    reach_mm : float
        Radius up to which the bent curve's nearest point is unique (an estimate; see `Trajectory.reach`).
    """

    edits: int
    largest_mm: float
    changed: float
    held_off_m: float
    length_before_mm: float
    length_after_mm: float
    reach_mm: float

    def line(self) -> str:
        """What happened, in a sentence."""
        if self.edits == 0:
            return "The curve was not bent."
        times = "once" if self.edits == 1 else f"{self.edits} times"
        return (
            f"The curve was bent {times}, by up to {self.largest_mm:.1f} mm over {100 * self.changed:.0f} % of it; "
            f"the held point was at the stylus within {self.held_off_m:.0e} m."
        )


def stretch_summary(tubes: StretchyTubes, memory: Array) -> StretchSummary:
    """Measure the bent curve in the memory of a run against the one before."""
    bent, phases = tubes.edited(memory), np.linspace(tubes.curve.start, tubes.curve.end, 2001)
    moved = np.linalg.norm(bent.point(phases) - tubes.curve.point(phases), axis=1)
    return StretchSummary(
        edits=len(tubes.edits(memory)),
        largest_mm=1e3 * float(moved.max()),
        changed=float(np.mean(moved > 1e-9)),
        held_off_m=tubes.held_off(memory),
        length_before_mm=1e3 * tubes.curve.length,
        length_after_mm=1e3 * bent.length,
        reach_mm=1e3 * bent.reach,
    )


def save_curve(curve: Trajectory, path: Path) -> None:
    """Write a curve as JSON: times [s], positions in H [m], quaternions wxyz, periodic, ends."""
    samples = {name: np.asarray(getattr(curve, name)).tolist() for name in ("times", "positions", "quaternions")}
    path.write_text(json.dumps(samples | {"periodic": curve.periodic, "ends": curve.ends}) + "\n", encoding="utf-8")


def load_curve(path: Path) -> Trajectory:
    """Curve that `save_curve` wrote.

    Raises
    ------
    SimError
        If the file is not one.
    CurveError
        If its numbers make no curve.
    """
    keys = ("times", "positions", "quaternions", "periodic", "ends")
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
        times, positions, quaternions, periodic, ends = (values[key] for key in keys)
        return Trajectory(times, positions, quaternions, bool(periodic), ends)
    except CurveError as error:
        raise CurveError(f"{path}: {error}") from None
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise SimError(f"{path}: no curve ({error}); expected JSON with {', '.join(keys)}") from None
