"""Experiment that could refute the verdict `turns`: an ideal body tries turns, starts and stops beyond friction.

``python -m experiments.studies.turn_trials CLIP...`` plays clips (embedded, or files) faster than floor friction
allows, and prints the certified bounds beside what happens in MuJoCo.

The body is a mass on a foot that cannot tip: unlimited motors between the two push it along the path of a centre of
mass, so that only the floor limits it. What this body cannot do, no figure can.
"""

import sys
from collections.abc import Mapping
from typing import Any, NamedTuple

import mujoco
import numpy as np
from scipy.interpolate import CubicSpline

from controllers.certificates.flight.ballistic import BodyMotion
from controllers.certificates.flight.tolerance import DEFAULT_CRITERIA
from experiments.flights.ballistics import clip_ballistics
from experiments.setups.parts.clips import load_clips
from geometry.arrays import Array
from geometry.physics import GRAVITY
from models.humanoid.skeleton import DEFAULT_MASS
from models.mocap.motion.clip import Clip

_TIME_STEP = 5e-5  # of the simulation [s]
_FOOT_MASS = 1.0  # mass of the foot [kg], radius of its sole 0.1 m
_NATURAL_FREQUENCY = 60.0  # natural frequency of the mass about its path [rad/s], critically damped
_MAX_LEG_LEAN = 2.0  # largest ratio of sideways to downward push of the leg, more than any friction holds
_FOLLOWING_TOLERANCE = 5e-4  # largest distance at which a path counts as followed [m]
_RATE_FACTOR = 1.35  # multiple of the certified rate at which certified clips are played
_SETTLING_TIME = 0.1  # [s] of rest before the motion, in which the contact settles


class TurnOutcome(NamedTuple):
    """How the mass followed a path.

    Attributes
    ----------
    miss : float
        Largest distance from the path, at its samples [m].
    slid : float
        Largest distance by which the foot slid [m].
    """

    miss: float
    slid: float


def _body_model(friction: float) -> mujoco.MjModel:
    axes = ("1 0 0", "0 1 0", "0 0 1")
    slides = ["".join(f'<joint name="{name}{k}" type="slide" axis="{axis}"/>' for k, axis in enumerate(axes))
              for name in ("foot", "leg")]  # fmt: skip
    motors = "".join(f'<motor joint="leg{k}"/>' for k in range(3))
    return mujoco.MjModel.from_xml_string(f"""
        <mujoco><option timestep="{_TIME_STEP}" gravity="0 0 -{GRAVITY}" cone="elliptic" impratio="100"
                        integrator="implicitfast"/>
        <default><geom friction="{friction} 0 0" solref="0.002 1" condim="3"/></default>
        <worldbody><geom type="plane" size="5 5 1"/>
        <body pos="0 0 0.1">{slides[0]}<geom type="sphere" size="0.1" mass="{_FOOT_MASS}"/>
        <body pos="0 0 0.9">{slides[1]}
        <geom type="sphere" size="0.1" mass="{DEFAULT_MASS - _FOOT_MASS}" contype="0" conaffinity="0"/>
        </body></body></worldbody><actuator>{motors}</actuator></mujoco>""")


def follow(way: Array, fps: float, velocity: Array, friction: float) -> TurnOutcome:
    """Let the mass follow a path from its first point, with an initial velocity.

    Parameters
    ----------
    way : array, shape (n, 3)
        Path of a centre of mass [m].
    fps : float
        Points per second [1/s].
    velocity : array, shape (3,)
        Initial velocity [m/s].
    friction : float
        μ between foot and floor.
    """
    model = _body_model(friction)
    data = mujoco.MjData(model)
    spline = CubicSpline(np.arange(len(way)) / fps, way - way[0])
    speed, acceleration = spline.derivative(1), spline.derivative(2)

    def push(error: Array, slower: Array, wanted: Array) -> None:
        leg = DEFAULT_MASS * (wanted + _NATURAL_FREQUENCY**2 * error + 2.0 * _NATURAL_FREQUENCY * slower)
        leg[2] = max(leg[2] + DEFAULT_MASS * GRAVITY, 0.0)  # the leg does not pull its foot up
        data.ctrl[:2] = leg[:2] * min(1.0, _MAX_LEG_LEAN * leg[2] / max(np.linalg.norm(leg[:2]), 1e-12))
        data.ctrl[2] = leg[2]
        mujoco.mj_step(model, data)

    while data.time < _SETTLING_TIME:
        push(-_centre_of_mass(data.qpos), -_centre_of_mass(data.qvel), np.zeros(3))
    data.time, start, began = 0.0, data.qpos[:2].copy(), _centre_of_mass(data.qpos)
    # The mass alone is set in motion, by as much as the centre of both needs.
    data.qvel[3:] += (velocity - _centre_of_mass(data.qvel)) / _centre_of_mass(np.repeat([0.0, 1.0], 3))
    miss, slid = 0.0, 0.0
    for k in range(len(way)):
        while data.time < k / fps - 1e-9:
            t = data.time
            push(began + spline(t) - _centre_of_mass(data.qpos), speed(t) - _centre_of_mass(data.qvel), acceleration(t))
        miss = max(miss, float(np.linalg.norm(began + way[k] - way[0] - _centre_of_mass(data.qpos))))
        slid = max(slid, float(np.linalg.norm(data.qpos[:2] - start)))
    return TurnOutcome(miss, slid)


def _centre_of_mass(values: Array) -> Array:
    """Centre of mass of foot and mass: its position from joint positions, or its velocity from joint velocities."""
    return values[:3] + values[3:] * (1.0 - _FOOT_MASS / DEFAULT_MASS)


class TurnTrial(NamedTuple):
    """Claim of a counterexample of ``turns`` about a window of frames, and what happens in MuJoCo.

    Attributes
    ----------
    rate, onset : float
        Rate up to which the floor can give the window's mean acceleration: certified, and observed with the mass.
    bound, miss, miss_of_mean : float
        Certified least distance of any body from the window, and distances of the mass from the window and from its
        best parabola [m].
    """

    rate: float
    onset: float
    bound: float
    miss: float
    miss_of_mean: float


def parabola(acceleration: Array, seconds: float, friction: float, rate: float) -> TurnOutcome:
    """Let the mass follow a constant acceleration [m/s²] for `seconds` [s], played at a rate."""
    fps = 100.0 * rate / seconds
    t = np.arange(101.0)[:, None] / fps
    return follow(0.5 * rate**2 * acceleration * t**2, fps, np.zeros(3), friction)


def onset(acceleration: Array, seconds: float, friction: float) -> float:
    """Rate from which the mass misses a constant acceleration, to 0.1 %, between 0.3 and 1.2."""
    low, high = 0.3, 1.2
    while high - low > 1e-3 * low:
        middle = 0.5 * (low + high)
        missed = parabola(acceleration, seconds, friction, middle).miss > _FOLLOWING_TOLERANCE
        low, high = (low, middle) if missed else (middle, high)
    return 0.5 * (low + high)


def trial(motion: BodyMotion, example: Mapping[str, Any], friction: float) -> TurnTrial:
    """Test the claim of a counterexample of the verdict ``turns`` in MuJoCo."""
    path = motion.com[example["start"] : example["end"] + 1]
    seconds, acceleration = (len(path) - 1) / motion.fps, np.asarray(example["acceleration"])
    return TurnTrial(
        rate=example["rate"],
        onset=onset(acceleration, seconds, friction),
        bound=example["distance"],
        miss=follow(path, motion.fps, np.asarray(example["velocity"]), friction).miss,
        miss_of_mean=parabola(acceleration, seconds, friction, 1.0).miss,
    )


def main(names: list[str]) -> None:
    """Print a table of clips."""
    print("| clip | played at | certified up to | missed from | error | misses by at least | misses | its mean |")
    print("|---|---|---|---|---|---|---|---|")
    clips, _ = load_clips(names, raw=True)
    for clip in clips:
        margin = clip_ballistics(clip).certificate.verdicts["turns"].margin or 0.0
        pace = max(1.0, _RATE_FACTOR * float(np.sqrt(1.0 + margin)))
        played = clip_ballistics(Clip(clip.poses, pace * clip.fps, clip.name))
        verdict = played.certificate.verdicts["turns"]
        if verdict.verdict != "refuted":
            print(f"| {clip.name} | {pace:.2f} | {verdict.reason} |")
            continue
        done = trial(played.motion, verdict.counterexample, DEFAULT_CRITERIA.friction)
        print(
            f"| {clip.name} | {pace:.2f} | {done.rate:.3f} | "
            f"{done.onset:.3f} | {100.0 * (done.onset / done.rate - 1.0):+.2f} % | {1e3 * done.bound:.1f} mm | "
            f"{1e3 * done.miss:.0f} mm | {1e3 * done.miss_of_mean:.0f} mm |",
            flush=True,
        )


if __name__ == "__main__":
    main(sys.argv[1:])
