"""The figure's skeleton: the single definition of its segments and joints, their order, masses, limits and motors.

A pose is MuJoCo's qpos: root position (3), root quaternion wxyz (4), then 17 unit quaternions = 75 numbers. A tangent
is MuJoCo's qvel: root velocity in the world (3), root angular velocity in the root frame (3), then 17 angular
velocities, each in the frame of its own segment = 57 numbers. In the rest pose (T-pose, facing +x, left = +y, z up)
every segment's frame is parallel to the world: a segment's global orientation *is* its rotation from rest.
"""

import copy
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from numbers import Real
from typing import NamedTuple

import mujoco
import numpy as np
import numpy.typing as npt

from models.errors import ModelError

Pose = npt.NDArray[np.float64]

# Near de Leva's mean male subject, of 1.741 m and 73.0 kg.
DEFAULT_STATURE = 1.75  # [m]
DEFAULT_MASS = 75.0  # [kg]


class Segment(NamedTuple):
    """A body of the figure and the joint that moves it.

    Attributes
    ----------
    body, joint : str
        Names in the compiled model; the joint of the pelvis is the free joint ``root``.
    parent : int
        Index into `SEGMENTS`; −1 for the pelvis.
    mass : float
        Share of the body's mass (de Leva 1996, table 4, males).
    length : float
        Length on which the two ratios below are based, as a share of stature (table 4, divided by 1.741 m).
    com : tuple of float
        Centre of mass in the segment's frame as a share of stature (left side for paired segments).
    gyration : tuple of float
        Radii of gyration about the centre of mass along the frame's x, y, z, as a share of `length`.
    limit : tuple of three (float, float)
        Range of the joint's rotation vector, component by component [rad] (left side; `joint_range` mirrors it).
    torque : tuple of float
        Largest torque about each axis of the segment's frame [N m] at the default stature and mass.
    """

    body: str
    joint: str
    parent: int
    mass: float
    length: float
    com: tuple[float, float, float]
    gyration: tuple[float, float, float]
    limit: tuple[tuple[float, float], tuple[float, float], tuple[float, float]]
    torque: tuple[float, float, float]


def _deg(*ranges: tuple[float, float]) -> tuple[tuple[float, float], tuple[float, float], tuple[float, float]]:
    x, y, z = ((np.deg2rad(low), np.deg2rad(high)) for low, high in ranges)
    return x, y, z


_UNLIMITED = ((-np.pi, np.pi), (-np.pi, np.pi), (-np.pi, np.pi))
_H = 1.741  # stature of de Leva's mean male subject [m]


def _arm(side: str, first: int) -> tuple[Segment, ...]:
    """Clavicle to hand of the left arm, named for a side; `first` is the clavicle's index in `SEGMENTS`."""
    return (
        Segment(f"{side}_clavicle", f"{side}_clavicle", 2, 0.01, 0.16 / _H, (-0.008, 0.05, -0.006), (0.2, 0.3, 0.3),
                _deg((-20, 45), (-20, 20), (-30, 30)), (120, 80, 120)),
        Segment(f"{side}_upper_arm", f"{side}_shoulder", first, 0.0271, 0.2817 / _H, (0, 0.5772 * 0.2817 / _H, 0),
                (0.285, 0.158, 0.269), _deg((-120, 120), (-120, 120), (-150, 80)), (100, 70, 100)),
        Segment(f"{side}_forearm", f"{side}_elbow", first + 1, 0.0162, 0.2689 / _H, (0, 0.4574 * 0.2689 / _H, 0),
                (0.276, 0.121, 0.265), _deg((-70, 70), (-100, 100), (-155, 10)), (60, 30, 80)),
        Segment(f"{side}_hand", f"{side}_wrist", first + 2, 0.0061, 0.0862 / _H, (0, 0.79 * 0.0862 / _H, 0),
                (0.628, 0.401, 0.513), _deg((-80, 80), (-40, 40), (-45, 45)), (20, 15, 20)),
    )  # fmt: skip


def _leg(side: str, first: int) -> tuple[Segment, ...]:
    """Thigh to foot of the left leg, named for a side; `first` is the thigh's index in `SEGMENTS`."""
    return (
        Segment(f"{side}_thigh", f"{side}_hip", 0, 0.1416, 0.4222 / _H, (0, 0, -0.4095 * 0.4222 / _H),
                (0.329, 0.329, 0.149), _deg((-40, 70), (-140, 45), (-60, 70)), (250, 350, 130)),
        Segment(f"{side}_shank", f"{side}_knee", first, 0.0433, 0.434 / _H, (0, 0, -0.4459 * 0.434 / _H),
                (0.255, 0.249, 0.103), _deg((-15, 15), (-5, 160), (-30, 30)), (300, 350, 150)),
        Segment(f"{side}_foot", f"{side}_ankle", first + 1, 0.0137, 0.2581 / _H, (0.034, 0, -0.022),
                (0.124, 0.245, 0.257), _deg((-40, 40), (-40, 65), (-40, 40)), (120, 300, 100)),
    )  # fmt: skip


def _mirror(segment: Segment) -> Segment:
    """Reflect in the x–z plane: rotations about x and z change sign."""
    (x_low, x_high), y_limit, (z_low, z_high) = segment.limit
    x, y, z = segment.com
    return segment._replace(com=(x, -y, z), limit=((-x_high, -x_low), y_limit, (-z_high, -z_low)))


# The trunk's masses keep de Leva's sum (43.46 %): the clavicles' 2 % are taken from the upper trunk.
SEGMENTS: tuple[Segment, ...] = (
    Segment("pelvis", "root", -1, 0.1117, 0.1457 / _H, (0, 0, 0.3885 * 0.1457 / _H), (0.615, 0.551, 0.587),
            _UNLIMITED, (0, 0, 0)),
    Segment("abdomen", "abdomen", 0, 0.1633, 0.2155 / _H, (0.003, 0, 0.0565), (0.482, 0.383, 0.468),
            _deg((-35, 35), (-30, 65), (-40, 40)), (200, 300, 150)),
    Segment("chest", "chest", 1, 0.1396, 0.2421 / _H, (0, 0, 0.062), (0.505, 0.32, 0.465),
            _deg((-35, 35), (-30, 50), (-45, 45)), (200, 300, 150)),
    Segment("head", "head", 2, 0.0694, 0.2429 / _H, (0.008, 0, 0.069), (0.303, 0.315, 0.261),
            _deg((-50, 50), (-65, 65), (-80, 80)), (50, 60, 40)),
    *_arm("left", 4),
    *(_mirror(segment) for segment in _arm("right", 8)),
    *_leg("left", 12),
    *(_mirror(segment) for segment in _leg("right", 15)),
)  # fmt: skip

BODIES: tuple[str, ...] = tuple(segment.body for segment in SEGMENTS)
JOINTS: tuple[str, ...] = tuple(segment.joint for segment in SEGMENTS[1:])
N_JOINTS = len(JOINTS)
N_POSE = 7 + 4 * N_JOINTS
N_TANGENT = 6 + 3 * N_JOINTS
FOOT_CONTACTS: tuple[str, ...] = tuple(
    f"{side}_{place}" for side in ("left", "right") for place in ("heel_out", "heel_in", "toe_out", "toe_in")
)
HAND_CONTACTS: tuple[str, ...] = ("left_palm", "right_palm")
_MAX_LIMITED_ANGLE = np.deg2rad(175.0)  # just below 180°, where the rotation vector of a joint jumps to its opposite
CONTACT_RADIUS = 0.02  # radius of the contact spheres at the default stature [m]


def joint_range() -> npt.NDArray[np.float64]:
    """Limits of the joints' rotation vectors [rad], shape (17, 3, 2), in the order of `JOINTS`."""
    return np.array([segment.limit for segment in SEGMENTS[1:]])


def torque_limit(stature: float = DEFAULT_STATURE, mass: float = DEFAULT_MASS) -> npt.NDArray[np.float64]:
    """Largest torque of the 51 motors [N m], shape (51,), proportional to mass × stature."""
    scale = mass * stature / (DEFAULT_MASS * DEFAULT_STATURE)
    return scale * np.array([segment.torque for segment in SEGMENTS[1:]], dtype=np.float64).ravel()


def rest_pose(stature: float = DEFAULT_STATURE) -> Pose:
    """The T-pose with the soles on the floor, shape (75,); raises `ModelError` unless 0 < stature < ∞."""
    if not (isinstance(stature, Real) and 0.0 < stature < np.inf):
        raise ModelError(f"stature is {stature!r}; expected more than 0 m, and finite")
    pose = np.zeros(N_POSE)
    pose[3::4] = 1.0
    pose[2] = 0.9286 * stature / DEFAULT_STATURE
    return pose


@dataclass(frozen=True)
class Inertia:
    """Mass [kg], centre of mass [m] and principal inertia [kg m²] of a segment, in its own frame."""

    mass: float
    com: npt.NDArray[np.float64]
    principal: npt.NDArray[np.float64]


def segment_inertia(segment: Segment, stature: float, mass: float) -> Inertia:
    """De Leva's inertia of a segment: I_k = m (r_k l)² about each axis k of the segment's frame."""
    m = segment.mass * mass
    radii = np.array(segment.gyration) * segment.length * stature
    return Inertia(m, np.array(segment.com) * stature, m * radii**2)


def figure_spec(stature: float = DEFAULT_STATURE, mass: float = DEFAULT_MASS) -> mujoco.MjSpec:
    """The figure as an editable MuJoCo model, scaled to a stature and a mass.

    Parameters
    ----------
    stature : float
        Height [m], 0.5 to 2.5.
    mass : float
        Body mass [kg], 5 to 250.

    Raises
    ------
    ModelError
        If either is outside its interval.
    """
    if not 0.5 <= stature <= 2.5:
        raise ModelError(f"stature is {stature} m; it must lie between 0.5 and 2.5 m")
    if not 5.0 <= mass <= 250.0:
        raise ModelError(f"mass is {mass} kg; it must lie between 5 and 250 kg")
    spec = mujoco.MjSpec.from_string(files("models.humanoid").joinpath("humanoid.xml").read_text(encoding="utf-8"))
    scale = stature / DEFAULT_STATURE
    for geom in spec.geoms:
        geom.pos, geom.size, geom.fromto = geom.pos * scale, geom.size * scale, geom.fromto * scale
    limits = torque_limit(stature, mass).reshape(N_JOINTS, 3)
    for segment in SEGMENTS:
        body = spec.body(segment.body)
        inertia = segment_inertia(segment, stature, mass)
        body.pos = body.pos * scale
        body.explicitinertial = True
        body.mass, body.ipos, body.inertia = inertia.mass, inertia.com, inertia.principal
    for segment, limit in zip(SEGMENTS[1:], limits, strict=True):
        _add_angle_limit(spec.joint(segment.joint), segment)
        for axis, name in enumerate("xyz"):
            gear = [float(axis == k) for k in range(3)] + [0.0, 0.0, 0.0]
            spec.add_actuator(
                name=f"{segment.joint}_{name}", target=segment.joint, trntype=mujoco.mjtTrn.mjTRN_JOINT, gear=gear,
                ctrllimited=True, ctrlrange=(-limit[axis], limit[axis]),
            )  # fmt: skip
    return spec


def proportion(figure: mujoco.MjModel) -> float:
    """Scale of lengths in a figure's model (`figure_model`), relative to the default stature [1]."""
    return float(figure.geom(FOOT_CONTACTS[0]).size[0]) / CONTACT_RADIUS


def standing_com(stature: float = DEFAULT_STATURE, mass: float = DEFAULT_MASS) -> float:
    """Height of the figure's centre of mass above the floor in the rest pose [m]."""
    model = figure_model(stature, mass)
    data = mujoco.MjData(model)
    data.qpos[:] = rest_pose(stature)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return float(data.subtree_com[0, 2])


def _add_angle_limit(joint: mujoco.MjsJoint, segment: Segment) -> None:
    """Limit a ball joint to the largest angle that its box of limits contains, if that is less than half a turn.

    MuJoCo's ball joints have a single limit, of the total angle of rotation: that of the corner of `Segment.limit`.
    """
    angle = float(np.linalg.norm(np.abs(segment.limit).max(axis=1)))
    if angle < _MAX_LIMITED_ANGLE:
        joint.limited, joint.range = mujoco.mjtLimited.mjLIMITED_TRUE, np.array([0.0, angle])


def soles() -> npt.NDArray[np.float64]:
    """Centres of `FOOT_CONTACTS` in the frames of their feet, of the default figure, shape (8, 3) [m]."""
    model = figure_model()
    return np.array([model.geom(name).pos for name in FOOT_CONTACTS])


def figure_model(stature: float = DEFAULT_STATURE, mass: float = DEFAULT_MASS) -> mujoco.MjModel:
    """The figure alone, compiled: for kinematics, centre of mass and inverse dynamics away from the world.

    Every call returns a copy of a cached model: compiling takes ten times as long, and reading a clip needs ten models.
    """
    return copy.copy(_compile(stature, mass))


@lru_cache(maxsize=16)
def _compile(stature: float, mass: float) -> mujoco.MjModel:
    return figure_spec(stature, mass).compile()
