"""Measures of a trial: accuracy, smoothness and effort of the hand, and their effect on the figure.

Measuring begins `SETTLING_TIME` after the start of the trial, or in the middle of a trial shorter than twice that;
measures of the physical figure begin with the trial.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import mujoco
import numpy as np

from experiments.config.run_config import PERSON_INTENTS, RunConfig
from experiments.results.measures.laps import counted_rivers, lap_steps
from experiments.results.measures.run_measures import SETTLING_TIME
from experiments.results.measures.smoothness import (
    SPEED_RATE,
    log_dimensionless_jerk,
    spectral_arc_length,
    speed_profile,
)
from experiments.setups.session import Session, default_poses
from geometry.arrays import Array, Mask
from models.mocap.motion.clip import pose_difference
from models.mocap.motion.kinematics import global_rotations, segment_positions
from sim.body.falls import UP
from sim.body.figure_state import FigureState
from sim.body.residual import MIN_GROUND_FORCE
from sim.loop.channels import frame_channels, tick_channels
from sim.loop.servo import FrameLog, Servo, TickLog
from sim.world.world import World

_TICK_CHANNELS = ("t", "p", "v", "user", "force", "phase", "nearest", "distance", "river", "fault")
ROOT_WEIGHT = 1.0  # [rad/m] weight of the root's displacement in the product metric


class TrialLog:
    """An observer of a `Loop` that keeps the channels that measures need.

    Attributes
    ----------
    ticks, frames : dict of str to Array
        Data by channel, with the names of `sim.loop.channels.groups`; `frames` is empty without a figure, and has no
        errors and forces for a kinematic figure.
    """

    def __init__(self, servo: Servo, world: World):
        self._ticks_per_frame, self._pose_at = servo.figure_ticks, world.pose_at
        self._is_physical, self._has_figure = isinstance(servo.figure, FigureState), world.has_figure
        self._tick_blocks: dict[str, list[Array]] = {name: [] for name in _TICK_CHANNELS}
        self._frame_blocks: dict[str, list[Array]] = {}

    def __call__(self, ticks: TickLog, frames: FrameLog, n: int) -> None:
        """Add a block."""
        channels = tick_channels(ticks, n)
        for name, blocks in self._tick_blocks.items():
            blocks.append(channels[name].copy())
        if not self._has_figure:
            return
        n_frames = -(-n // self._ticks_per_frame)
        figure_channels = {"t": frames.t[:n_frames], "reference": frames.reference[:n_frames]}
        if self._is_physical:
            figure_channels = frame_channels(frames, n_frames, self._pose_at)
            del figure_channels["qpos"]
        for name, block in figure_channels.items():
            self._frame_blocks.setdefault(name, []).append(block.copy())

    @property
    def ticks(self) -> dict[str, Array]:
        """Channels at the rate of the servo."""
        return {name: np.concatenate(blocks) for name, blocks in self._tick_blocks.items()}

    @property
    def frames(self) -> dict[str, Array]:
        """Channels at the rate of the figure's control; none without a figure."""
        return {name: np.concatenate(blocks) for name, blocks in self._frame_blocks.items()}


COMPARISON_RATE = 25.0  # [Hz] at which animations are compared: about what the eye resolves
_NAN = float("nan")


@dataclass(frozen=True)
class Measure:
    """A measure of a trial.

    Attributes
    ----------
    name : str
        Name in tables.
    unit : str
        Unit; empty for a dimensionless number.
    better : {"less", "more"}
        Which direction is better for the user.
    says : str
        Description.
    figure : {"none", "kinematic", "physical"}
        The simplest kind of figure for which the measure exists.
    """

    name: str
    unit: str
    better: Literal["less", "more"]
    says: str
    figure: Literal["none", "kinematic", "physical"] = "none"

    @property
    def label(self) -> str:
        """Name and unit, for display."""
        return self.name.replace("_", " ") + (f" [{self.unit}]" if self.unit else "")


_TRACKING = "RMS distance of the stylus from the curve, while the hand does not mean to leave it"
_EXCHANGED = "∫ F·v dt of the device's force: what the field put into the hand, less what it took"
_EXPRESSIVE = (
    "RMS distance in R³ × SO(3)^18 of the edited animation from the default one, while the hand means to leave the "
    "curve: what is expressed, not what trembles"
)
_SEEN = "the same as seen: RMS distance of the 18 segments in space"

MEASURES: dict[str, Measure] = {
    measure.name: measure
    for measure in (
        Measure("tracking_error", "mm", "less", _TRACKING),
        Measure("completion", "", "more", "speed along the curve over the curve's own, at most 1"),
        Measure("effort", "N² s", "less", "∫ F² dt of the hand's force on the stylus"),
        Measure("hand_work", "mJ", "less", "∫ |F·v| dt of the hand: muscles pay for braking, too"),
        Measure("energy_exchanged", "mJ", "less", _EXCHANGED),
        Measure("sparc", "", "more", "spectral arc length of the speed, of a lap on average"),
        Measure("log_jerk", "", "more", "log dimensionless jerk of the speed, of a lap on average"),
        Measure("expressiveness", "rad", "more", _EXPRESSIVE, "kinematic"),
        Measure("expressiveness_seen", "cm", "more", _SEEN, "kinematic"),
        Measure("ballistic_error", "", "less", "RMS residual force in flight over body weight", "physical"),
        Measure("contact_error", "", "less", "fraction of stance without ground support", "physical"),
        Measure("fell", "", "less", "whether the figure fell", "physical"),
        Measure("faults", "", "less", "faults of the device that were latched"),
        Measure("margin_used", "", "less", "k_r over the critical k_r of the stability certificate, 1 at the boundary"),
    )
}  # fmt: skip
"""All measures by name; `margin_used` belongs to a condition, not a trial, and is added in the analysis."""
CONDITION_MEASURES = ("margin_used",)
_KINDS = ("none", "kinematic", "physical")


def measures_of(figure: str) -> tuple[str, ...]:
    """Names of the measures that exist for a kind of figure."""
    return tuple(name for name, measure in MEASURES.items() if _KINDS.index(measure.figure) <= _KINDS.index(figure))


def measure_trial(config: RunConfig, session: Session, log: TrialLog) -> dict[str, float]:
    """All measures of a completed trial, by name; NaN where there is nothing to measure."""
    ticks, frames = log.ticks, log.frames
    start = min(SETTLING_TIME, 0.5 * float(ticks["t"][-1]))
    intent = intends_to_leave(config, ticks["t"])
    ticks, intent = {name: channel[ticks["t"] >= start] for name, channel in ticks.items()}, intent[ticks["t"] >= start]
    measures = dict.fromkeys(measures_of(config.figure.kind), _NAN)
    measures |= _hand_measures(ticks, intent, session) | {
        "faults": float(np.sum(np.diff(ticks["fault"], prepend=0.0) > 0.0))
    }
    del measures["margin_used"]
    if frames:
        stride = max(1, round(1.0 / (COMPARISON_RATE * session.servo.plant.period * session.servo.figure_ticks)))
        measures |= _animation_measures(session, log, stride, start, config)
    if "joint_error" in frames:
        measures |= _figure_measures(frames, session.weight)
    return measures


def intends_to_leave(config: RunConfig, t: Array) -> Mask:
    """Whether the hand intends to leave the curve at times t [s]: always with one of `PERSON_INTENTS`, else in pushes.

    A push counts from its start until `SETTLING_TIME` after its end.
    """
    if config.user.does in PERSON_INTENTS:
        return np.ones(len(t), dtype=bool)
    spans = [(push.at, push.at + push.seconds + SETTLING_TIME) for push in config.user.pushes]
    return np.any([(at <= t) & (t <= end) for at, end in spans], axis=0) if spans else np.zeros(len(t), dtype=bool)


def _hand_measures(ticks: Mapping[str, Array], intent: Mask, session: Session) -> dict[str, float]:
    period, curve = session.servo.plant.period, session.curve
    user, force, v = ticks["user"], ticks["force"], ticks["v"]
    spans = np.append(session.river_laps, curve.duration)
    river = counted_rivers(ticks["river"], spans)
    phase_steps = lap_steps(ticks["phase"], river, spans, curve.periodic) * spans[river[1:]]
    elapsed = float(ticks["t"][-1] - ticks["t"][0])
    sparc, jerk = _smoothness_per_lap(v, 1.0 / period, curve.duration)
    return {
        "tracking_error": 1e3 * _rms(ticks["distance"][~intent]),
        "completion": float(np.clip(np.sum(phase_steps) / elapsed, 0.0, 1.0)) if elapsed > 0.0 else _NAN,
        "effort": float(np.sum(user**2)) * period,
        "hand_work": 1e3 * float(np.sum(np.abs(np.sum(user * v, axis=1)))) * period,
        "energy_exchanged": 1e3 * float(np.sum(force * v)) * period,
        "sparc": sparc,
        "log_jerk": jerk,
    }


def _smoothness_per_lap(velocity: Array, rate: float, lap: float) -> tuple[float, float]:
    """Mean SPARC and log dimensionless jerk over windows of a lap, or over the whole if it is shorter than a lap."""
    speed = speed_profile(velocity, rate)
    size = round(lap * SPEED_RATE)
    laps = [speed[k : k + size] for k in range(0, len(speed) - size + 1, size)] or [speed]
    if len(laps[0]) < 3:
        return _NAN, _NAN
    return (
        float(np.mean([spectral_arc_length(one, SPEED_RATE) for one in laps])),
        float(np.mean([log_dimensionless_jerk(one, SPEED_RATE) for one in laps])),
    )


def _animation_measures(
    session: Session, log: TrialLog, stride: int, start: float, config: RunConfig
) -> dict[str, float]:
    ticks, frames = log.ticks, log.frames
    rows = slice(None, None, stride * session.servo.figure_ticks)
    default = default_poses(session, stride)(*(ticks[name][rows] for name in ("nearest", "phase", "river")))
    t, edited = frames["t"][::stride], frames["reference"][::stride]
    chosen = (t >= start) & intends_to_leave(config, t)
    if not np.any(chosen):
        return {}
    return {
        "expressiveness": _rms(geodesic_distance(default[chosen], edited[chosen])),
        "expressiveness_seen": 1e2 * _rms(seen_distance(default[chosen], edited[chosen], session.world.body)),
    }


def _figure_measures(frames: Mapping[str, Array], weight: float) -> dict[str, float]:
    """Measures of the physical figure, until its first fall."""
    fallen = frames["down"] != UP
    end = int(np.argmax(fallen)) if np.any(fallen) else len(fallen)
    flight = frames["flight"][:end] > 0.0
    standing = frames["ground"][:end, 2][~flight] > MIN_GROUND_FORCE
    return {
        "fell": float(np.any(fallen)),
        "ballistic_error": _rms(np.linalg.norm(frames["residual"][:end, :3][flight], axis=1)) / weight,
        "contact_error": 1.0 - float(np.mean(standing)) if len(standing) else _NAN,
    }


def _rms(values: Array) -> float:
    return math.sqrt(float(np.mean(values**2))) if len(values) else _NAN


def geodesic_distance(poses: Array, others: Array) -> Array:
    r"""Length of the shortest path in D between poses, shapes (n, 75) → (n,) [rad].

    .. math:: d(q, q')^2 = (x - x')^2 + \sum_{i=1}^{18} |\log(R_i^{-1} R_i')|^2

    D = R³ × SO(3)^18 is the configuration space of the paper's figure (section 2.2): position and rotation of the root,
    and 17 joints. A product metric needs a length for an angle: here a metre counts as a radian.
    """
    difference = pose_difference(poses, others)
    difference[:, :3] *= ROOT_WEIGHT
    return np.linalg.norm(difference, axis=1)


def seen_distance(poses: Array, others: Array, figure: mujoco.MjModel) -> Array:
    """RMS over the 18 segments of the distance between their origins in space, shapes (n, 75) → (n,) [m]."""
    places = [segment_positions(each[:, :3], global_rotations(each), figure) for each in (poses, others)]
    apart = places[0] - places[1]
    return np.sqrt(np.mean(np.sum(apart**2, axis=2), axis=1))
