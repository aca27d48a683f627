"""Slide and lowest height of the soles, measured from blocks of poses."""

from controllers.legs.sole_heights import STANCE_HEIGHT
from geometry.arrays import Array
from models.humanoid.skeleton import CONTACT_RADIUS, DEFAULT_STATURE, FOOT_CONTACTS, figure_model
from models.mocap.motion.foot_skate import ContactSlide, Rolling
from models.mocap.motion.kinematics import contact_points, contact_rotations
from models.world.scene import SceneConfig


class Soles:
    """Contact points of the soles of the animation, or of the physical figure.

    In contact are points within `STANCE_HEIGHT` of the floor; of the physical figure those that are pressed into it,
    and it rolls on them (`models.mocap.motion.foot_skate`).

    Attributes
    ----------
    lowest : float
        Least height of a point above the floor [m]; infinite before the first pose.
    """

    def __init__(self, scene: SceneConfig, physical: bool = False):
        self._contact_height, self._slide = 0.0 if physical else STANCE_HEIGHT, ContactSlide()
        self._model = figure_model(scene.stature, scene.mass)
        self._radius = CONTACT_RADIUS * scene.stature / DEFAULT_STATURE
        self._rolling = Rolling(self._radius) if physical else None
        self.lowest = float("inf")

    @property
    def slide(self) -> float:
        """Largest slide of a point (`models.mocap.motion.foot_skate`) [m]."""
        return self._slide.largest

    def add(self, poses: Array) -> None:
        """Add poses, shape (n, 75), in order of time."""
        if len(poses) == 0:
            return
        places = contact_points(poses, FOOT_CONTACTS, self._model)
        heights = places[:, :, 2] - self._radius
        self.lowest = min(self.lowest, float(heights.min()))
        if self._rolling:
            places -= self._rolling.add(contact_rotations(poses, FOOT_CONTACTS))
        self._slide.add(places, heights < self._contact_height)
