"""Report on how a motion file was interpreted: axes, unit, joints, and what had to be guessed."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from geometry.arrays import Array, Mask, rms
from geometry.physics import GRAVITY
from geometry.spans import spans
from models.humanoid.skeleton import JOINTS
from models.mocap.motion.ranges import beyond_ranges
from models.mocap.readers.motion_file import printable
from models.mocap.readers.source_motion import SourceMotion
from models.mocap.retargeting.body_lines import SIDES, BodyLines
from models.mocap.retargeting.broken_frames import JointJump
from models.mocap.retargeting.calibration import Calibration
from models.mocap.retargeting.noise import Noise
from models.mocap.retargeting.skeleton_roles import Roles
from models.mocap.retargeting.sole_calibration import MAX_TOE_PITCH, MIN_FLAT_FRAMES

_MAX_SPINE_BEND = np.deg2rad(60.0)  # if the body never stands straighter than this, its spine cannot be calibrated well
_MAX_NAMED = 12  # largest number of unused joints that are named: rigs with faces and fingers have hundreds
# Least excess over joint ranges that is reported: their SD is 5 to 9° (Boone & Azen 1979).
_MIN_RANGE_EXCESS = np.deg2rad(15.0)
# Height [m] and time [s] above which a body is taken to stand on something above the floor: a step of stairs is 0.17 m
# high, and a flight of 1 s rises by 1.2 m. The longest flight in the 28 captures of
# docs/validation/prepared-captures.md lasts 0.5 s.
_MIN_ALOFT_HEIGHT, _MIN_ALOFT_TIME = 0.1, 1.0
# Height of the soles that no jump reaches [m]: 1.2 m where the centre of mass rises by 1 m, tucked.
_MAX_JUMP_HEIGHT = 1.5
# In a file of a wrong frame rate a body in flight falls along a parabola, but not with g: largest fraction of g, least
# change of height [m], and largest RMS distance from the parabola over that change. Two jumps in a file of 120 frames a
# second that states 24 have 0.04, 0.1 m and 0.03.
_MAX_FALL_RATIO, _MIN_FALL_HEIGHT, _MAX_FALL_ERROR = 0.5, 0.05, 0.05
_MAX_PINNED_MOTION = 0.01  # largest extent of a root's positions that do not move [m]: a body that stands sways by more
_MIN_DEPTH = 0.1  # least depth below the floor that is reported [m]: in the same captures nothing is deeper
# Legs of a human, hip to ankle [m]: 0.49 of an adult's stature (Winter 2009, figure 4.1), 1.33 m for the tallest known;
# about 0.3 m for a child that begins to walk. Wrong units are off by factors above 2, so the bounds may be wide.
_MIN_LEG_LENGTH, _MAX_LEG_LENGTH = 0.3, 1.5
# [1/s] frame rate below which a remark is made: motion is captured at 24 frames a second and more
MIN_FRAME_RATE = 10.0
# Speed of an ankle relative to its hip [m/s] that no leg exceeds for a tenth of a capture, and the quantile: 8 in a
# file of a kick, 15 in the fastest of some 450 captures, an estimate from video; a walk has 3.
_MAX_ANKLE_SPEED, _SPEED_QUANTILE = 20.0, 0.9
# Hips that stay within the first number of metres for the second number of seconds, and the median speed of the lower
# ankle above which it slides [m/s]. In 410 captures and variants of them, feet of bodies that stay in place slide at
# 0.35 m/s and more where the travel was taken out, and where legs never rest (a swimmer, jumping jacks); elsewhere at
# 0.25 at most.
_MAX_IN_PLACE_EXTENT, _MIN_IN_PLACE_TIME, _MIN_SLIDING_SPEED = 0.12, 0.5, 0.3
_MAX_STRETCH = 0.1  # change of a limb's length over its median that is not reported: below 0.01 in some 180 captures
_UNITS = (
    ("metres", 1.0),
    ("centimetres", 0.01),
    ("millimetres", 0.001),
    ("inches", 0.0254),
    ("inches / 0.45", 0.05644),
)


class RetargetReport(NamedTuple):
    """How a motion file was interpreted.

    Attributes
    ----------
    taken : dict from figure body to source joint
        The joint that moves each segment.
    unused : tuple of str
        Source joints that move no segment.
    missing : tuple of str
        Segments without a joint, and which segment they follow.
    up : str
        The file's axis that points up, such as ``+Y``.
    facing : str
        The file's axis nearest to the body's first heading.
    unit : str
        The file's unit of length, estimated from the legs unless the format defines it.
    scale : float
        Metres of the figure per unit of the file.
    dropped : int
        Number of frames left out in front, of a calibration pose such as a T-pose.
    lead : float
        Lead of the score of `up` over the next axis, at least 0.25; infinite where the format or the user states it.
    remarks : tuple of str
        What could not be determined, and what was assumed instead.
    """

    taken: dict[str, str]
    unused: tuple[str, ...]
    missing: tuple[str, ...]
    up: str
    facing: str
    unit: str
    scale: float
    dropped: int = 0
    lead: float = np.inf
    remarks: tuple[str, ...] = ()

    @property
    def scaling(self) -> str:
        """The file's unit and the scale to metres, in words."""
        return f"unit: {self.unit}; one unit becomes {self.scale:.5g} m, by the length of the legs"

    def lines(self) -> tuple[str, ...]:
        """The report in words, a line per subject."""
        ahead = f"with a score {self.lead:.2f} above the next axis"
        how = "given or known from the format" if np.isinf(self.lead) else ahead
        named = ", ".join(self.unused[:_MAX_NAMED])
        lines = (
            f"axes: up is {self.up} ({how}), the body faces {self.facing} at first",
            self.scaling,
            "taken: " + ", ".join(f"{joint} as {body}" for body, joint in self.taken.items()),
            "unused: "
            + (named or "none")
            + (f", … ({len(self.unused)} joints)" if len(self.unused) > _MAX_NAMED else ""),
            *([] if self.missing else ["missing: none"]),
        )
        return (*(printable(line, 4000) for line in lines), *self.notes())

    def notes(self) -> tuple[str, ...]:
        """What the file lacks, and what was left out, assumed or repaired, a line each."""
        frames = "frame" if self.dropped == 1 else f"{self.dropped} frames"
        lines = (
            *(["missing: " + ", ".join(self.missing)] if self.missing else []),
            *([f"left out: the first {frames}, a pose that is not part of the motion"] if self.dropped else []),
            *self.remarks,
        )
        return tuple(printable(line, 4000) for line in lines)


def beyond_range_remarks(poses: Array) -> Iterator[str]:
    """Joints that exceed their ranges by more than people's ranges differ."""
    excess = beyond_ranges(poses)
    largest = excess.max(axis=0)
    listed = [
        f"{JOINTS[k].replace('_', ' ')} by {np.rad2deg(largest[k]):.0f}° "
        f"({np.mean(excess[:, k] > _MIN_RANGE_EXCESS):.0%} of frames)"
        for k in np.argsort(-largest)
        if largest[k] > _MIN_RANGE_EXCESS
    ]
    if listed:
        yield f"beyond the figure's range: {', '.join(listed)}; check the file"


def calibration_remarks(calibrated: Calibration, lines: BodyLines, roles: Roles, n: int) -> Iterator[str]:
    """Soles of one pose, a few of n frames, or above steep toes, a single shoulder, a spine that is never straight."""
    few = [
        f"of the {side} one {foot.used or 'none'}"
        for side, foot in zip(SIDES, calibrated.feet, strict=True)
        if foot.used < min(MIN_FLAT_FRAMES, n) and f"{side}_foot" in roles.segments
    ]
    if few:
        remark = "the soles' orientation is estimated from few frames"
        yield f"{remark} ({', '.join(few)}); give --rest-frame"
    elif lines.is_single_pose and {"left_foot", "right_foot"} & roles.segments.keys():
        yield "the body holds one pose: the soles' orientation is estimated; give --rest-frame if they are level in it"
    yield from _steep_toe_remarks(calibrated, roles)
    if {"head", "chest"} & roles.segments.keys() and sum(f"{side}_upper_arm" in roles.segments for side in SIDES) == 1:
        yield "there is one arm: the chest's orientation is estimated"
    if calibrated.bend > _MAX_SPINE_BEND:
        yield "the body never stands straight: its spine's rest pose is estimated; give --rest-frame"


def _steep_toe_remarks(calibrated: Calibration, roles: Roles) -> Iterator[str]:
    """Joints of toes that are further below a sole than those of feet that stand."""
    steep = [
        f"{np.rad2deg(foot.toe_pitch):.0f}° ({side} foot)"
        for side, foot in zip(SIDES, calibrated.feet, strict=True)
        if f"{side}_foot" in roles.ends and foot.used and foot.has_heading and foot.toe_pitch > MAX_TOE_PITCH
    ]
    if steep:
        where = f"toes are {', '.join(steep)} below a sole that is taken to stand, as in high heels"
        yield f"{where}: if the body hangs in the air, give --rest-frame"


def endless_limb_remarks(lines: BodyLines, calibrated: Calibration, roles: Roles) -> Iterator[str]:
    """Limbs whose end is defined neither by a joint nor by a tip, and feet without a heading."""
    ends = {"upper_arm": lines.elbows, "forearm": lines.wrists, "shank": lines.ankles, "foot": lines.toes}
    named = [
        f"{side}_{part}"
        for part in ends
        for k, side in enumerate(SIDES)
        if np.isnan(ends[part][:, k]).any() or (part == "foot" and not calibrated.feet[k].has_heading)
    ]
    hanging = [limb.replace("_", " ") for limb in named if limb.endswith("foot") and limb in roles.ends]
    without = [limb.replace("_", " ") for limb in named if limb in roles.segments]
    if without := [limb for limb in without if limb not in hanging]:
        yield f"the file does not define the ends of {', '.join(without)}: their directions are estimated"
    if hanging:
        yield f"the toes of {' and '.join(hanging)} are in line with the shank: where they point is estimated"


def stretch_remarks(lines: BodyLines) -> Iterator[str]:
    """Bones of arms and legs that change their lengths, as joints that are tracked one by one do."""
    bones = {"upper arm": (lines.shoulders, lines.elbows), "forearm": (lines.elbows, lines.wrists),
             "thigh": (lines.hips, lines.knees), "shank": (lines.knees, lines.ankles)}  # fmt: skip
    changes: dict[str, float] = {}
    for part, (start, end) in bones.items():
        shortest, median, longest = np.quantile(np.linalg.norm(end - start, axis=2), [0.05, 0.5, 0.95], axis=0)
        with np.errstate(divide="ignore", invalid="ignore"):
            change = (longest - shortest) / median
        changes |= {f"{side} {part}": float(c) for side, c in zip(SIDES, change, strict=True)}
    if listed := [f"{part} by {change:.0%}" for part, change in changes.items() if change > _MAX_STRETCH]:
        which = f"bones change their lengths ({', '.join(listed)}), those of the figure do not"
        yield f"{which}: its trunk, hips, shoulders, hands and feet are not where those of the file are"


def frame_remarks(
    broken: Sequence[int], jumps: Sequence[int], shortened: bool, fps: float, timed: bool
) -> Iterator[str]:  # fmt: skip
    """A frame time that is not stated or long, lost frames, a last frame left out, and jumps that remain."""
    if not timed:
        remark = f"the file states no frame rate: {fps:g} a second are assumed"
        yield f"{remark}; if it is another, give it with --frame-rate"
    if fps < MIN_FRAME_RATE:
        remark = f"a frame lasts {two_digits(1.0 / fps)} s, longer than a camera's"
        yield f"{remark}: if that is wrong, give --frame-rate"
    if broken:
        n = len(broken)
        which = f"frame {broken[0]}" if n == 1 else f"{n} frames, the first of them frame {broken[0]},"
        yield f"{which} ({broken[0] / fps:.2f} s) did not belong to the motion around: interpolated"
    if shortened:
        yield "the last frame did not belong to the motion before it: left out"
    if jumps:
        yield f"the whole body jumps in a frame at {_times(jumps, fps)}: the gap there is too long to be interpolated"


def leap_remarks(leaps: Sequence[int], fps: float) -> Iterator[str]:
    """Frames after which the body's place leaps though its limbs move on (`restarted_paths`)."""
    if leaps:
        remark = f"the body leaps to another place in a frame at {_times(leaps, fps)}, though its limbs move on"
        yield f"{remark}, as where a lap is repeated from its start: the path is carried on from where it was"


def _times(frames: Sequence[int], fps: float) -> str:
    return ", ".join(f"{k / fps:.2f} s" for k in frames[:8]) + (", …" if len(frames) > 8 else "")


def smoothing_remarks(repeated: Mask, noise: Noise) -> Iterator[str]:
    """Frames (n,) that repeated the one before, and noise that was removed."""
    if n := int(repeated.sum()):
        which = "a frame repeats" if n == 1 else f"{n} of {len(repeated)} frames repeat"
        yield f"{which} the one before, as where frames are lost or the frame rate was changed: interpolated"
    if noise.turn or noise.shift:
        found = f"{np.rad2deg(noise.turn):.1f}° at the joints and {1000.0 * noise.shift:.0f} mm along the path"
        yield f"noise of {found} RMS was removed: it would hide which feet stand"


def padding_remarks(filled: Mask, fps: float, dropped: int) -> Iterator[str]:
    """Padding frames (n,) at the ends of a motion; `fps` and `dropped` as in `floor_remarks`."""
    if filled.any():
        remark = f"nothing moves at all for {_duration_text(spans(filled), fps, dropped)}"
        yield f"{remark}, as where programs pad a motion: soles, limbs and floor are estimated from the other frames"


def leg_speed_remarks(legs: Array, fps: float) -> Iterator[str]:
    """Legs that swing faster than a human's, as if the frame rate is stated ten times too high.

    Parameters
    ----------
    legs : array of shape (n, 2, 3)
        The figure's ankles relative to their hips [m].
    fps : float
        Frame rate [1/s].
    """
    speeds = np.linalg.norm(np.diff(legs, axis=0), axis=2).max(axis=1, initial=0.0) * fps
    fast = float(np.quantile(speeds, _SPEED_QUANTILE)) if len(speeds) else 0.0
    if fast > _MAX_ANKLE_SPEED:
        remark = f"legs swing at {fast:.0f} m/s and more for a tenth of the time, faster than any human's"
        yield f"{remark}: if {fps:g} frames a second are wrong, give --frame-rate"


def in_place_remarks(path: Array, ankles: Array, fps: float) -> Iterator[str]:
    """Feet that slide most of the time under a root that stays in one place.

    Parameters
    ----------
    path : array of shape (n, 3)
        Middle of the hips [m].
    ankles : array of shape (n, 2, 3)
        The ankles relative to it [m].
    fps : float
        Frame rate [1/s].
    """
    extent = float(np.ptp(path[:, :2], axis=0).max())
    if extent > _MAX_IN_PLACE_EXTENT or len(path) < max(2.0, _MIN_IN_PLACE_TIME * fps):
        return
    places = path[:, None] + ankles
    lower = np.argmin(places[:, :, 2], axis=1)
    steps = np.gradient(places[:, :, :2], axis=0)[np.arange(len(path)), lower]
    speed = fps * float(np.median(np.linalg.norm(steps, axis=1)))
    if speed > _MIN_SLIDING_SPEED:
        remark = (
            f"the lower foot slides at {two_digits(speed)} m/s or more half of the time, while the hips stay in place"
        )
        travel = "if the body's travel was taken out, hvf prepare gives it back"
        yield f"{remark} (within {extent:.2f} m): {travel}"


def joint_jump_remarks(jumps: Sequence[JointJump], motion: SourceMotion) -> Iterator[str]:
    """Single joints that jump within a frame without return: the largest jumps, by the file's names."""
    if jumps:
        largest = sorted(sorted(jumps, key=lambda jump: -jump.angle)[:4])
        which = ", ".join(
            f"{motion.joints[joint]} by {np.rad2deg(angle):.0f}° at {k / motion.fps:.2f} s"
            for k, joint, angle in largest
        )
        others = f" and {len(jumps) - len(largest)} more" if len(jumps) > len(largest) else ""
        yield f"joints jump within a frame, the others do not: {which}{others}; check the file"


def copy_remarks(hips: Sequence[str], taken: str) -> Iterator[str]:
    """Skeletons whose hips are at the same place, only one of which is used."""
    if hips:
        remark = (
            f"{len(hips)} skeletons have their hips at the same position ({', '.join(hips)}): that of {taken} is used"
        )
        yield f'{remark}; --roles FILE with a line such as pelvis = "{hips[-1]}" takes another'


def shape_remarks(taken: Mapping[str, str]) -> Iterator[str]:
    """Where limbs and head begin in a skeleton that was recognised by its shape."""
    begins = ("left_thigh", "right_thigh", "left_upper_arm", "right_upper_arm", "head")
    which = ", ".join(f"{taken[body]} as {body}" for body in begins if body in taken)
    yield f"the joints are recognised by the shape of the body, not by their names: {which}; --roles FILE overrules"


def floor_remarks(clearance: Array, root: Array, fps: float, dropped: int) -> Iterator[str]:
    """Times at which the body is above the floor for longer or further than in any flight, and at which it is below it.

    Parameters
    ----------
    clearance : array of shape (n,)
        Height of the lowest point of the body [m].
    root : array of shape (n, 3)
        Position of the root [m].
    fps : float
        Frame rate [1/s].
    dropped : int
        Frames that were left out in front: times count from the file's first frame.
    """
    aloft = [span for span in spans(clearance > _MIN_ALOFT_HEIGHT) if span[1] - span[0] > _MIN_ALOFT_TIME * fps]
    if aloft:
        high = max(float(clearance[start:end].max()) for start, end in aloft)
        how = f"up to {high:.2f} m above the floor, for {_duration_text(aloft, fps, dropped)}, longer than any flight"
        fall = min(_fall_acceleration(root[start:end, 2], fps) for start, end in aloft)
        why = "it stands on something that is not in the file, or its place is in another unit than its bones"
        if np.ptp(root, axis=0).max() < _MAX_PINNED_MOTION:
            why = "its root does not move in the file, as in poses that are estimated from a video"
        if fall > 0.0:
            how += f", and falls with {two_digits(fall)} m/s² there"
            rate = fps * float(np.sqrt(GRAVITY / fall))
            why = f"at {two_digits(rate)} frames a second instead of {fps:g} it would fall freely; see --frame-rate"
        yield f"the body is {how}: {why}"
    elif clearance.max() > _MAX_JUMP_HEIGHT:
        how = f"the body rises to {clearance.max():.2f} m above the floor, higher than anyone jumps"
        yield f"{how}: it stands on something that is not in the file, or its place is in another unit than its bones"
    beneath = spans(clearance < -_MIN_DEPTH)
    if beneath:
        how = f"up to {-float(clearance.min()):.2f} m beneath the floor, for {_duration_text(beneath, fps, dropped)}"
        yield f"parts of the body are {how}; check the file"


def _fall_acceleration(heights: Array, fps: float) -> float:
    """Downward acceleration [m/s²] of heights (n,) that follow a parabola, more slowly than in a fall; 0 otherwise.

    A parabola departs from its chord by more than the error that is allowed: one that does not is as good as a straight
    line, the even rise of a climb.
    """
    time = np.arange(len(heights)) / fps
    parabola = np.polyfit(time, heights, 2)
    change, fall = float(np.ptp(heights)), -2.0 * float(parabola[0])
    error, bend = rms(heights - np.polyval(parabola, time)), fall * float(time[-1]) ** 2 / 8.0
    fits = change > _MIN_FALL_HEIGHT and error < _MAX_FALL_ERROR * change < bend
    return fall if fits and 0.0 < fall < _MAX_FALL_RATIO * GRAVITY else 0.0


def _duration_text(found: Sequence[tuple[int, int]], fps: float, dropped: int) -> str:
    """Total duration of spans of frames, and start of the first one in the file, in words."""
    lasts, first = sum(end - start for start, end in found) / fps, (found[0][0] + dropped) / fps
    return f"{two_digits(lasts)} s (the first at {first:.2f} s)"


def two_digits(number: float) -> str:
    """A positive number in two significant digits, without an exponent."""
    return np.format_float_positional(number, 2, unique=False, fractional=False, trim="-")


def axis_name(direction: Array) -> str:
    """The axis nearest to a direction, such as ``+Y``."""
    axis = int(np.argmax(np.abs(direction)))
    return f"{'+' if direction[axis] > 0 else '-'}{'XYZ'[axis]}"


def unit_name(unit: float | None, leg: float, own_leg: float) -> str:
    """The unit in which the performer's legs are about as long as the figure's."""
    if unit is not None:
        description = f"{unit:.5g} m (fixed by the format), legs {leg * unit:.2f} m"
        human = _MIN_LEG_LENGTH <= leg * unit <= _MAX_LEG_LENGTH
        return description if human else f"{description}, which is not human: the file's unit is another"
    name, unit = min(_UNITS, key=lambda known: abs(np.log(leg * known[1] / own_leg)))
    likely = abs(np.log(leg * unit / own_leg)) < np.log(1.3)
    return f"{name} (worked out), legs {leg * unit:.2f} m" if likely else f"unknown, legs {leg:.4g} units"
