"""LEADING as a run: map and gait of the led figure, the field, and a hand that leads along an S and straight back."""

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.easing import cubic_steps
from controllers.errors import ParameterError
from controllers.fields.leading import Leading
from controllers.haptic_map.led import Led
from controllers.legs.cyclic_runs import runs
from controllers.legs.limbs import Limb
from controllers.motion.captures import Capture
from controllers.safety.limiter import ForceLimiter
from controllers.state import Array, Mask
from controllers.walking.gait import Gait
from controllers.walking.walking import Walking
from experiments.config.maps import Led as LedMap
from experiments.config.modes import Lead
from experiments.config.run_config import RunConfig
from experiments.fitting.figure_legs import figure_legs
from experiments.fitting.led_balance import balanced_on_ground, led_gains
from experiments.results.measures.lead_measures import lead_summary
from experiments.results.measures.summary import RunSummary
from experiments.setups.parts.budget import SPAN, fastest, tank_for
from experiments.setups.parts.clips import BLINK, load_clips
from experiments.setups.parts.hands import participant
from experiments.setups.parts.part_types import MapParts, Measuring, Notes, Parts
from models.humanoid.skeleton import CONTACT_RADIUS
from models.mocap.dynamics.contacts import Contacts, contacts
from models.mocap.motion.clip import CLOSES, Clip
from models.mocap.motion.spans import spans
from models.mocap.preparation.laps import lap_of
from sim.users.hand.arm import Arm
from sim.users.intents import Lead as LeadIntent
from sim.users.participant import Participant

FORTH = 5.0  # [s] along the S at the clip's own pace
PAUSE, BACK_PACE = 0.8, 0.5  # [s] of each pause; pace of the way back over the clip's own
_PERIOD, _EASE = 0.01, 0.8  # [s] between the points of the hand's path, and of a ramp up or down of its pace
_START = 0.025  # [m] from its place on the curve within which a hand begins
STIFFNESS = 150.0  # of the arm [N/m]: compliant enough to be guided
_BEND = 0.25 * np.pi  # each half of the S turns from −45° to 45° or back
_FROM, _TO = -0.06, 0.08  # x of its ends in H [m]
_PHASES = 256
_UNLIKE = np.deg2rad(15.0)  # pose gap above which ends are not of one cycle: CMU 02_01's lap has 5°, its whole clip 35°
_SWING = 0.15  # [s] shortest swing phase or hop: half or twice of it changes none of these captures
# Largest lateral acceleration of a gait with flights [m/s²]: leaning more, it falls if a landing is missed by a little.
_FLYING_LATERAL = 1.2
# Largest pace of a gait with flights, over the clip's own: played faster it lands late, since gravity stays the same.
# The same holds for a run led by steps: its limbs already swing as fast as in the run; if they swing faster, motors of
# the stance leg saturate.
_RUNNING_FORWARD = 1.0


def led_clips(part: LedMap) -> tuple[tuple[Clip, ...], tuple[str, ...]]:
    """The clip that is led, and remarks about it: prepared, or as captured if the prepared one has flights.

    The flights of a prepared run are ballistic at the run's own pace only; a led figure moves at other paces and would
    land early or late. A clip as captured is led by steps (`gait_remark`). Embedded clips are the same either way.

    Raises
    ------
    ModelError
        If there is no such clip, or a file cannot be read.
    """
    clips, remarks = load_clips(part.clips, part.raw)
    if part.raw or all(contacts(clip).planted.any(axis=1).all() for clip in clips):
        return clips, remarks
    captured, remarks_captured = load_clips(part.clips, raw=True)
    if all(np.array_equal(clip.poses, raw.poses) for clip, raw in zip(clips, captured, strict=True)):
        return clips, remarks
    names = ", ".join(clip.name for clip in captured)
    return captured, (*remarks_captured, f"{names}: flies when prepared, and is led as captured, by steps")


def led_map(clip: Clip, legs: tuple[Limb, ...]) -> tuple[Led, Gait]:
    """Map and gait of a led figure, beginning in the middle of the longest stance with the most feet on the floor.

    A clip that closes is taken as feasible and led as it is. A clip that does not close is led as a capture, with its
    stance feet held (`Capture`); so is one whose flights have no flightless form otherwise.

    Raises
    ------
    ParameterError
        If the clip does not travel, or has no frame in which a foot stands.
    """
    lap, closes = lap_of(clip), clip.closes(CLOSES)
    marks = contacts(clip).within(round(lap.start * clip.fps), lap.clip.n_frames)
    clip = lap.clip
    if not closes:
        return _led(clip, legs, stances(marks, clip.fps), Capture(CONTACT_RADIUS))
    made = _led(clip, legs, marks.planted[:-1], None)
    if made[0].flies and not made[0].grounds:
        steps = _led(clip, legs, stances(marks, clip.fps), Capture(CONTACT_RADIUS))
        return steps if steps[0].grounds else made
    return made


def _led(clip: Clip, legs: tuple[Limb, ...], stands: Mask, capture: Capture | None) -> tuple[Led, Gait]:
    """Map and gait of one lap; `stands` marks the feet on the floor in each of its frames but the last."""
    phases, steps = np.linspace(0.0, 1.0, _PHASES, endpoint=False), clip.n_frames - 1
    sampled = stands[np.round(phases * steps).astype(int) % steps]
    support = sampled.sum(axis=1).astype(np.int64)
    if not support.any():
        raise ParameterError(f"clip {clip.name!r} has no frame in which a foot stands; expected one that goes on foot")
    first = _middle_of_longest(support == support.max())
    led = Led((clip.poses, clip.fps), legs, phases[first], sampled if capture is None else stands, capture)
    if not led.flies:
        support = np.maximum(support, 1)
    speed, grounded = led.pace * led.stride / led.duration, led.grounds and not led.flies
    return led, Gait(led.stride, speed, np.roll(support, -first), led.reach, grounded)


def lap_remark(clip: Clip) -> tuple[str, ...]:
    """Remarks, if only a part of a clip is led, or if the clip does not repeat itself."""
    lap, remarks = lap_of(clip), list[str]()
    if lap.clip.n_frames < clip.n_frames:
        remarks.append(
            f"of the clip {clip.name!r} the lap that repeats itself best is led, {lap.start:.2f} to {lap.end:.2f} s"
        )
    if lap.gap > _UNLIKE:
        remarks.append(
            f"the clip {clip.name!r} does not repeat itself (its ends are {np.degrees(lap.gap):.0f}° apart): it is "
            "closed over its ends, and the physical figure may fall there"
        )
    return tuple(remarks)


def stances(marks: Contacts, fps: float) -> Mask:
    """Stance of each foot of a capture, shape (n − 1, 2), for n frames of which the last begins the next lap.

    Contact marks are cleaned in three steps. A foot that is up for less than `_SWING` stands throughout. Where no foot
    is settled, one that stood and is still planted goes on standing: it has not left the floor, but sunk into it. A
    flight shorter than `BLINK` is none: the feet that stood before it go on standing.
    """
    stands, rests = marks.settled[:-1], marks.planted[:-1]
    n = len(stands)
    for foot in range(stands.shape[1]):
        for start, end in runs(~stands[:, foot]):
            if end - start < _SWING * fps:
                stands[np.arange(start, end) % n, foot] = True
    for start, end in runs(~np.any(stands, axis=1)):
        for sample in range(start, end):
            stands[sample % n] = stands[sample % n - 1] & rests[sample % n]
            if not stands[sample % n].any():
                break
    for start, end in runs(~np.any(stands, axis=1)):
        if end - start < BLINK * fps:
            stands[np.arange(start, end) % n] = stands[start - 1]
    return stands


def gait_remark(name: str, led: Led) -> tuple[str, ...]:
    """Remark on a clip with flights: a body in the air falls with g, whatever the pace at which it is led."""
    if led.flies and led.grounds:
        return (f"the clip {name!r} flies: led slowly it goes without flights, on bent knees",)
    if led.grounds:
        return (
            f"the clip {name!r} flies: a capture is led without flights, by steps of {Capture.step} m at most, at "
            f"{led.pace * led.stride / led.duration:.1f} m/s",
        )
    if led.flies:
        return (
            f"the clip {name!r} lands on the foot with which it leaves the ground: the animation can be led at any "
            "pace, the physical figure may fall where it is slow",
        )
    return ()


def _middle_of_longest(mask: Mask) -> int:
    """Index of the middle of the longest run of True in a cyclic mask."""
    n = len(mask)
    if mask.all():
        return 0
    start = int(np.argmin(mask))
    longest = max(spans(np.roll(mask, -start)), key=lambda span: span[1] - span[0])
    return (sum(longest) // 2 + start) % n


def s_curve() -> Trajectory:
    """The S along which the default hand leads, in the plane z = 0 of H: two arcs, parametrised by arc length [m]."""
    radius = (_TO - _FROM) / (4.0 * np.sin(_BEND))
    turn = np.linspace(-_BEND, _BEND, 65)
    headings = np.concatenate([turn, turn[-2::-1]])
    steps = radius * (turn[1] - turn[0])
    middle = 0.5 * (headings[1:] + headings[:-1])
    ways = np.stack([np.cos(middle), np.sin(middle), np.zeros(len(middle))], axis=1) * steps
    points = np.array([_FROM, 0.0, 0.0]) + np.concatenate([np.zeros((1, 3)), np.cumsum(ways, axis=0)])
    return Trajectory(steps * np.arange(len(points)), points)


@dataclass(frozen=True, kw_only=True)
class LedParts(MapParts[Led]):
    """Map parts of a led figure, with its gait."""

    gait: Gait


def led_parts(config: RunConfig, part: LedMap, clips: tuple[Clip, ...], figure: mujoco.MjModel) -> LedParts:
    """Map parts of a led figure.

    Raises
    ------
    ParameterError
        If there is not one clip, or it does not travel on foot.
    """
    if len(clips) != 1:
        raise ParameterError(f"one clip is led, got {len(clips)}; name one with --clips, such as walk or run")
    made, gait = led_map(clips[0], figure_legs(figure))
    return LedParts(
        haptic_map=made, clips=clips, curve=s_curve(), gait=gait,
        refined=lambda: (balanced_on_ground(made, gait, figure), ()),
        remarks=lap_remark(clips[0]) + gait_remark(clips[0].name, made),
    )  # fmt: skip


def lead_parts(config: RunConfig, mode: Lead, maps: LedParts) -> Parts:
    """Parts of a run in the mode "lead"."""
    field, course = leading(mode, maps.gait), s_curve()
    config = replace(config, mode=replace(mode, floor_scale=field.walking.scale))
    limiter = ForceLimiter(config.clock.servo_period)
    tank = tank_for(limiter.peak * fastest(course), ((np.inf, SPAN),), _START, limiter)
    gait = field.walking.gait
    static = {"lead_scale": field.walking.scale, "lead_stride": gait.stride, "lead_support": gait.support.astype(float)}
    notes = Notes("LEAD", 0.0, "", "the figure's path", "leads", static)

    def summarise(summary: RunSummary, of: Measuring) -> RunSummary:
        lead = lead_summary(
            of.recording, gait, of.walkers, config.scene, None if summary.figure is None else summary.figure.fell_at
        )
        return replace(summary, lead=lead)

    return Parts(
        config=config, maps=maps, field=field, program=field.program(), course=course, user=_hand(config, field),
        tank=tank, notes=notes, gains=led_gains(maps.haptic_map), walking=field.walking,
        argument_at=lambda nearest, phases: walker_argument(phases), handled=((0.0, np.inf),), summarise=summarise,
    )  # fmt: skip


def leading(mode: Lead, gait: Gait) -> Leading:
    """Field of the mode "lead".

    Raises
    ------
    ParameterError
        If a number is out of its interval.
    """
    curve = s_curve()
    x, y, _ = curve.point(curve.start)
    scale = FORTH * gait.speed / curve.length if mode.floor_scale is None else mode.floor_scale
    flying = {"lateral": _FLYING_LATERAL} if gait.flies else {}
    running = {"forward": _RUNNING_FORWARD} if gait.flies or gait.grounded else {}
    walking = Walking(gait, (float(x), float(y)), -_BEND, scale, **flying, **running)
    return Leading(walking, k_l=mode.leash, b=mode.damping)


def leading_hand(field: Leading) -> Arm:
    """The default hand: a pause, along the S at the gait's own pace, a pause, straight back more slowly."""
    curve = s_curve()
    seconds = field.walking.scale * curve.length / field.walking.gait.speed
    start, end = curve.point(curve.start), curve.point(curve.end)
    away = float(np.linalg.norm(end - start)) / curve.length
    forth, back = _eased(seconds), _eased(seconds * away / BACK_PACE)
    path = np.concatenate([
        np.tile(start, (round(PAUSE / _PERIOD), 1)), curve.point(curve.start + curve.duration * forth),
        np.tile(end, (round(PAUSE / _PERIOD), 1)), end + back[:, None] * (start - end),
    ])  # fmt: skip
    return Arm(STIFFNESS, path=path, period=_PERIOD)


def _hand(config: RunConfig, field: Leading) -> Arm | Participant:
    """The hand that leads: an arm's impedance, or a person along the same path."""
    arm, person = leading_hand(field), config.user.person
    if person is None:
        return arm
    return participant(person, LeadIntent(arm.path, arm.period), s_curve(), config.seconds, config.seed)


def walker_argument(s: Array) -> Array:
    """Arguments (n, 7) of the led figure's map at arc lengths s (n,) [m]."""
    argument = np.zeros((len(s), 7))
    argument[:, 0], argument[:, 3] = s, 1.0
    return argument


def _eased(seconds: float) -> Array:
    """Progress from 0 to 1, sampled every `_PERIOD`, at a constant rate with ramps of `_EASE` at both ends."""
    t = np.arange(_PERIOD, seconds + _EASE, _PERIOD)
    total = np.cumsum(cubic_steps(np.minimum(t, seconds + _EASE - t) / _EASE))
    return total / total[-1]
