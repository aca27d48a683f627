"""Measures of a motion that a map has made: joint limits, foot skate, floor penetration, flights."""

from typing import NamedTuple

import mujoco
import numpy as np

from controllers.certificates.flight.flight_fit import best_fall, find_flights
from controllers.legs.sole_heights import STANDS
from controllers.state import Array
from models.humanoid.skeleton import (
    CONTACT_RADIUS,
    FOOT_CONTACTS,
    N_JOINTS,
    figure_model,
    joint_range,
    rest_pose,
)
from models.mocap.dynamics.contacts import contacts
from models.mocap.dynamics.momentum import momentum
from models.mocap.motion.clip import Clip, pose_difference


class MotionMeasure(NamedTuple):
    """Largest faults of a motion.

    Attributes
    ----------
    limits : float
        Excess of a joint over its limits [rad].
    slide : float
        Distance of a contact point of a sole from where it touched down, while it is lower than `STANDS` [m].
    penetration : float
        Depth of the body below the floor [m].
    ballistic : float
        Distance of the centre of mass from the best-fitting free fall in flights [m]; 0 without a flight.
    """

    limits: float
    slide: float
    penetration: float
    ballistic: float

    @staticmethod
    def worst(measures: "list[MotionMeasure]") -> "MotionMeasure":
        """The largest of each measure; zeros for an empty list."""
        return MotionMeasure(*np.max([MotionMeasure(0.0, 0.0, 0.0, 0.0), *measures], axis=0).tolist())


def measure_motion(clip: Clip) -> MotionMeasure:
    """Measure a clip on the default figure."""
    turns = pose_difference(np.broadcast_to(rest_pose(), clip.poses.shape), clip.poses)[:, 6:]
    turns = turns.reshape(-1, N_JOINTS, 3)
    low, high = joint_range()[..., 0], joint_range()[..., 1]
    touched = contacts(clip)
    com = momentum(clip).com
    spans = find_flights(touched.supported, clip.fps)
    return MotionMeasure(
        limits=float(np.maximum(low - turns, turns - high).clip(min=0.0).max()),
        slide=largest_slide(soles(clip.poses)),
        penetration=float(max(0.0, -touched.clearance.min())),
        ballistic=max((best_fall(com[a : b + 1], clip.fps, 1.0)[0] for a, b in spans), default=0.0),
    )


def soles(poses: Array) -> Array:
    """Lowest points of the contact spheres of the default figure's feet [m], shape (n, 75) → (n, 8, 3)."""
    model = figure_model()
    data, geoms = mujoco.MjData(model), [int(model.geom(name).id) for name in FOOT_CONTACTS]
    points = np.empty((len(poses), len(geoms), 3))
    for pose, row in zip(poses, points, strict=True):
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        row[:] = data.geom_xpos[geoms]
    points[..., 2] -= CONTACT_RADIUS
    return points


def largest_slide(points: Array) -> float:
    """Largest horizontal distance of a point of `soles` from its touch-down while lower than `STANDS` [m]."""
    came_down, worst = np.full((points.shape[1], 2), np.nan), 0.0
    for places in points:
        touches = places[:, 2] < STANDS
        fresh = touches & np.isnan(came_down[:, 0])
        came_down[fresh] = places[fresh, :2]
        came_down[~touches] = np.nan
        worst = max(worst, float(np.linalg.norm(places[touches, :2] - came_down[touches], axis=1).max(initial=0.0)))
    return worst
