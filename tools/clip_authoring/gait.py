"""Walk and run: published normative joint angles, made feasible by spacetime optimisation.

The sketches are the sagittal hip, knee and ankle angles of normal adults at every 5 % of the cycle, rounded to a few
degrees from published curves: Winter (1991, *The Biomechanics and Motor Control of Human Gait*, natural cadence) and
Perry & Burnfield (2010, *Gait Analysis*) for the walk, Novacheck (1998, "The biomechanics of running", *Gait & Posture*
7) for the run. Pelvis and arms are first harmonics with the amplitudes and phases that those sources describe. To make
the motion feasible, the optimisation changes the path of the pelvis, and joint angles by a few degrees.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from geometry.arrays import Array
from models.humanoid.skeleton import FOOT_CONTACTS, N_TANGENT, soles
from models.mocap.motion.clip import Clip
from tools.clip_authoring.coordinates import coordinate, poses, reflection
from tools.clip_authoring.spacetime import Motion, Stance, Task

FPS = 120.0  # [1/s]
_ACTIVE_DOFS = (
    ("position", "xyz"), ("root", "xyz"), ("abdomen", "xyz"), ("chest", "xyz"), ("head", "xyz"),
    *((f"{side}_{joint}", axes) for side in ("left", "right")
      for joint, axes in (("shoulder", "xyz"), ("elbow", "z"), ("hip", "xyz"), ("knee", "y"), ("ankle", "xy"))),
)  # fmt: skip
_ACTIVE_COLUMNS = [coordinate(joint, axis) for joint, axes in _ACTIVE_DOFS for axis in axes]
# Weights of the distances from the sketch [1/rad], [1/m]: low for the pelvis, which contacts and forces determine.
_TRACKING_WEIGHTS = {
    "position": 0.3, "root": 8.0, "abdomen": 6.0, "chest": 6.0, "head": 10.0, "shoulder": 6.0, "elbow": 6.0,
    "hip": 3.0, "knee": 3.0, "ankle": 3.0,
}  # fmt: skip


@dataclass(frozen=True)
class Gait:
    """A gait's normative curves, in degrees of flexion at 0, 5, …, 95 % of the gait cycle from foot strike.

    Parameters
    ----------
    name : str
        Name of the clip.
    period : float
        Duration of a gait cycle, two steps [s].
    speed : float
        Forward speed [m/s].
    cycles : int
        Number of gait cycles in the clip.
    hip, knee, ankle : tuple of 20 floats
        Flexion of hip and knee, dorsiflexion of the ankle [degrees].
    heel, toe : (float, float)
        Shares of the cycle between which heel and toes are in stance.
    width, splay, apart : float
        Step width [m]; toe-out of each foot [degrees]; hip abduction, with which the legs pass each other [degrees].
    height, tilt : float
        Mean height [m] and forward tilt [degrees] of the pelvis.
    turn, obliquity : float
        Amplitudes of pelvic rotation about the vertical and of pelvic obliquity [degrees].
    lean : float
        Forward lean of the trunk relative to the pelvis [degrees].
    swing : (float, float)
        Shoulder flexion: mean and amplitude [degrees].
    elbow : (float, float)
        Elbow flexion: mean and amplitude [degrees].
    inward : float
        Inward rotation of the upper arms, which brings the forearms in front of the body [degrees].
    lead : float
        Distance of the ankle ahead of the pelvis's mean position at foot strike [m].
    lift : float
        Least foot clearance at mid-swing [m].
    intervals : int
        Knot intervals in half a cycle.
    """

    name: str
    period: float
    speed: float
    cycles: int
    hip: tuple[float, ...]
    knee: tuple[float, ...]
    ankle: tuple[float, ...]
    heel: tuple[float, float]
    toe: tuple[float, float]
    width: float
    splay: float
    apart: float
    height: float
    tilt: float
    turn: float
    obliquity: float
    lean: float
    swing: tuple[float, float]
    elbow: tuple[float, float]
    inward: float
    lead: float
    lift: float
    intervals: int


WALK = Gait(
    name="walk", period=1.1, speed=1.25, cycles=2,
    hip=(22, 21.5, 20, 17, 12.5, 8, 3.5, -1, -5, -8.5, -11, -10.5, -6, 1.5, 9.5, 16.5, 21.5, 24, 24.5, 23.5),
    knee=(5, 10.5, 16.5, 18.5, 17.5, 15, 11.5, 8.5, 6.5, 7, 11, 20, 34, 48.5, 58.5, 61, 55.5, 43, 26.5, 11.5),
    ankle=(0, -5, -4, -0.5, 2.5, 4.5, 6, 7.5, 9, 9.8, 7.5, -2, -14.5, -18.5, -12.5, -5.5, -1, 1.5, 1.5, 0.5),
    heel=(0.0, 0.40), toe=(0.08, 0.62), width=0.11, splay=6.0, apart=0.0,
    height=0.905, tilt=3.0, turn=5.0, obliquity=4.0, lean=0.0, swing=(-3.0, 17.0), elbow=(24.0, 8.0), inward=6.0,
    lead=0.28, lift=0.015, intervals=12,
)  # fmt: skip

RUN = Gait(
    name="run", period=88 / 120, speed=3.0, cycles=3,
    hip=(30, 30, 29, 26, 20, 13, 5, -2, -6, -6, -1, 8, 18, 28, 36, 41, 42, 40, 36, 32),
    knee=(14, 28, 38, 41, 37, 29, 21, 17, 20, 33, 52, 72, 88, 94, 88, 72, 50, 28, 13, 9),
    ankle=(5, 10, 17, 21, 21, 15, 3, -12, -20, -18, -11, -5, -1, 2, 4, 5, 6, 6, 6, 5),
    heel=(0.0, 0.19), toe=(0.03, 0.355), width=0.11, splay=5.0, apart=6.0,
    height=0.89, tilt=8.0, turn=6.0, obliquity=4.0, lean=3.0, swing=(-12.0, 30.0), elbow=(96.0, 10.0), inward=3.0,
    lead=0.27, lift=0.03, intervals=14,
)  # fmt: skip


def _sketch(gait: Gait, phase: Array) -> Array:
    """The 57 coordinates of a gait's curves at phases (m,) of the left foot's cycle (0 to 1), shape (m, 57)."""
    u = np.zeros((len(phase), N_TANGENT))
    wave = np.cos(2 * np.pi * phase)
    u[:, coordinate("position", "z")] = gait.height
    obliquity, turn = np.deg2rad(gait.obliquity) * np.cos(2 * np.pi * (phase - 0.14)), -np.deg2rad(gait.turn) * wave
    u[:, 3:6] = np.stack([obliquity, np.full(len(phase), np.deg2rad(gait.tilt)), turn], axis=1)
    # Abdomen and chest cancel the pelvis's obliquity and counter-rotate the shoulders; the head looks ahead.
    for joint, share in (("abdomen", 0.5), ("chest", 0.5), ("head", 0.0)):
        first = coordinate(joint, "x")
        u[:, first] = -0.9 * share * obliquity
        u[:, first + 1] = share * np.deg2rad(gait.lean)
        u[:, first + 2] = -1.8 * share * turn
    u[:, coordinate("head", "y")] = -np.deg2rad(gait.tilt + gait.lean)
    u[:, coordinate("head", "z")] = 0.8 * turn
    for side, start, sign in (("left", 0.0, 1.0), ("right", 0.5, -1.0)):
        p = (phase + start) % 1.0
        for joint, curve, direction in (("hip", gait.hip, -1), ("knee", gait.knee, 1), ("ankle", gait.ankle, -1)):
            spline = CubicSpline(np.linspace(0, 1, 21), np.deg2rad([*curve, curve[0]]), bc_type="periodic")
            u[:, coordinate(f"{side}_{joint}", "y")] = direction * spline(p)
        u[:, coordinate(f"{side}_hip", "x")] = sign * np.deg2rad(gait.apart)
        u[:, coordinate(f"{side}_hip", "z")] = sign * np.deg2rad(gait.splay)
        swing = -np.cos(2 * np.pi * (p - 0.03))
        flexion = np.deg2rad(gait.swing[0] + gait.swing[1] * swing)
        hanging = Rotation.from_euler("XY", (-78.0, gait.inward), degrees=True)
        arm = Rotation.from_rotvec(np.outer(-flexion, (0, 1, 0))) * hanging
        first = coordinate(f"{side}_shoulder", "x")
        u[:, first : first + 3] = arm.as_rotvec() * (sign, 1.0, sign)
        u[:, coordinate(f"{side}_elbow", "z")] = -sign * np.deg2rad(gait.elbow[0] + gait.elbow[1] * swing)
    return u


def _stances(gait: Gait) -> list[Stance]:
    """All stances of contact spheres that overlap the first half cycle."""
    stances: list[Stance] = []
    for sphere, (name, (x, y, _)) in enumerate(zip(FOOT_CONTACTS, soles(), strict=True)):
        sign = 1.0 if name.startswith("left") else -1.0
        window = gait.heel if "heel" in name else gait.toe
        c, s = np.cos(np.deg2rad(gait.splay)), sign * np.sin(np.deg2rad(gait.splay))
        for strike in np.array([-1.0, 0.0]) + (0.0 if name.startswith("left") else 0.5):
            ankle = strike * gait.period * gait.speed + gait.lead
            place_w = (ankle + c * x - s * y, sign * gait.width / 2 + s * x + c * y)
            start, end = (gait.period * (strike + share) for share in window)
            stances.append(Stance(sphere, start, end, place_w))
    return stances


def task(gait: Gait) -> Task:
    """Half a cycle of a gait, as a task for the spacetime optimisation."""
    frames = 4 * gait.intervals
    phase = 0.5 * np.arange(frames) / frames
    embed = np.eye(N_TANGENT)[:, _ACTIVE_COLUMNS]
    clearance = np.zeros((frames, len(FOOT_CONTACTS)))
    for sphere, name in enumerate(FOOT_CONTACTS):
        p = (phase + (0.0 if name.startswith("left") else 0.5)) % 1.0
        swing_phase = np.clip((p - gait.toe[1]) / (1 - gait.toe[1]), 0, 1)
        clearance[:, sphere] = gait.lift * np.sin(np.pi * swing_phase) ** 2
    tracking = [
        _TRACKING_WEIGHTS[joint.removeprefix("left_").removeprefix("right_")]
        for joint, axes in _ACTIVE_DOFS
        for _ in axes
    ]
    return Task(
        duration=gait.period / 2, intervals=gait.intervals, embed=embed, mirror=embed.T @ reflection() @ embed,
        speed=gait.speed, sketch=_sketch(gait, phase)[:, _ACTIVE_COLUMNS], tracking=np.tile(tracking, (frames, 1)),
        stances=_stances(gait), clearance=clearance,
    )  # fmt: skip


def _clip(gait: Gait) -> Clip:
    motion = Motion(task(gait))
    motion.solve(40)
    frames = round(gait.cycles * gait.period * FPS) + 1
    return Clip(poses(motion.coordinates(np.arange(frames) / FPS)), FPS, gait.name)


def walk() -> Clip:
    """Two strides of a level walk at 1.25 m/s along +x."""
    return _clip(WALK)


def run() -> Clip:
    """Three strides of a run at 3 m/s along +x."""
    return _clip(RUN)


CLIPS: dict[str, Callable[[], Clip]] = {"walk": walk, "run": run}
