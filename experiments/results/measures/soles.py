"""Foot skate and lowest height of the soles, measured from blocks of poses."""

import mujoco
import numpy as np

from controllers.legs.sole_heights import STANCE_HEIGHT
from geometry.arrays import Array
from models.humanoid.skeleton import CONTACT_RADIUS, DEFAULT_STATURE, FOOT_CONTACTS, figure_model
from models.world.scene import SceneConfig


class Soles:
    """Contact points of the soles of a figure; a point lower than `touch` [m] counts as in contact.

    Attributes
    ----------
    slide : float
        Foot skate: largest horizontal distance of a point from where its contact began [m].
    lowest : float
        Least height of a point above the floor [m]; infinite before the first pose.
    """

    def __init__(self, scene: SceneConfig, touch: float = STANCE_HEIGHT):
        self._contact_height = touch
        self._model = figure_model(scene.stature, scene.mass)
        self._data = mujoco.MjData(self._model)
        self._geoms = [int(self._model.geom(name).id) for name in FOOT_CONTACTS]
        self._radius = CONTACT_RADIUS * scene.stature / DEFAULT_STATURE
        self._contact_origin = np.full((len(self._geoms), 2), np.nan)
        self.slide, self.lowest = 0.0, float("inf")

    def add(self, poses: Array) -> None:
        """Add poses, shape (n, 75), in order of time."""
        for pose in poses:
            self._data.qpos[:] = pose
            mujoco.mj_kinematics(self._model, self._data)
            places = self._data.geom_xpos[self._geoms]
            height = places[:, 2] - self._radius
            self.lowest = min(self.lowest, float(height.min()))
            touching = height < self._contact_height
            starting = touching & np.isnan(self._contact_origin[:, 0])
            self._contact_origin[starting] = places[starting, :2]
            self._contact_origin[~touching] = np.nan
            slid = np.linalg.norm(places[:, :2] - self._contact_origin, axis=1)
            self.slide = max(self.slide, float(np.max(slid[touching], initial=0.0)))
