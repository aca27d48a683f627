"""What happened in a run, in numbers and in five lines, from its recording."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from models.mocap.clip import pose_difference
from sim.recording import Recording

Array = npt.NDArray[np.float64]

SETTLING = 1.0  # [s] after which a relaxed hand has found the curve, and after which a pushed one is back on it
HAND_AT_WORK = 1e-3  # [N] a hand that presses harder is pushing


@dataclass(frozen=True)
class PushSummary:
    """One push: when, how hard, and how far the stylus went with it.

    Attributes
    ----------
    start, seconds : float
        [s]
    peak_force : float
        [N]
    deviation_mm : float
        Largest distance from the curve during the push.
    along_push : float
        Cosine between force and deviation where the deviation is largest: 1 if it followed the push.
    """

    start: float
    seconds: float
    peak_force: float
    deviation_mm: float
    along_push: float


@dataclass(frozen=True)
class PathSummary:
    """How the stylus followed the curve.

    Attributes
    ----------
    deviation_rms_mm, deviation_max_mm : float
        Distance from the curve after the first second, while and soon after pushes left out.
    laps : float
        Laps of a closed curve, or times its length.
    lap_seconds : float
        Mean time of a lap; NaN before the first.
    pushes : tuple of PushSummary
    """

    deviation_rms_mm: float
    deviation_max_mm: float
    laps: float
    lap_seconds: float
    pushes: tuple[PushSummary, ...]


@dataclass(frozen=True)
class AnimationSummary:
    """How the animation changed.

    Attributes
    ----------
    pushed_deg, unpushed_deg : float
        Largest difference of a joint's rotation between h(p) and h at the curve's nearest point, while the hand pushes
        (and until the stylus is back) and otherwise; the first second left out.
    """

    pushed_deg: float
    unpushed_deg: float


@dataclass(frozen=True)
class FigureSummary:
    """How the physical figure followed the animation.

    Attributes
    ----------
    joint_error_rms_deg, root_error_rms_cm, root_error_max_cm : float
    residual_force_rms : float
        Residual force at the root while the reference is on the ground, as a share of body weight.
    residual_force_max : float
        Likewise, the largest.
    residual_moment_rms : float
        Moment over body weight × 1 m, likewise.
    residual_in_flight_max : float
        Largest residual force or moment while the reference flies [N, N m].
    flight_seconds : float
    saturated : float
        Share of the motors' time at their limit.
    ground_force_mean : float
        Mean vertical ground force as a share of body weight.
    """

    joint_error_rms_deg: float
    root_error_rms_cm: float
    root_error_max_cm: float
    residual_force_rms: float
    residual_force_max: float
    residual_moment_rms: float
    residual_in_flight_max: float
    flight_seconds: float
    saturated: float
    ground_force_mean: float


@dataclass(frozen=True)
class SpeedSummary:
    """What the run cost: simulated over real time, seconds until the first tick, and peak memory [MB]."""

    real_time_factor: float
    first_tick_seconds: float
    peak_memory_mb: float


@dataclass(frozen=True)
class RunSummary:
    """All of it; `lines` says it in five sentences."""

    path: PathSummary
    animation: AnimationSummary
    figure: FigureSummary
    speed: SpeedSummary
    warnings: dict[str, int]

    def lines(self) -> list[str]:
        """What happened, a sentence each."""
        path, figure = self.path, self.figure
        pushes = "; ".join(
            f"{push.peak_force:.1f} N at {push.start:.1f} s moved it {push.deviation_mm:.1f} mm" for push in path.pushes
        )
        warned = ", ".join(f"{name} ×{count}" for name, count in self.warnings.items()) or "none"
        return [
            f"The stylus ran {path.laps:.2f} laps, {path.deviation_rms_mm:.2f} mm RMS from the curve when left alone.",
            f"Pushes: {pushes}." if pushes else "The hand did not push.",
            f"The animation changed by up to {self.animation.pushed_deg:.1f}° a joint where it was pushed, "
            f"{self.animation.unpushed_deg:.2f}° elsewhere.",
            f"The physical figure followed within {figure.joint_error_rms_deg:.2f}° RMS at the joints and "
            f"{figure.root_error_rms_cm:.2f} cm at the root; residual force {100 * figure.residual_force_rms:.1f} % "
            "of body weight RMS.",
            f"It ran at {self.speed.real_time_factor:.2f} × real time with {self.speed.peak_memory_mb:.0f} MB; "
            f"MuJoCo's warnings: {warned}.",
        ]


def summarise(recording: Recording, default: Array, speed: SpeedSummary, warnings: dict[str, int]) -> RunSummary:
    """Measure a run.

    Parameters
    ----------
    recording : Recording
        With the channels of `sim.loop.groups`, and arrays ``curve_span`` (start and end of the phase), ``curve_closed``
        and ``body_weight``.
    default : Array
        Poses of the map at the nearest points of the curve, frame by frame, shape (m, 75).
    speed, warnings
        Taken over.
    """
    pushed = _pushed(recording)
    return RunSummary(
        _path(recording, pushed), _animation(recording, default, pushed), _figure(recording), speed, warnings
    )


def _pushed(recording: Recording) -> npt.NDArray[np.bool_]:
    """Ticks at which the hand pushes or did so less than `SETTLING` ago, shape (n,)."""
    at_work = np.linalg.norm(recording.channel("ticks", "user")[:], axis=1) > HAND_AT_WORK
    settling = round(SETTLING * recording.rates["ticks"])
    last = np.maximum.accumulate(np.where(at_work, np.arange(len(at_work)), -settling - 1))
    return np.arange(len(at_work)) - last <= settling


def _path(recording: Recording, pushed: npt.NDArray[np.bool_]) -> PathSummary:
    t, phase = recording.channel("ticks", "t")[:], recording.channel("ticks", "phase")[:]
    distance = recording.channel("ticks", "distance")[:]
    alone = distance[(t >= SETTLING) & ~pushed]
    start, end = recording.array("curve_span")
    steps = np.diff(phase)
    if recording.array("curve_closed"):
        steps -= (end - start) * np.round(steps / (end - start))
    laps = float(np.sum(steps) / (end - start))
    lap_seconds = float((t[-1] - t[0]) / laps) if laps >= 1.0 else math.nan
    return PathSummary(
        1e3 * _rms(alone), 1e3 * float(np.max(alone, initial=0.0)), laps, lap_seconds, _pushes(recording)
    )


def _pushes(recording: Recording) -> tuple[PushSummary, ...]:
    force = recording.channel("ticks", "user")[:]
    size = np.linalg.norm(force, axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], (size > HAND_AT_WORK).astype(int), [0]))))
    t, p, nearest = (
        recording.channel("ticks", "t")[:],
        recording.channel("ticks", "p")[:],
        recording.channel("ticks", "nearest")[:],
    )
    found: list[PushSummary] = []
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        away = p[first:last] - nearest[first:last]
        distance = np.linalg.norm(away, axis=1)
        k = int(np.argmax(distance))
        cosine = float(away[k] @ force[first + k] / max(distance[k] * size[first + k], 1e-12))
        found.append(
            PushSummary(float(t[first]), float(t[last - 1] - t[first]), float(np.max(size[first:last])),
                        1e3 * float(distance[k]), cosine)
        )  # fmt: skip
    return tuple(found)


def _animation(recording: Recording, default: Array, pushed: npt.NDArray[np.bool_]) -> AnimationSummary:
    t = recording.channel("frames", "t")[:]
    turns = pose_difference(default, recording.channel("frames", "reference")[:])[:, 6:].reshape(len(t), -1, 3)
    largest = np.degrees(np.max(np.linalg.norm(turns, axis=2), axis=1))
    pushed_frames = pushed[np.minimum(np.round(t * recording.rates["ticks"]).astype(int), len(pushed) - 1)]
    settled = t >= SETTLING
    return AnimationSummary(
        float(np.max(largest[settled & pushed_frames], initial=0.0)),
        float(np.max(largest[settled & ~pushed_frames], initial=0.0)),
    )


def _figure(recording: Recording) -> FigureSummary:
    weight = float(recording.array("body_weight"))
    residual, flight = recording.channel("frames", "residual")[:], recording.channel("frames", "flight")[:] > 0.0
    force, moment = np.linalg.norm(residual[:, :3], axis=1), np.linalg.norm(residual[:, 3:], axis=1)
    stance = ~flight
    root = recording.channel("frames", "root_error")[:]
    return FigureSummary(
        joint_error_rms_deg=math.degrees(_rms(recording.channel("frames", "joint_error")[:])),
        root_error_rms_cm=100.0 * _rms(root),
        root_error_max_cm=100.0 * float(np.max(root, initial=0.0)),
        residual_force_rms=_rms(force[stance]) / weight,
        residual_force_max=float(np.max(force[stance], initial=0.0)) / weight,
        residual_moment_rms=_rms(moment[stance]) / weight,
        residual_in_flight_max=float(np.max(np.concatenate((force[flight], moment[flight])), initial=0.0)),
        flight_seconds=float(np.sum(flight)) / recording.rates["frames"],
        saturated=float(np.mean(recording.channel("frames", "saturated")[:])) / 51.0,
        ground_force_mean=float(np.mean(recording.channel("frames", "ground")[:][:, 2])) / weight,
    )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0
