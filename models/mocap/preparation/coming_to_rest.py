r"""Coming to rest at an end of an open clip: by a decay of its velocities, or by a last step of a walking body."""

from typing import Literal

import numpy as np

from geometry import quaternions
from geometry.arrays import Array, rms
from geometry.easing import smooth_steps
from models.humanoid.skeleton import BODIES, CONTACT_RADIUS, JOINTS
from models.mocap.motion.clip import pose_difference
from models.mocap.motion.kinematics import global_rotations, sole_points
from models.mocap.motion.ranges import beyond_ranges
from models.mocap.preparation.bounds import MAX_END_SPEED, MAX_SOLE_HEIGHT, MIN_SOLE_HEIGHT
from models.mocap.preparation.poses import add_tangents

# Time in which limbs come to rest at an end [s]: if it is longer, they exceed their joint limits. For the root it grows
# with the speed [s per m/s], up to a maximum [s].
REST_TIME = 0.35
_REST_TIME_PER_SPEED, _MAX_REST_TIME = 0.2, 0.8
# A body walks at an end if its root is faster than this [m/s], its chest tilts by less than this, and its lower foot is
# below this [m].
_MIN_WALKING_SPEED, _MIN_WALKING_COSINE, _MAX_SUPPORT_HEIGHT = 0.3, np.cos(np.deg2rad(30.0)), 0.05
# Time in which a walking body comes to stand [s]. A run that is cut anywhere has a residual of 3.6 % of weight; with
# 0.6 s 7.2 %, with 1.3 s 2.9 %, and its root is 13 cm lower, not 6. Two walks differ by 1.0 points and 0.7° at most.
_STOP_TIME = 0.9
# Flexion of the hip in the last step, and half of the knee's [rad]: the foot clears the floor.
_STEP_FLEXION = np.deg2rad(30.0)
# How far a joint may exceed its range as it comes to rest [rad], and how often its time is halved, down to 0.01 s.
_RANGE_TOLERANCE, _MAX_HALVINGS = np.deg2rad(1.0), 6

Ending = Literal["step", "decay", "limited decay"]


def come_to_rest(pose: Array, velocity: Array, fps: float, ending: Ending) -> Array:
    """Poses in which a velocity decays as (1 − x)² (1 + 2x), x = t/T, while the soles come down to the floor.

    T grows with the root's speed for the root only: with a longer T, limbs would exceed their joint limits. In a
    limited decay a joint that would still leave its range, as by noise in a first frame, gets half of T, a quarter, ….
    A walking body takes a last step instead, if the ending is a step. There are no poses if it stands at rest already:
    prepared again, a clip would otherwise last longer each time.
    """
    if _stands_at_rest(pose, velocity):
        return pose[None, :][:0]
    if ending == "step" and _walks(pose, velocity):
        return _step_to_stand(pose, velocity, fps)
    longest = np.minimum(REST_TIME + _REST_TIME_PER_SPEED * float(np.linalg.norm(velocity[:2])), _MAX_REST_TIME)
    times = np.repeat((longest, REST_TIME), (3, len(velocity) - 3))
    allowed = np.maximum(beyond_ranges(pose[None])[0], 0.0) + _RANGE_TOLERANCE
    for _ in range(_MAX_HALVINGS if ending == "limited decay" else 0):
        times[6:] /= 1.0 + np.repeat(beyond_ranges(_decay(pose, velocity, times, fps)).max(axis=0) > allowed, 3)
    poses = _decay(pose, velocity, times, fps)
    x = np.arange(1, len(poses) + 1) / (fps * longest)
    low = sole_points(poses)[:, :, 2].min(axis=1) - CONTACT_RADIUS
    poses[:, 2] -= smooth_steps(x) * low
    return poses


def _stands_at_rest(pose: Array, velocity: Array) -> bool:
    """Whether joints and root are slow, and both soles flat on the floor.

    Joints of the nine open clips among the 28 captures of docs/validation/prepared-captures.md, as prepared, end with
    0.10 rad/s at most, RMS, and their roots with 0.26 rad/s or m/s.
    """
    heights = sole_points(pose[None])[0, :, 2] - CONTACT_RADIUS
    flat = heights.min() >= MIN_SOLE_HEIGHT and heights.max() <= MAX_SOLE_HEIGHT
    slow = rms(velocity[6:]) <= 0.5 * MAX_END_SPEED and np.abs(velocity[:6]).max() <= MAX_END_SPEED
    return bool(flat and slow)


def _decay(pose: Array, velocity: Array, times: Array, fps: float) -> Array:
    """Poses over the longest of the times T (57,) [s], each component of the velocity decaying over its own time."""
    frames = np.arange(1, round(times.max() * fps) + 1)
    return add_tangents(np.repeat(pose[None], len(frames), axis=0), _decayed(frames / fps, times) * velocity)


def _decayed(time: Array, times: Array) -> Array:
    """Displacement per unit of a velocity that decays over T (57,), at the times (n,): (n, 57) [s]."""
    x = np.minimum(time[:, None] / times, 1.0)
    return (x - x**3 + x**4 / 2.0) * times


def _walks(pose: Array, velocity: Array) -> bool:
    """Whether the body is upright, moves over the floor, and has a foot there."""
    upright = quaternions.rotated(global_rotations(pose[None])[0, BODIES.index("chest")], np.array([0.0, 0.0, 1.0]))[2]
    height = sole_points(pose[None])[0, :, 2].min() - CONTACT_RADIUS
    speed = np.hypot(*velocity[:2])
    return bool(speed > _MIN_WALKING_SPEED and upright > _MIN_WALKING_COSINE and height < _MAX_SUPPORT_HEIGHT)


def _step_to_stand(pose: Array, velocity: Array, fps: float) -> Array:
    r"""Poses in which a walking body stands still on its lower foot and puts the other one beside it.

    Pelvis, spine and legs go from their rotations q₀ to those q₁ of standing, with the velocity at first:

    .. math:: q(t) = q_0 \exp(S(x) \log(q_0^{-1} q_1) + T\,(x - 6x^3 + 8x^4 - 3x^5)\,\omega), \quad x = t/T

    with the smooth step S. The hip and twice as much the knee of the stepping leg bend between. The lower foot carries
    the root, but for the difference of its velocity, which decays likewise. Head and arms come to rest by themselves.
    """
    n = round(_STOP_TIME * fps)
    x = np.arange(1, n + 1)[:, None] / n
    standing, rows = pose.copy(), np.zeros(len(velocity), dtype=bool)
    # A third of the time is about how far it turns while it slows down.
    standing[3:7] = quaternions.about_axis(2, quaternions.heading(pose[3:7]) + velocity[5] * _STOP_TIME / 3.0)
    rows[3:6] = True
    for k, joint in enumerate(JOINTS):
        if joint.endswith(("abdomen", "chest", "hip", "knee", "ankle")):
            standing[7 + 4 * k : 11 + 4 * k] = 1.0, 0.0, 0.0, 0.0
            rows[6 + 3 * k : 9 + 3 * k] = True
    drift = departing(x) * _STOP_TIME
    decay = _decayed(np.arange(1, n + 1) / fps, np.full(len(velocity), REST_TIME)) * velocity
    tangents = np.where(rows, smooth_steps(x) * pose_difference(pose, standing) + drift * velocity, decay)
    tangents[:, :3] = 0.0
    soles = sole_points(pose[None])[0].reshape(2, 4, 3)
    support = int(np.argmin(soles[:, :, 2].min(axis=1)))
    for joint, ratio in (("hip", -1.0), ("knee", 2.0), ("ankle", -1.0)):
        pitch = 7 + 3 * JOINTS.index(f"{('left', 'right')[1 - support]}_{joint}")
        tangents[:, pitch] += ratio * _STEP_FLEXION * (4.0 * x * (1.0 - x))[:, 0] ** 2
    poses = add_tangents(np.repeat(pose[None], n, axis=0), tangents)
    moved = sole_points(poses).reshape(n, 2, 4, 3)
    slip = (moved[:, support] - soles[support]).mean(axis=1)[:, :2]
    poses[:, :2] -= slip - drift * (velocity[:2] + slip[0] * fps)
    height = soles[:, :, 2].min() - CONTACT_RADIUS
    poses[:, 2] += height * (1.0 - smooth_steps(x[:, 0])) - (moved[:, support, :, 2].min(axis=1) - CONTACT_RADIUS)
    return poses


def departing(x: Array) -> Array:
    """Quintic on [0, 1] with unit velocity at 0, at rest at 1, from 0 to 0, without acceleration at its ends."""
    return x - 6.0 * x**3 + 8.0 * x**4 - 3.0 * x**5
