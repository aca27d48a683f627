"""Measures of a clip by MuJoCo kinematics alone: feet, centre of mass, momentum, floor forces, joint limits."""

from dataclasses import dataclass
from functools import cache

import mujoco
import numpy as np
from scipy.optimize import nnls

from models.humanoid.skeleton import CONTACT_RADIUS, FOOT_CONTACTS, JOINTS, figure_model, joint_range
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip, pose_difference
from models.mocap.motion.foot_skate import ContactSlide

G = 9.81
TOUCH = 0.003  # largest height of a contact sphere that may push [m]
FRICTION = 0.9


@dataclass(frozen=True)
class Measures:
    """Per frame: lowest sphere points (n, 8, 3), centre of mass, momentum about it, body positions, contacts (n, 8)."""

    fps: float
    mass: float
    soles: np.ndarray
    com: np.ndarray
    momentum: np.ndarray
    bodies: np.ndarray
    touching: np.ndarray


@cache
def measured(name: str) -> Measures:
    clip = embedded(name)
    model = figure_model()
    data = mujoco.MjData(model)
    geoms = [model.geom(name).id for name in FOOT_CONTACTS]
    n = len(clip.poses)
    soles, com, momentum = np.empty((n, 8, 3)), np.empty((n, 3)), np.zeros((n, 3))
    bodies = np.empty((n, model.nbody, 3))
    for k, pose in enumerate(clip.poses):
        data.qpos[:] = pose
        before, after = clip.poses[max(k - 1, 0)], clip.poses[min(k + 1, n - 1)]
        mujoco.mj_differentiatePos(model, data.qvel, 2 / clip.fps, before, after)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_subtreeVel(model, data)
        soles[k] = data.geom_xpos[geoms] - (0, 0, CONTACT_RADIUS)
        com[k], momentum[k], bodies[k] = data.subtree_com[1], data.subtree_angmom[1], data.xpos
    return Measures(clip.fps, model.body_subtreemass[0], soles, com, momentum, bodies, soles[:, :, 2] < TOUCH)


def acceleration(m: Measures) -> np.ndarray:
    """Acceleration of the centre of mass at frames 1 … n−2, shape (n − 2, 3)."""
    return (m.com[2:] - 2 * m.com[1:-1] + m.com[:-2]) * m.fps**2


def largest_slide(m: Measures) -> float:
    """Largest slide of a touching sphere [m]."""
    slide = ContactSlide()
    slide.add(m.soles, m.touching)
    return slide.largest


def residuals(m: Measures) -> tuple[np.ndarray, np.ndarray]:
    """Residual that touching spheres cannot provide at frames 2 … n−3: force per weight, moment per weight × metre."""
    force = m.mass * (acceleration(m) + np.array([0, 0, G]))[1:-1]
    moment = (m.momentum[3:-1] - m.momentum[1:-3]) * m.fps / 2
    directions = np.array([(FRICTION * np.cos(t), FRICTION * np.sin(t), 1) for t in np.arange(8) * np.pi / 4])
    remainders = np.empty((len(force), 2))
    for k in range(len(force)):
        arms = m.soles[k + 2, m.touching[k + 2]] - m.com[k + 2]
        wrench = np.concatenate([force[k], 2 * moment[k]])
        columns = [np.concatenate([d, 2 * np.cross(arm, d)]) for arm in arms for d in directions]
        remainder = wrench
        if columns:
            a = np.array(columns).T
            stacked = np.concatenate([a, 0.01 * np.eye(a.shape[1])])
            remainder = wrench - a @ nnls(stacked, np.concatenate([wrench, np.zeros(a.shape[1])]))[0]
        remainders[k] = np.linalg.norm(remainder[:3]), np.linalg.norm(remainder[3:]) / 2
    remainders /= m.mass * G
    return remainders[:, 0], remainders[:, 1]


def limit_excess(clip: Clip) -> float:
    """Largest excess of a joint's rotation vector over its range [rad]; negative when all are inside."""
    q = clip.poses[:, 7:].reshape(len(clip.poses), len(JOINTS), 4)
    q = np.where(q[..., :1] < 0, -q, q)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, q[..., :1])
    vectors = q[..., 1:] * np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 2.0)
    limits = joint_range()
    return float(np.maximum(vectors - limits[..., 1], limits[..., 0] - vectors).max())


def tangent_derivative(clip: Clip, order: int) -> np.ndarray:
    """Finite-difference time derivative of the given order of the pose, shape (n − order, 57)."""
    velocity = pose_difference(clip.poses[:-1], clip.poses[1:]) * clip.fps
    return np.diff(velocity, n=order - 1, axis=0) * clip.fps ** (order - 1)


def limb_penetration(clip: Clip) -> float:
    """Deepest penetration between arms, legs and trunk, at every fourth frame [m]."""
    model = figure_model()
    data = mujoco.MjData(model)
    visible_geoms: dict[str, list[int]] = {}
    for geom in np.flatnonzero(model.geom_group != 3):
        visible_geoms.setdefault(model.body(model.geom_bodyid[geom]).name, []).append(int(geom))
    limbs = [f"{side}_{part}" for side in ("left", "right") for part in ("forearm", "hand", "shank", "foot")]
    core = ["pelvis", "abdomen", "chest", "head", "left_thigh", "right_thigh"]
    adjacent = [("left_shank", "left_thigh"), ("right_shank", "right_thigh")]
    pairs = [(a, b) for a in limbs for b in core if (a, b) not in adjacent]
    pairs += [(a, b) for a in limbs[:4] for b in limbs[4:]] + [("left_thigh", "right_thigh")]
    deepest = 0.0
    for pose in clip.poses[::4]:
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        for a, b in pairs:
            if np.linalg.norm(data.body(a).xpos - data.body(b).xpos) < 0.5:
                distances = (
                    mujoco.mj_geomDistance(model, data, i, j, 0.05, None)
                    for i in visible_geoms[a]
                    for j in visible_geoms[b]
                )
                deepest = max(deepest, -min(distances))
    return deepest
