"""Standing jump and backflip: key poses, made feasible by spacetime optimisation.

Both motions are symmetric, so they are described in the sagittal plane. While no foot stands, the optimisation leaves
no force but gravity: the centre of mass moves on a parabola and angular momentum is conserved from push-off, so the
backflip turns as fast as its tuck allows (Yeadon 1990, "The simulation of aerial movement").
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator

from geometry.arrays import Array
from models.humanoid.skeleton import FOOT_CONTACTS, N_TANGENT, soles
from models.mocap.motion.clip import Clip
from tools.clip_authoring.coordinates import coordinate, poses, reflection
from tools.clip_authoring.key_poses import Arm
from tools.clip_authoring.spacetime import Motion, Stance, Task, Weights

FPS = 120.0  # [1/s]
_HALF_HIP_WIDTH = 0.0875  # half the distance of the hips [m]: the feet stand below them
# Symmetric degrees of freedom, with the weights of their distances from the sketch [1/rad], [1/m].
_ACTIVE_DOFS = (
    ("position", "x", 0.3), ("position", "z", 0.3), ("root", "y", 0.5), ("abdomen", "y", 4.0), ("chest", "y", 4.0),
    ("head", "y", 6.0), ("left_clavicle", "x", 8.0), ("left_clavicle", "z", 8.0), ("left_shoulder", "x", 4.0),
    ("left_shoulder", "y", 4.0), ("left_shoulder", "z", 4.0), ("left_elbow", "z", 4.0), ("left_hip", "y", 2.0),
    ("left_knee", "y", 2.0), ("left_ankle", "y", 2.0),
)  # fmt: skip
_ACTIVE_COLUMNS = [coordinate(joint, axis) for joint, axis, _ in _ACTIVE_DOFS]


_ROUGH_WEIGHTS = Weights(force=3.0, moment=6.0, flight=1.0, slip=100.0, depth=50.0, limit=20.0, strain=1.0)


class Key(NamedTuple):
    """A key pose in the sagittal plane; angles in degrees.

    Attributes
    ----------
    time : float
        Time [s].
    hip, knee, ankle : float
        Flexion of hip and knee, dorsiflexion of the ankle.
    pitch : float
        Forward pitch of the pelvis.
    trunk : float
        Flexion of the trunk on the pelvis, shared by abdomen and chest.
    neck : float
        Flexion of the head on the chest.
    arm : Arm
        Both arms.
    place : (float, float)
        x and z of the pelvis [m].
    """

    time: float
    hip: float
    knee: float
    ankle: float
    pitch: float
    trunk: float
    neck: float
    arm: Arm
    place: tuple[float, float]


class Flight(NamedTuple):
    """A motion with one flight, from rest to rest.

    Attributes
    ----------
    name : str
        Name of the clip.
    keys : tuple of Key
        Key poses of the sketch; the motion begins and ends at rest in the first and the last.
    off, down : (float, float)
        Times at which heels and toes leave the floor, and at which they touch down [s].
    travel : float
        Forward displacement of the feet from push-off to landing [m].
    intervals : int
        Knot intervals of the spline.
    weights : Weights
        Weights of all errors but the distance from the sketch.
    """

    name: str
    keys: tuple[Key, ...]
    off: tuple[float, float]
    down: tuple[float, float]
    travel: float
    intervals: int
    weights: Weights


# Arms that hang, and arms that are swung back before a jump.
_HANGING_ARMS = Arm(raised=8, plane=60, elbow=14)
_SWUNG_BACK_ARMS = Arm(raised=48, plane=165, elbow=18)


def _standing_key(time: float, x: float, pitch: float = 0.0) -> Key:
    """A key at rest, upright: knees bent by 6°, pelvis 2 cm ahead of the ankles, so the weight is over the feet."""
    thigh, shank, bend = 0.4244, 0.4362, np.deg2rad(6.0)
    alpha = np.arctan2(shank * np.sin(bend), thigh + shank * np.cos(bend))
    length = thigh * np.cos(alpha) + shank * np.cos(bend - alpha)
    slope = np.arcsin(0.02 / length)
    hip, ankle = np.rad2deg([alpha - slope, bend - alpha + slope])
    return Key(time, hip, 6.0, ankle, pitch, 0.0, 0.0, _HANGING_ARMS, (x + 0.02, 0.068 + length * np.cos(slope)))


JUMP = Flight(
    name="jump",
    keys=(
        _standing_key(0.0, 0.0),
        _standing_key(0.2, 0.0),
        Key(0.66, 88, 92, 28, 28, 18, -25, _SWUNG_BACK_ARMS, (-0.10, 0.62)),
        Key(0.94, 4, 6, -38, 2, -6, -5, Arm(raised=135, plane=12, elbow=20), (0.06, 1.02)),
        Key(1.10, 18, 22, -32, 0, -4, 0, Arm(raised=145, plane=15, elbow=20), (0.14, 1.20)),
        Key(1.25, 40, 34, -12, 4, 4, -4, Arm(raised=105, plane=20, elbow=25), (0.22, 1.18)),
        Key(1.40, 38, 24, -6, 12, 8, -10, Arm(raised=70, plane=25, elbow=25), (0.28, 0.98)),
        Key(1.66, 82, 84, 27, 26, 18, -22, Arm(raised=45, plane=20, elbow=30), (0.22, 0.66)),
        _standing_key(2.2, 0.35),
        _standing_key(2.4, 0.35),
    ),
    off=(0.82, 0.94), down=(1.45, 1.40), travel=0.35, intervals=48, weights=Weights(flight=10.0),
)  # fmt: skip

BACKFLIP = Flight(
    name="backflip",
    keys=(
        _standing_key(0.0, 0.0),
        _standing_key(0.2, 0.0),
        Key(0.66, 84, 90, 28, 26, 16, -20, _SWUNG_BACK_ARMS, (-0.10, 0.63)),
        Key(1.00, -8, 10, -36, -16, -12, -14, Arm(raised=150, plane=12, elbow=12), (-0.02, 1.02)),
        Key(1.15, 75, 80, -25, -75, 10, 5, Arm(raised=100, plane=15, elbow=30), (-0.08, 1.38)),
        Key(1.26, 112, 122, -15, -150, 38, 18, Arm(raised=45, plane=20, elbow=75), (-0.14, 1.50)),
        Key(1.44, 112, 122, -15, -255, 38, 18, Arm(raised=45, plane=20, elbow=75), (-0.20, 1.42)),
        Key(1.57, 65, 60, -15, -315, 18, 0, Arm(raised=60, plane=15, elbow=30), (-0.24, 1.20)),
        Key(1.68, 45, 26, -4, -338, 8, -8, Arm(raised=65, plane=20, elbow=22), (-0.28, 0.98)),
        Key(1.94, 86, 88, 27, -334, 20, -22, Arm(raised=58, plane=20, elbow=25), (-0.34, 0.64)),
        _standing_key(2.5, -0.25, -360.0),
        _standing_key(2.7, -0.25, -360.0),
    ),
    off=(0.90, 1.00), down=(1.73, 1.68), travel=-0.25, intervals=60,
    weights=Weights(force=30.0, moment=60.0, flight=7.0, slip=600.0, depth=800.0, jerk=6e-5),
)  # fmt: skip


def _sketch(keys: tuple[Key, ...], times: Array) -> Array:
    """The 57 coordinates of the key poses, interpolated monotonically at times (m,), shape (m, 57)."""
    u = np.zeros((len(keys), N_TANGENT))
    for row, key in zip(u, keys, strict=True):
        row[0], row[2] = key.place
        angles = np.deg2rad([key.pitch, 0.5 * key.trunk, 0.5 * key.trunk, key.neck, -key.hip, key.knee, -key.ankle])
        joints = ("root", "abdomen", "chest", "head", "left_hip", "left_knee", "left_ankle")
        for joint, angle in zip(joints, angles, strict=True):
            row[coordinate(joint, "y")] = angle
        first = coordinate("left_clavicle", "x")
        row[first : first + 12] = key.arm.rotations().ravel()
    return PchipInterpolator([key.time for key in keys], u)(times)


def _stances(flight: Flight) -> list[Stance]:
    """Contact schedule: both feet stand until push-off and after landing."""
    stances: list[Stance] = []
    for sphere, (name, (x, across, _)) in enumerate(zip(FOOT_CONTACTS, soles(), strict=True)):
        part = int("toe" in name)
        y = across + (_HALF_HIP_WIDTH if name.startswith("left") else -_HALF_HIP_WIDTH)
        stances.append(Stance(sphere, -np.inf, flight.off[part], (x, y)))
        stances.append(Stance(sphere, flight.down[part], np.inf, (x + flight.travel, y)))
    return stances


def task(flight: Flight, weights: Weights) -> Task:
    """The whole motion, from rest to rest, as a task for the spacetime optimisation."""
    frames = 3 * flight.intervals
    duration = flight.keys[-1].time
    columns = np.eye(N_TANGENT)[:, _ACTIVE_COLUMNS]
    embed = np.clip(columns + reflection() @ columns, -1.0, 1.0)
    return Task(
        duration=duration, intervals=flight.intervals, embed=embed, mirror=None, speed=0.0,
        sketch=_sketch(flight.keys, np.arange(frames) * duration / frames)[:, _ACTIVE_COLUMNS],
        tracking=np.tile([cost for _, _, cost in _ACTIVE_DOFS], (frames, 1)), stances=_stances(flight),
        clearance=np.zeros((frames, len(FOOT_CONTACTS))), weights=weights,
    )  # fmt: skip


def _clip(flight: Flight) -> Clip:
    # With the final weights from the start the optimisation ends in poor local minima: a rough solution warm-starts it.
    rough = Motion(task(flight, _ROUGH_WEIGHTS))
    rough.solve(40, 1e-3)
    motion = Motion(task(flight, flight.weights))
    motion.unknowns = rough.unknowns
    motion.solve(150, 1e-6)
    frames = round(flight.keys[-1].time * FPS) + 1
    return Clip(poses(motion.coordinates(np.arange(frames) / FPS)), FPS, flight.name)


def jump() -> Clip:
    """A standing jump 0.35 m forwards, 0.46 s in the air."""
    return _clip(JUMP)


def backflip() -> Clip:
    """A tucked backflip from standing, 0.68 s in the air."""
    return _clip(BACKFLIP)


CLIPS: dict[str, Callable[[], Clip]] = {"jump": jump, "backflip": backflip}
