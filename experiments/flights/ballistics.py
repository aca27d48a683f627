"""Ballistics of clips: certificates of their flights, and trials in which the physical figure flies them."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from controllers.certificates.flight.ballistic import BodyMotion, FlightJudgement, ballistic_verdict, judge_flights
from controllers.certificates.flight.contact import BodyContact, contact_doubts
from controllers.certificates.flight.flight_fit import FlightFit, find_flights, fit_free_fall
from controllers.certificates.flight.rate_bounds import RateBounds, rate_bounds, turns_verdict
from controllers.certificates.flight.tolerance import DEFAULT_CRITERIA, JudgementCriteria
from controllers.certificates.report import Certificate, Verdict, hash_of, hashes_of
from experiments.files.certificate_files import clip_inputs
from geometry import quaternions
from geometry.arrays import Array, Mask
from geometry.physics import GRAVITY
from models.humanoid.skeleton import N_POSE
from models.mocap.dynamics.contacts import contacts
from models.mocap.dynamics.momentum import momentum
from models.mocap.motion.clip import Clip, pose_difference
from models.mocap.motion.foot_skate import stance_skates
from models.mocap.motion.kinematics import sole_points
from sim.body.clip_motion import clip_motion
from sim.body.figure_state import REPORT_RESIDUAL
from sim.body.tracking import TrackingConfig, tracked_motion

_FLIGHT_HEIGHT = 10.0  # height at which a flight is flown, out of reach of the floor [m]
_FLIGHT_FPS = 480.0  # frame rate at which a flight is flown [1/s]
# Frames after the landing that shape the reference's spline: an end's influence decays by 0.27 a frame, to 3e-5.
_FRAMES_AFTER_LANDING = 8


@dataclass(frozen=True, eq=False)
class ClipBallistics:
    """Flights of a clip and their certificate.

    Attributes
    ----------
    seconds : float
        Duration of the clip [s].
    clip : Clip
        The clip; a closed one is extended by a second lap, so that a flight over the seam is whole.
    motion : BodyMotion
        Its centre of mass, momentum and contacts.
    flights : tuple of FlightJudgement
        Flights that begin in the first lap.
    bounds : RateBounds
        Admissible playback rates of every frame of the first lap.
    certificate : Certificate
        Verdicts ``ballistic`` and ``turns``.
    """

    seconds: float
    clip: Clip
    motion: BodyMotion
    flights: tuple[FlightJudgement, ...]
    bounds: RateBounds
    certificate: Certificate


class FlightTrial(NamedTuple):
    """A flight of the physical figure under gravity alone.

    Attributes
    ----------
    rate : float
        Playback rate σ of the clip.
    distance : float
        Largest distance between the centres of mass of figure and clip [m].
    predicted : float
        The same as predicted by the certificate [m].
    turn : float
        Largest angle between the pelvis of figure and clip [rad].
    residual : float
        Largest component of the residual wrench at the root [N, N m]; zero in a true flight.
    """

    rate: float
    distance: float
    predicted: float
    turn: float
    residual: float


def body_contact(clip: Clip) -> BodyContact:
    """Floor contact and foot skate of a clip, for the certificate's checks of the capture."""
    floor, points = contacts(clip), sole_points(clip.poses)
    skate = float(stance_skates(points, floor.resting[:, : points.shape[1]]).max())
    turns = pose_difference(clip.poses[:-1], clip.poses[1:])[:, 3:].reshape(clip.n_frames - 1, -1, 3)
    return BodyContact(
        floor.clearance, floor.supported, np.any(floor.resting, axis=1), skate,
        np.linalg.norm(turns, axis=2).max(axis=1, initial=0.0),
    )  # fmt: skip


def clip_flights(clip: Clip) -> tuple[tuple[float, float], ...]:
    """Time of the last contact before each flight of a clip and of the first one after it [s].

    For a closed clip, the flights that begin within a lap: one over the seam ends in the next lap.
    """
    laps = _with_second_lap(clip)
    supported = contacts(laps).supported
    found = [span for span in find_flights(supported, laps.fps) if _is_in_first_lap(span[0], clip, supported)]
    return tuple((start / laps.fps, end / laps.fps) for start, end in found)


def _with_second_lap(clip: Clip) -> Clip:
    """The clip; a closed one with a second lap, so that a flight over the seam is whole."""
    return clip.with_next_lap() if clip.closes() else clip


def _is_in_first_lap(start: int, clip: Clip, supported: Mask) -> bool:
    """Whether a flight that starts at a frame begins in the first lap; one before any support began a lap earlier.

    `supported` marks the frames of all laps in which anything bears load.
    """
    return len(supported) == clip.n_frames or int(np.argmax(supported)) <= start < clip.n_frames - 1


def clip_ballistics(
    clip: Clip, criteria: JudgementCriteria = DEFAULT_CRITERIA, assumptions: tuple[str, ...] = ()
) -> ClipBallistics:
    """Certify the flights of a clip, and that friction suffices for its turns outside flights.

    `assumptions` are added to those of the verdict on the flights.
    """
    laps = _with_second_lap(clip)
    floor = contacts(laps)
    motion = BodyMotion(laps.fps, *momentum(laps), floor.clearance, floor.supported)
    judgements = judge_flights(motion, criteria.tolerance)
    flights = tuple(flight for flight in judgements if _is_in_first_lap(flight.fit.start, clip, motion.supported))
    bounds = rate_bounds(motion, flights, criteria.friction)
    doubts, measures = contact_doubts(body_contact(laps), motion.com, laps.fps, criteria.contact)
    verdict = ballistic_verdict(motion, flights, criteria.tolerance, doubts, measures)
    if verdict.verdict == "refuted":
        verdict = _with_initial_state(verdict, laps, flights)
    verdict = replace(verdict, assumptions=(*verdict.assumptions, *assumptions))
    turns, inputs = turns_verdict(motion, flights, criteria.friction, clip.n_frames), clip_inputs(clip, criteria)
    certificate = Certificate({"ballistic": verdict, "turns": turns}, hash_of(inputs), hashes_of(inputs))
    lap = slice(0, clip.n_frames)
    return ClipBallistics(
        clip.duration, laps, motion, flights, RateBounds(bounds.low[lap], bounds.high[lap]), certificate
    )


def _with_initial_state(verdict: Verdict, clip: Clip, flights: tuple[FlightJudgement, ...]) -> Verdict:
    """The verdict with qpos and qvel of the best take-off added to its counterexample, for a simulation."""
    fit = next(flight.fit for flight in flights if flight.verdict == "refuted")
    take_off = _play_flight(clip, fit, 1.0)
    state = {"qpos": take_off.flown.poses[0], "qvel": take_off.flown.velocities()[0]}
    return replace(verdict, counterexample={**verdict.counterexample, **state})


class _PlayedFlight(NamedTuple):
    """A flight as recorded and played at a rate, and the same joint motion in free flight."""

    recorded: Clip
    com: Array
    flown: Clip
    distance: float


def _play_flight(clip: Clip, fit: FlightFit, rate: float) -> _PlayedFlight:
    """Rotate and shift each pose of a flight as a whole, for constant angular momentum and the best-fitting fall."""
    n = round(fit.duration * _FLIGHT_FPS) + 1
    times = np.arange(n + _FRAMES_AFTER_LANDING) * fit.duration / (n - 1)
    recorded = Clip(clip_motion(clip, fit.time + times).poses, rate / float(times[1]), clip.name)
    dynamics = momentum(recorded)
    distance, (p, v) = fit_free_fall(dynamics.com[:n], recorded.fps / rate, rate)
    rotation = np.tile([1.0, 0.0, 0.0, 0.0], (len(times), 1))
    for k in range(len(times) - 1):
        R = Rotation.from_quat(rotation[k], scalar_first=True)
        missing = rate * fit.momentum - R.apply(dynamics.angular[k])
        angular_velocity = R.apply(np.linalg.solve(dynamics.inertia[k], R.inv().apply(missing)))
        rotation[k + 1] = (Rotation.from_rotvec(angular_velocity / recorded.fps) * R).as_quat(scalar_first=True)
    poses = recorded.poses.copy()
    t = times[:, None] / rate
    fall = p + v * t - np.array([0.0, 0.0, GRAVITY / 2.0]) * t**2
    poses[:, :3] = fall + quaternions.rotated(rotation, poses[:, :3] - dynamics.com)
    poses[:, 3:7] = quaternions.product(rotation, poses[:, 3:7])
    return _PlayedFlight(recorded, dynamics.com, Clip(poses, recorded.fps, clip.name), distance)


def fly(clip: Clip, fit: FlightFit, rate: float) -> FlightTrial:
    """Let the physical figure take off as the certificate predicts and perform a flight of a clip, played at a rate.

    It follows the clip's joint angles by its own torques; no force acts at its root.
    """
    flight = _play_flight(clip, fit, rate)
    lifted = Clip(flight.flown.poses + np.eye(N_POSE)[2] * _FLIGHT_HEIGHT, flight.flown.fps, clip.name)
    tracked = tracked_motion(lifted, fit.duration / rate, TrackingConfig(physics_step=2.5e-4))
    times = tracked.reference.times
    frames = np.arange(lifted.n_frames) / lifted.fps
    com = CubicSpline(frames, flight.com)(times)
    flown = momentum(Clip(tracked.poses, 1.0 / float(times[1]), clip.name)).com - (0.0, 0.0, _FLIGHT_HEIGHT)
    turn = pose_difference(clip_motion(flight.recorded, times).poses, tracked.poses)[:, 3:6]
    return FlightTrial(
        rate=rate,
        distance=float(np.linalg.norm(flown - com, axis=1).max()),
        predicted=flight.distance,
        turn=float(np.linalg.norm(turn, axis=1).max()),
        residual=float(np.abs(tracked.reports[:, REPORT_RESIDUAL : REPORT_RESIDUAL + 6]).max()),
    )
