"""The figure's legs as limbs for the inverse kinematics of blends and steps."""

import mujoco
import numpy as np

from controllers.legs.footsteps import packed_steppers
from controllers.legs.joint_limits import SATURATION_WIDTH
from controllers.legs.limbs import Limb
from geometry.arrays import Array
from models.humanoid.skeleton import BODIES, FOOT_CONTACTS, joint_range


def figure_legs(figure: mujoco.MjModel) -> tuple[Limb, ...]:
    """The figure's legs as limbs of a blend: soles are placed at the mean of their places in the clips."""
    legs: list[Limb] = []
    for side in ("left", "right"):
        bodies = [f"{side}_{part}" for part in ("thigh", "shank", "foot")]
        first, second, third = (BODIES.index(body) for body in bodies)
        offsets = np.array([figure.body(body).pos for body in bodies])
        sole = np.array([figure.geom(name).pos for name in FOOT_CONTACTS if name.startswith(side)])
        # A joint comes to rest half a margin beyond its soft limit, hence on the limit of its range.
        limits = joint_range()[[first - 1, second - 1, third - 1]] + 0.5 * SATURATION_WIDTH * np.array([1.0, -1.0])
        legs.append(Limb((first, second, third), offsets, np.array([0.0, 1.0, 0.0]), sole, limits))
    return tuple(legs)


def packed_legs(figure: mujoco.MjModel) -> Array:
    """`figure_legs` packed for kernels that step (`packed_steppers`), shape (2, 48)."""
    return packed_steppers(figure_legs(figure))
