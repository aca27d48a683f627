"""Slide and lowest height of the soles, measured from blocks of poses."""

from controllers.legs.sole_heights import STANCE_HEIGHT
from geometry.arrays import Array
from models.humanoid.skeleton import CONTACT_RADIUS, DEFAULT_STATURE, FOOT_CONTACTS, figure_model
from models.mocap.motion.foot_skate import ContactSlide
from models.mocap.motion.kinematics import contact_points
from models.world.scene import SceneConfig


class Soles:
    """Contact points of the soles of a figure; a point lower than `touch` [m] counts as in contact.

    Attributes
    ----------
    lowest : float
        Least height of a point above the floor [m]; infinite before the first pose.
    """

    def __init__(self, scene: SceneConfig, touch: float = STANCE_HEIGHT):
        self._contact_height, self._slide = touch, ContactSlide()
        self._model = figure_model(scene.stature, scene.mass)
        self._radius = CONTACT_RADIUS * scene.stature / DEFAULT_STATURE
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
        self._slide.add(places, heights < self._contact_height)
