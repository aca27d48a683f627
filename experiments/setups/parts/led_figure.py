"""Map parts of a led figure: the clip that is led, its map and gait, and remarks about both."""

from dataclasses import dataclass, replace
from typing import Self

import mujoco
import numpy as np

from controllers.errors import ParameterError
from controllers.haptic_map.led import Led
from controllers.legs.limbs import Limb
from controllers.walking.gait import Gait
from experiments.config.maps import Led as LedMap
from experiments.config.run_config import RunConfig
from experiments.fitting.balance import balanced_on_ground, imbalance_at_rest
from experiments.fitting.figure_legs import figure_legs
from experiments.setups.parts.clips import load_clips
from experiments.setups.parts.leading_hand import s_curve
from experiments.setups.parts.part_types import MapParts
from geometry.arrays import Mask
from geometry.spans import spans
from models.humanoid.skeleton import proportion
from models.mocap.dynamics.contacts import contacts
from models.mocap.library import embedded_names
from models.mocap.motion.clip import CLOSURE_TOLERANCE, Clip
from models.mocap.preparation.laps import best_lap
from models.mocap.preparation.looping import close_or_rest
from sim.world.world import FigureKind

MAX_STEP = 0.75
"""Longest step of a capture that is led without its flight phases [m]."""

_PHASE_COUNT = 256  # samples of the stance over a lap: one in 4 ms for a lap of a second
# Difference of the end poses above which a clip is not a cycle: CMU 02_01's lap has 5°, its whole clip 35°.
_MAX_CYCLE_GAP = np.deg2rad(15.0)
# [m] distance of the centre of mass from its support up to which a figure stands still. A jog that begins 33 cm beyond
# it needs a residual of 28 % of weight for that, within it 0.1 %.
_MAX_IMBALANCE = 2e-3
# Share of its lap, at less than a quarter of its mean speed [1] over 0.1 s [s], above which a clip is no steady gait:
# gaits among 143 prepared captures have 0.11 at most; those that jump, stop or look round have 0.14 to 0.97.
_MAX_SLOW_SHARE, _SLOW_SPEED, _SPEED_TIME = 0.2, 0.25, 0.1


@dataclass(frozen=True, kw_only=True)
class LedParts(MapParts[Led]):
    """Map parts of a led figure, with its gait."""

    gait: Gait

    def refine(self, physical: bool) -> Self:
        """As `MapParts.refine`; the gait begins at the phase of the lap at which the refined map does."""
        parts, support = super().refine(physical), self.gait.support
        later = round(len(support) * (parts.haptic_map.phase - self.haptic_map.phase))
        return replace(parts, gait=replace(self.gait, support=np.roll(support, -later)))


def led_parts(config: RunConfig, clips: tuple[Clip, ...], figure: mujoco.MjModel) -> LedParts:
    """Map parts of a led figure.

    Raises
    ------
    ParameterError
        If there is not one clip, or it does not travel on foot.
    """
    if len(clips) != 1:
        raise ParameterError(f"got {len(clips)} --clips; expected one to lead, such as walk or run")
    haptic_map, gait = led_map(clips[0], figure, is_authored(config))
    return LedParts(
        haptic_map=haptic_map, clips=clips, curve=s_curve(), gait=gait,
        refined=lambda: (_begun_in_balance(balanced_on_ground(haptic_map, gait, figure), figure), ()),
        remarks=lap_remark(clips[0], config.figure.kind) + gait_remark(clips[0].name, haptic_map, config.figure.kind),
    )  # fmt: skip


def led_clips(part: LedMap) -> tuple[tuple[Clip, ...], tuple[str, ...]]:
    """The clip that is led, and remarks about it: of a file in which no cycle is found, the best lap is prepared.

    Raises
    ------
    ModelError
        If there is no such clip, or a file cannot be read.
    """
    clips, remarks = load_clips(part.clips, part.raw)
    if part.raw:
        slides = "led as captured: its feet slide, and the physical figure may fall; without --raw it is prepared"
        return clips, (*remarks, *(f"{name}: {slides}" for name in part.clips if name not in embedded_names()))
    if all(clip.closes(CLOSURE_TOLERANCE) for clip in clips):
        return clips, remarks
    return load_clips(part.clips, loop="lap")


def is_authored(config: RunConfig) -> bool:
    """Whether the clip that is led is an embedded one."""
    return config.map.clips[0] in embedded_names()


def led_map(clip: Clip, figure: mujoco.MjModel, authored: bool = True) -> tuple[Led, Gait]:
    """Map and gait of a led figure, beginning in the middle of the longest stance with the most feet on the floor.

    A clip is led as it is, but one with flights that is not authored, or for which no other form without flights
    exists, by steps; one that does not close is closed first. A figure of another stature moves in proportion, with
    strides of its size.

    Raises
    ------
    ParameterError
        If the clip does not travel, or has no frame in which a foot stands.
    """
    cycle = clip if clip.closes(CLOSURE_TOLERANCE) else close_or_rest(clip, "lap").clip
    clip, legs, stance = cycle.resized(proportion(figure)), figure_legs(figure), contacts(cycle).planted[:-1]
    as_recorded = _map_and_gait(clip, legs, stance)
    if not as_recorded[0].flies or (authored and as_recorded[0].has_grounded_form):
        return as_recorded
    return _map_and_gait(clip, legs, stance, MAX_STEP)


def _begun_in_balance(led: Led, figure: mujoco.MjModel) -> Led:
    """The same map, beginning where the figure can stand still, if it cannot where it does; needs compiled code.

    That is the middle of the nearest part of the lap in which the centre of mass is as near to its support as anywhere.
    """
    imbalance = imbalance_at_rest(led, led.phase + np.arange(_PHASE_COUNT) / _PHASE_COUNT, figure)
    if imbalance[0] < _MAX_IMBALANCE:
        return led
    balanced = spans(imbalance < imbalance.min() + _MAX_IMBALANCE)
    later = min((sum(span) // 2 for span in balanced), key=lambda step: min(step, _PHASE_COUNT - step))
    return led.begun_at((led.phase + later / _PHASE_COUNT) % 1.0)


def _map_and_gait(
    clip: Clip, legs: tuple[Limb, ...], stance: Mask, longest_step: float | None = None
) -> tuple[Led, Gait]:
    """Map and gait of one lap; `stance` marks the feet on the floor in each of its frames but the last."""
    phases, steps = np.linspace(0.0, 1.0, _PHASE_COUNT, endpoint=False), clip.n_frames - 1
    sampled = stance[np.round(phases * steps).astype(int) % steps]
    support = sampled.sum(axis=1).astype(np.int64)
    if not support.any():
        raise ParameterError(f"clip {clip.name!r} has no frame in which a foot stands; expected one that goes on foot")
    first = _middle_of_longest(support == support.max())
    led = Led((clip.poses, clip.fps), legs, phases[first], sampled, longest_step)
    if not led.flies:
        support = np.maximum(support, 1)
    speed, grounded = led.pace * led.stride / led.duration, led.has_grounded_form and not led.flies
    return led, Gait(led.stride, speed, np.roll(support, -first), led.reach, grounded)


def lap_remark(clip: Clip, figure: FigureKind) -> tuple[str, ...]:
    """Remarks, if only a part of a clip is led, or if the clip does not repeat itself or is no steady gait."""
    lap, remarks = best_lap(clip), list[str]()
    if lap.clip.n_frames < clip.n_frames:
        remarks.append(
            f"of the clip {clip.name!r} the lap that repeats itself best is led, {lap.start:.2f} to {lap.end:.2f} s"
        )
    if lap.gap > _MAX_CYCLE_GAP:
        remarks.append(
            f"the clip {clip.name!r} does not repeat itself (its ends are {np.degrees(lap.gap):.0f}° apart): it is "
            "closed over its ends" + (", and the physical figure may fall there" if figure == "physical" else "")
        )
    if (slow := _slow_share(lap.clip)) > _MAX_SLOW_SHARE:
        remarks.append(
            f"the clip {clip.name!r} is no steady gait: for {100 * slow:.0f} % of its lap it has less than "
            f"{_SLOW_SPEED} of its mean speed, and the hand hardly moves it there"
            + ("; elsewhere the physical figure may fall" if figure == "physical" else "")
        )
    return tuple(remarks)


def _slow_share(lap: Clip) -> float:
    """Share of a lap in which its root advances at less than `_SLOW_SPEED` of its mean speed."""
    root, n = lap.poses[:, :2], lap.n_frames - 1
    advance, step = (root - root[0]) @ (root[-1] - root[0]), max(1, round(_SPEED_TIME * lap.fps))
    laps_later, frames = np.divmod(np.arange(n) + step, n)
    speed = (advance[frames] + laps_later * advance[-1] - advance[:-1]) * n / step
    return float(np.mean(speed < _SLOW_SPEED * advance[-1]))


def gait_remark(name: str, led: Led, figure: FigureKind) -> tuple[str, ...]:
    """Remark on a clip with flights: a body in the air falls with g, whatever the pace at which it is led."""
    if led.flies and led.has_grounded_form:
        return (f"the clip {name!r} flies: led slowly it goes without flights, on bent knees",)
    if led.has_grounded_form:
        return (
            f"the clip {name!r} flies: a capture is led without flights, by steps of {MAX_STEP} m at most, at "
            f"{led.pace * led.stride / led.duration:.1f} m/s",
        )
    if led.flies and figure == "physical":
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
