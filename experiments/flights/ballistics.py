"""Ballistics of clips: certify their flights, fly them with the physical figure, repair them."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from controllers.certificates.flight.ballistic import (
    BodyMotion,
    FlightJudgement,
    ballistic_verdict,
    judge_flights,
)
from controllers.certificates.flight.contact import BodyContact, contact_doubts
from controllers.certificates.flight.flight_fit import FlightFit, best_fall
from controllers.certificates.flight.rate_bounds import RateBounds, rate_bounds, turns_verdict
from controllers.certificates.flight.tolerance import GRAVITY, JUDGING, Judging
from controllers.certificates.report import Certificate, Verdict, hash_of, hashes_of
from controllers.state import Array
from experiments.files.certificate_files import clip_inputs
from models.humanoid.skeleton import N_POSE
from models.mocap import quaternions
from models.mocap.clip import Clip, pose_difference
from models.mocap.dynamics.contacts import contacts
from models.mocap.dynamics.momentum import momentum
from models.mocap.preparation.poses import sole_points
from sim.body.clip_motion import clip_motion
from sim.body.figure_state import REPORT_RESIDUAL
from sim.body.tracking import TrackingConfig, tracked_motion

_LIFT = 10.0  # flown so high that nothing but gravity acts [m]
_FINE = 480.0  # frames per second at which a flight is flown [1/s]
_ANY_RATE = 100.0  # nobody plays a flight so fast
_AFTER = 8  # of them after the landing, which shape the reference's spline


@dataclass(frozen=True, eq=False)
class ClipBallistics:
    """What is known of the flights of a clip.

    Attributes
    ----------
    seconds : float
        How long the clip is [s].
    clip : Clip
        The clip; one that closes is followed by its next lap, so that a flight over the seam is whole.
    motion : BodyMotion
        Its centre of mass, momentum and contacts.
    flights : tuple of FlightJudgement
        Those that begin in the first lap.
    bounds : RateBounds
        Admissible rates of every frame of the first lap.
    certificate : Certificate
        Verdicts ``ballistic`` and ``turns``.
    """

    seconds: float
    clip: Clip
    motion: BodyMotion
    flights: tuple[FlightJudgement, ...]
    bounds: RateBounds
    certificate: Certificate

    def lines(self) -> tuple[str, ...]:
        """The verdicts and the admissible rates in words, a line each."""
        verdicts = [f"{name}: {found.verdict}; {found.reason}" for name, found in self.certificate.verdicts.items()]
        rates = [
            f"flight at {flight.fit.time:.2f} s: seen as natural {_in_words(flight.seen)} of its speed, can be done "
            f"{_in_words(flight.done)}; true gravity asks for a take-off at {flight.fit.take_off_speed:.2f} m/s, "
            f"recorded {flight.fit.take_off[2]:.2f}"
            for flight in self.flights
        ]
        return (*verdicts, *rates)


def _in_words(rates: tuple[float, float] | None) -> str:
    if rates is None or not np.isfinite(rates[0]):
        return "at no rate"
    return f"at {rates[0]:.2f} or more" if rates[1] > _ANY_RATE else f"at {rates[0]:.2f} to {rates[1]:.2f}"


class FlightTrial(NamedTuple):
    """A flight of the physical figure, with no force but gravity.

    Attributes
    ----------
    rate : float
        σ at which the clip was played.
    distance : float
        Greatest distance between the centres of mass of figure and clip [m].
    predicted : float
        The same as the certificate has it [m].
    turn : float
        Greatest angle between the pelvis of figure and clip [rad].
    residual : float
        Greatest component of the residual wrench at the root [N, N m]: zero, or it was no flight.
    """

    rate: float
    distance: float
    predicted: float
    turn: float
    residual: float


def body_motion(clip: Clip) -> BodyMotion:
    """What the ballistic certificate needs to know of a clip on the default figure."""
    moved, touched = momentum(clip), contacts(clip)
    return BodyMotion(clip.fps, *moved, touched.clearance, touched.supported)


def body_contact(clip: Clip) -> BodyContact:
    """What of a clip touches the floor, and how."""
    touched, points = contacts(clip), sole_points(clip.poses)
    travelled = [0.0]
    for part in range(points.shape[1]):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], touched.resting[:, part].astype(np.int8), [0]])))
        for start, end in zip(edges[::2], edges[1::2], strict=True):
            stance = points[start:end, part, :2]
            travelled.append(float(np.linalg.norm(stance - np.median(stance, axis=0), axis=1).max()))
    turns = pose_difference(clip.poses[:-1], clip.poses[1:])[:, 3:].reshape(clip.n_frames - 1, -1, 3)
    return BodyContact(
        touched.clearance, touched.supported, np.any(touched.resting, axis=1), max(travelled),
        np.linalg.norm(turns, axis=2).max(axis=1, initial=0.0),
    )  # fmt: skip


def clip_ballistics(
    clip: Clip,
    judging: Judging = JUDGING,
    assumptions: tuple[str, ...] = (),
) -> ClipBallistics:
    """Judge all flights of a clip, and the turns between them; `assumptions` are added to those of the verdict."""
    laps = clip
    if clip.closes():
        laps = Clip(np.vstack([clip.poses, clip.displacement.moved(clip.poses[1:])]), clip.fps, clip.name)
    motion = body_motion(laps)
    flights = judge_flights(motion, judging.tolerance)
    if laps is not clip:
        # A flight that a cut lap begins with is the second half of the one at its end.
        first, last = int(np.argmax(motion.supported)), clip.n_frames - 1
        flights = tuple(flight for flight in flights if first <= flight.fit.start < last)
    bounds = rate_bounds(motion, flights, judging.friction)
    doubts, measures = contact_doubts(body_contact(laps), motion.com, laps.fps, judging.contact)
    verdict = ballistic_verdict(motion, flights, judging.tolerance, doubts, measures)
    if verdict.verdict == "refuted":
        verdict = _with_initial_state(verdict, laps, flights)
    verdict = replace(verdict, assumptions=(*verdict.assumptions, *assumptions))
    turns, inputs = turns_verdict(motion, flights, judging.friction, clip.n_frames), clip_inputs(clip, judging)
    certificate = Certificate({"ballistic": verdict, "turns": turns}, hash_of(inputs), hashes_of(inputs))
    lap = slice(0, clip.n_frames)
    return ClipBallistics(
        clip.duration, laps, motion, flights, RateBounds(bounds.low[lap], bounds.high[lap]), certificate
    )


def _with_initial_state(verdict: Verdict, clip: Clip, flights: tuple[FlightJudgement, ...]) -> Verdict:
    """The counterexample with qpos and qvel of the best take-off, ready for a simulation."""
    fit = next(flight.fit for flight in flights if flight.verdict == "refuted")
    take_off = _played(clip, fit, 1.0)
    state = {"qpos": take_off.flown.poses[0], "qvel": take_off.flown.velocities()[0]}
    return replace(verdict, counterexample={**verdict.counterexample, **state})


class _Played(NamedTuple):
    """A flight as it is recorded, played at a rate, and as a body that really flies would do it."""

    recorded: Clip
    com: Array
    flown: Clip
    distance: float


def _played(clip: Clip, fit: FlightFit, rate: float) -> _Played:
    """Turn and move each pose of a flight as a whole: momentum is constant, and the body falls as best it can."""
    n = round(fit.duration * _FINE) + 1
    times = np.arange(n + _AFTER) * fit.duration / (n - 1)
    recorded = Clip(clip_motion(clip, fit.time + times).poses, rate / float(times[1]), clip.name)
    moved = momentum(recorded)
    distance, (p, v) = best_fall(moved.com[:n], recorded.fps / rate, rate)
    turn = np.tile([1.0, 0.0, 0.0, 0.0], (len(times), 1))
    for k in range(len(times) - 1):
        R = Rotation.from_quat(turn[k], scalar_first=True)
        missing = rate * fit.momentum - R.apply(moved.angular[k])
        spin = R.apply(np.linalg.solve(moved.inertia[k], R.inv().apply(missing)))
        turn[k + 1] = (Rotation.from_rotvec(spin / recorded.fps) * R).as_quat(scalar_first=True)
    poses = recorded.poses.copy()
    t = times[:, None] / rate
    fall = p + v * t - np.array([0.0, 0.0, GRAVITY / 2.0]) * t**2
    poses[:, :3] = fall + quaternions.rotated(turn, poses[:, :3] - moved.com)
    poses[:, 3:7] = quaternions.product(turn, poses[:, 3:7])
    return _Played(recorded, moved.com, Clip(poses, recorded.fps, clip.name), distance)


def fly(clip: Clip, fit: FlightFit, rate: float) -> FlightTrial:
    """Let the physical figure take off as the certificate says and fly a flight of a clip, played at a rate.

    It follows the clip's joints by its own torques; nothing pushes its root.
    """
    played = _played(clip, fit, rate)
    lifted = Clip(played.flown.poses + np.eye(N_POSE)[2] * _LIFT, played.flown.fps, clip.name)
    done = tracked_motion(lifted, fit.duration / rate, TrackingConfig(physics_step=2.5e-4))
    times = done.reference.times
    frames = np.arange(lifted.n_frames) / lifted.fps
    com = CubicSpline(frames, played.com)(times)
    flown = momentum(Clip(done.poses, 1.0 / float(times[1]), clip.name)).com - (0.0, 0.0, _LIFT)
    turn = pose_difference(clip_motion(played.recorded, times).poses, done.poses)[:, 3:6]
    return FlightTrial(
        rate=rate,
        distance=float(np.linalg.norm(flown - com, axis=1).max()),
        predicted=played.distance,
        turn=float(np.linalg.norm(turn, axis=1).max()),
        residual=float(np.abs(done.reports[:, REPORT_RESIDUAL : REPORT_RESIDUAL + 6]).max()),
    )
