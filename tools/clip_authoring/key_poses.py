"""Authoring of motions: key poses and footsteps are interpolated to a C² motion of the figure.

The body above the hips is keyed by anatomical angles and interpolated by splines. The feet follow footstep tracks:
exact stances on the floor joined by quintic swings. The legs are solved by closed-form inverse kinematics. Angles of
keys are in degrees, lengths in metres, times in seconds.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cache
from itertools import pairwise

import numpy as np
from scipy.interpolate import BSpline, CubicSpline, make_interp_spline
from scipy.spatial.transform import Rotation

from geometry.arrays import Array
from models.errors import ModelError
from models.humanoid.skeleton import CONTACT_RADIUS, JOINTS, N_POSE, figure_model

# Middle of the toe contacts in the foot's frame [m], about which the heel rises.
_TOE_POSITION = np.array([0.165, 0.0, -0.048])
_HANGING_ARM = Rotation.from_euler("x", -90, degrees=True)  # left arm from the T-pose to hanging, palm inwards
# Hip-to-ankle distance over the leg's length (knee bent by 36 and 5°): exact up to the first, limited to the second.
_REACH_RATIOS = (0.95, 0.999)
_SWING_LIFT = np.array([0.06, np.deg2rad(15)])  # default lift of toes [m] and pitch of the foot in mid-swing


@dataclass(frozen=True)
class Arm:
    """An arm relative to the chest; all zero hangs straight down, palm inwards [degrees].

    Parameters
    ----------
    raised : float
        Elevation of the upper arm: 0 hanging, 90 horizontal, 180 overhead.
    plane : float
        Plane of elevation (ISB): 0 forwards, 90 sideways, negative across the body.
    turn : float
        Inward rotation of the upper arm about its own axis.
    elbow : float
        Flexion of the elbow.
    pronation : float
        Pronation of the forearm: positive turns the palm down when the elbow is bent.
    wrist : float
        Flexion of the hand towards the palm.
    """

    raised: float = 8.0
    plane: float = 70.0
    turn: float = 0.0
    elbow: float = 15.0
    pronation: float = 0.0
    wrist: float = 0.0

    def rotations(self) -> Array:
        """Rotation vectors [rad] of clavicle, shoulder, elbow and wrist of a left arm, shape (4, 3)."""
        raised, plane = np.deg2rad([self.raised, self.plane])
        swing = Rotation.from_rotvec(raised * np.array([np.sin(plane), -np.cos(plane), 0.0]))
        arm = swing * _HANGING_ARM * Rotation.from_euler("y", self.turn, degrees=True)
        # The shoulder girdle moves with the arm: it rises (scapulohumeral rhythm) and protracts.
        lift = 0.2 * max(0.0, self.raised - 30.0)
        reach = -14.0 * np.sin(raised) * np.cos(plane)
        clavicle = Rotation.from_euler("zx", [reach, lift], degrees=True)
        elbow = Rotation.from_euler("ZY", [-self.elbow, self.pronation], degrees=True)
        wrist = Rotation.from_euler("x", -self.wrist, degrees=True)
        return np.array([r.as_rotvec() for r in (clavicle, clavicle.inv() * arm, elbow, wrist)])


@dataclass(frozen=True)
class Key:
    """A key of the body at a time; channels that are None are interpolated between other keys.

    Parameters
    ----------
    t : float
        Time [s].
    x, y, height : float
        Position of the pelvis in the world [m]; 0.9286 is its height with straight legs.
    yaw, lean, tilt : float
        Heading to the left, then pitch forwards and roll to the left of the pelvis [degrees].
    trunk : (bend, side, twist)
        Chest relative to the pelvis: forwards, to the left, to the left [degrees].
    head : (nod, tilt, turn)
        Head relative to the *pelvis*, so that the gaze is steady when the trunk moves: down, left, left [degrees].
    left_arm, right_arm : Arm
        The arms.
    """

    t: float
    x: float | None = None
    y: float | None = None
    height: float | None = None
    yaw: float | None = None
    lean: float | None = None
    tilt: float | None = None
    trunk: tuple[float, float, float] | None = None
    head: tuple[float, float, float] | None = None
    left_arm: Arm | None = None
    right_arm: Arm | None = None


@dataclass(frozen=True)
class Step:
    """A foot's pose at a time: between two resting steps in one place is a stance, in two places a swing.

    Parameters
    ----------
    t : float
        Time [s].
    x, y : float
        Position of the ankle when the foot lies flat [m].
    z : float
        Height of the sole at the toes [m].
    yaw, pitch, roll : float
        Heading to the left; heel up about the toes; roll [degrees].
    knee : float
        Angle by which the knee points outwards from the mean heading of foot and pelvis [degrees].
    rest : bool
        Whether the foot has no velocity and no acceleration here.
    """

    t: float
    x: float
    y: float
    z: float = 0.0
    yaw: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0
    knee: float = 0.0
    rest: bool = True

    @classmethod
    def in_air(
        cls, t: float, ankle: tuple[float, float, float], yaw: float = 0.0, pitch: float = 0.0, knee: float = 0.0
    ) -> "Step":
        """A step in the air, as in kicks: the foot passes through a position of the ankle [m] without resting."""
        heading = Rotation.from_euler("z", yaw, degrees=True)
        toe = np.array(ankle) + (heading * Rotation.from_euler("y", pitch, degrees=True)).apply(_TOE_POSITION)
        x, y, z = toe - heading.apply([_TOE_POSITION[0], 0.0, CONTACT_RADIUS])
        return cls(t, float(x), float(y), float(z), yaw, pitch, 0.0, knee, rest=False)


@dataclass(frozen=True)
class Lap:
    """Displacement [m] and change of heading [degrees] of the figure in one lap of a cyclic motion."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0


@dataclass(frozen=True)
class Choreography:
    """A motion given by keys and footsteps.

    Parameters
    ----------
    name : str
        Name of the clip.
    duration : float
        Duration [s]; of one lap, if it is cyclic.
    keys : sequence of Key
        Body keys; every channel must be keyed at least once. Cyclic motions need times within one duration.
    left_foot, right_foot : sequence of Step
        Footstep tracks, with at least one resting step each.
    lap : Lap or None
        Displacement of one lap of a cyclic motion; None for a motion that starts and ends at rest.
    """

    name: str
    duration: float
    keys: Sequence[Key]
    left_foot: Sequence[Step]
    right_foot: Sequence[Step]
    lap: Lap | None = None


def _check_times(choreography: Choreography, what: str, times: Array) -> None:
    """Refuse times that do not increase or, in a cyclic motion, span a whole lap or more."""
    if np.any(np.diff(times) <= 0) or (choreography.lap is not None and np.ptp(times) >= choreography.duration):
        raise ModelError(
            f"{choreography.name}: {what} at {times.tolist()} s; times must increase and those of a cyclic motion span "
            f"less than its duration of {choreography.duration} s"
        )


def _from_rest_to_rest(times: Array, values: Array) -> BSpline:
    """Quintic spline through values (n, k) with zero velocity and acceleration at both ends."""
    at_rest = [(1, np.zeros(values.shape[1])), (2, np.zeros(values.shape[1]))]
    return make_interp_spline(times, values, k=5, bc_type=(at_rest, at_rest))


def _channel(choreography: Choreography, name: str, t: Array) -> Array:
    """One channel of the keys, shape (n, k): a periodic cubic spline, or a quintic one that starts and ends at rest."""
    keyed = [(key.t, getattr(key, name)) for key in choreography.keys if getattr(key, name) is not None]
    if not keyed:
        raise ModelError(f"{choreography.name}: no key sets {name}; set it at least once")
    times = np.array([time for time, _ in keyed])
    _check_times(choreography, f"keys of {name}", times)
    values = np.array(
        [value.rotations().ravel() if isinstance(value, Arm) else value for _, value in keyed], dtype=float
    )
    values = values.reshape(len(times), -1)
    if name in ("trunk", "head"):
        forwards, left, turn = values.T
        values = Rotation.from_euler("ZYX", np.stack([turn, forwards, -left], axis=1), degrees=True).as_rotvec()
    elif name in ("yaw", "lean", "tilt"):
        values = np.deg2rad(values)
    if choreography.lap is None:
        if len(times) == 1:
            return np.tile(values, (len(t), 1))
        return _from_rest_to_rest(times, values)(np.clip(t, times[0], times[-1]))
    per_lap = getattr(choreography.lap, name, 0.0)
    pace = (np.deg2rad(per_lap) if name == "yaw" else per_lap) / choreography.duration
    closed = np.vstack([values - pace * (times - times[0])[:, None], values[:1]])
    times = np.append(times, times[0] + choreography.duration)
    spline = CubicSpline(times, closed, bc_type="periodic", extrapolate="periodic")
    return spline(t) + pace * (t - times[0])[:, None]


_STEP_CHANNELS = tuple(f.name for f in fields(Step) if f.name not in ("t", "rest"))


def _foot_track(choreography: Choreography, side: str, t: Array) -> Array:
    """Track of a foot as (x, y, z, yaw, pitch, roll, knee) [m, rad], shape (n, 7).

    Quintic splines between resting steps have zero velocity and acceleration there, so the track is C², and exactly
    constant in stance. A swing without steps in between is lifted by `_SWING_LIFT`, heel first.
    """
    steps: Sequence[Step] = getattr(choreography, f"{side}_foot")
    rests = [i for i, step in enumerate(steps) if step.rest]
    times = np.array([step.t for step in steps])
    _check_times(choreography, f"steps of the {side} foot", times)
    if not rests:
        raise ModelError(f"{choreography.name}: no step of the {side} foot rests; let it rest at least once")
    values = np.array([[getattr(step, name) for name in _STEP_CHANNELS] for step in steps], dtype=float)
    values[:, 3:] = np.deg2rad(values[:, 3:])
    laps = np.zeros(len(t))
    if choreography.lap is not None:
        lap = np.array([choreography.lap.x, choreography.lap.y, 0, np.deg2rad(choreography.lap.yaw), 0, 0, 0])
        first = rests[0]
        times = np.concatenate([times[first:], times[: first + 1] + choreography.duration])
        values = np.vstack([values[first:], values[: first + 1] + lap])
        rests = [*(i - first for i in rests), len(times) - 1]
        laps = np.floor((t - times[0]) / choreography.duration)
        t = t - laps * choreography.duration
        track = laps[:, None] * lap
    else:
        track = np.zeros((len(t), len(_STEP_CHANNELS)))
        t = np.clip(t, times[rests[0]], times[rests[-1]])
    segment = np.clip(np.searchsorted(times[rests], t, side="right") - 1, 0, max(len(rests) - 2, 0))
    if len(rests) == 1:
        return track + values[rests[0]]
    for k, (i, j) in enumerate(pairwise(rests)):
        knot_times, knot_poses = times[i : j + 1], values[i : j + 1]
        if j == i + 1 and np.any(knot_poses[0, :2] != knot_poses[1, :2]):
            via = knot_poses.mean(axis=0)
            via[[2, 4]] += _SWING_LIFT
            knot_times, knot_poses = np.insert(knot_times, 1, knot_times.mean()), np.insert(knot_poses, 1, via, axis=0)
        in_segment = segment == k
        track[in_segment] += _from_rest_to_rest(knot_times, knot_poses)(t[in_segment])
    return track


@cache
def _leg_geometry() -> tuple[Array, float, float]:
    """Position of the left hip in the pelvis, and lengths of thigh and shank [m], of the figure at default stature."""
    model = figure_model()
    return model.body("left_thigh").pos, -model.body("left_shank").pos[2], -model.body("left_foot").pos[2]


def solve_leg(
    side: str, root: Array, pelvis: Rotation, ankle: Array, foot: Rotation, knee: Array
) -> tuple[Rotation, Rotation, Rotation]:
    """Closed-form inverse kinematics of a leg; the knee axis is as near as possible to lateral in pelvis and foot.

    Parameters
    ----------
    side : {"left", "right"}
        Which leg.
    root, ankle : array, shape (n, 3)
        Origins of pelvis and foot in the world [m]. The distance of an ankle out of reach saturates smoothly.
    pelvis, foot : Rotation
        Orientations of pelvis and foot in the world, n each.
    knee : array, shape (n,)
        Angle by which the knee points outwards [rad].

    Returns
    -------
    tuple of Rotation
        Rotations of hip, knee and ankle, each in its parent's frame.
    """
    sign = 1.0 if side == "left" else -1.0
    offset, a, b = _leg_geometry()
    hip_to_ankle = ankle - root - pelvis.apply(offset * [1.0, sign, 1.0])
    distance = np.linalg.norm(hip_to_ankle, axis=1)
    u = hip_to_ankle / distance[:, None]
    soft, hard = _REACH_RATIOS[0] * (a + b), _REACH_RATIOS[1] * (a + b)
    excess = np.maximum(distance - soft, 0.0) / (hard - soft)
    # x / (1 + x³)^(1/3) agrees with x up to the second derivative at 0, so the saturation is C².
    d = np.where(excess > 0, soft + (hard - soft) * excess / np.cbrt(1 + excess**3), distance)
    sideways = pelvis.apply([0.0, 1.0, 0.0]) + foot.apply([0.0, 1.0, 0.0])
    sideways = Rotation.from_rotvec(np.outer(sign * knee, [0.0, 0.0, 1.0])).apply(sideways)
    axis = sideways - np.sum(sideways * u, axis=1, keepdims=True) * u
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    at_hip = np.arccos((a * a + d * d - b * b) / (2 * a * d))
    at_knee = np.pi - np.arccos((a * a + b * b - d * d) / (2 * a * b))
    thigh_z = -Rotation.from_rotvec(-at_hip[:, None] * axis).apply(u)
    thigh = Rotation.from_matrix(np.stack([np.cross(axis, thigh_z), axis, thigh_z], axis=2))
    shin = Rotation.from_rotvec(np.outer(at_knee, [0.0, 1.0, 0.0]))
    return pelvis.inv() * thigh, shin, (thigh * shin).inv() * foot


def poses_at(choreography: Choreography, t: Array, sway: Array | None = None) -> Array:
    """Poses of a choreography.

    Parameters
    ----------
    choreography : Choreography
        The motion.
    t : array, shape (n,)
        Times [s].
    sway : array, shape (n, 2), optional
        Added to x and y of the pelvis [m]; see `tools.clip_authoring.balance`.

    Returns
    -------
    array, shape (n, 75)
        MuJoCo's qpos; the signs of the quaternions are left to `Clip`.

    Raises
    ------
    ModelError
        If a channel is never keyed or times do not increase.
    """
    channel = {f.name: _channel(choreography, f.name, t) for f in fields(Key) if f.name != "t"}
    root = np.hstack([channel["x"], channel["y"], channel["height"]])
    if sway is not None:
        root[:, :2] += sway
    pelvis = Rotation.from_euler("ZYX", np.hstack([channel["yaw"], channel["lean"], -channel["tilt"]]))
    half_trunk, look = Rotation.from_rotvec(channel["trunk"] / 2), Rotation.from_rotvec(channel["head"])
    neck = (half_trunk * half_trunk).inv() * look
    joints: dict[str, Rotation] = {"abdomen": half_trunk, "chest": half_trunk, "head": neck}
    for side, mirror in (("left", np.ones(3)), ("right", np.array([-1.0, 1.0, -1.0]))):
        arm = channel[f"{side}_arm"].reshape(-1, 4, 3) * mirror
        for i, joint in enumerate(("clavicle", "shoulder", "elbow", "wrist")):
            joints[f"{side}_{joint}"] = Rotation.from_rotvec(arm[:, i])
        track = _foot_track(choreography, side, t)
        heading = Rotation.from_rotvec(track[:, 3:4] * [0.0, 0.0, 1.0])
        foot = Rotation.from_euler("ZYX", track[:, 3:6])
        toe = track[:, :3] + heading.apply([_TOE_POSITION[0], 0.0, CONTACT_RADIUS])
        leg = solve_leg(side, root, pelvis, toe - foot.apply(_TOE_POSITION), foot, track[:, 6])
        joints.update(zip((f"{side}_hip", f"{side}_knee", f"{side}_ankle"), leg, strict=True))
    poses = np.empty((len(t), N_POSE))
    poses[:, :3] = root
    for k, rotation in enumerate((pelvis, *(joints[name] for name in JOINTS))):
        poses[:, 3 + 4 * k : 7 + 4 * k] = rotation.as_quat(scalar_first=True)
    return poses
