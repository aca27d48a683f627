"""A simulated person's internal model of the figure: its poses along the intended motion, and inverse Jacobians.

From the pose of the figure that the person sees and from what her hand feels, she estimates the stylus's place relative
to the motion that she has in mind (`sim.users.person.eye`).
"""

import numpy as np

from controllers.state import stylus_path
from geometry.arrays import Array
from models.mocap.motion.clip import pose_difference
from sim.devices.simulated import SimulatedPhantom
from sim.loop.servo import Servo
from sim.reference.reference import reference_poses
from sim.users.person.eye import Eye
from sim.users.person.wishes import ENGAGED, PLACE, Wishes

N_POSES = 128  # poses along a motion: some 3 degrees of a lap apart
_DIFFERENCE_STEP = 2e-3  # [m] step of the stylus for finite differences of the figure's pose
# Damping of the inverse over the largest singular value: weaker effects are felt rather than seen.
_DAMPING_RATIO = 0.15


def with_eyes(servo: Servo, wishes: Wishes, curve: Array) -> Servo:
    """The servo with a person who sees the figure.

    Parameters
    ----------
    servo : Servo
        Linked servo of a figure whose map's argument is the stylus.
    wishes : Wishes
        What the person wants; their places are those that she has in mind, or `curve` if there are none.
    curve : Array
        Points of the map's curve in H [m], shape (n, 3).
    """
    assert isinstance(servo.device, SimulatedPhantom)
    rows = wishes.rows[wishes.rows[:, ENGAGED] > 0.0, PLACE : PLACE + 3]
    if wishes.period > 0.0 and wishes.lap > 0.0:
        rows = rows[: round(wishes.lap / wishes.period)]
    places = rows if wishes.period >= 0.0 and len(rows) > 1 else curve
    places = places[np.linspace(0.0, len(places) - 1.0, min(N_POSES, len(places))).astype(int)]
    hand = servo.device.user
    person = hand.person._replace(eye=learned_eye(servo, places))
    return servo._replace(device=servo.device._replace(user=hand._replace(person=person)))


def learned_eye(servo: Servo, places: Array) -> Eye:
    """Poses at places (n, 3) of the stylus in H [m], and damped inverses of the map's Jacobian there."""
    reference = servo.reference

    def poses(points: Array) -> Array:
        return reference_poses(reference, stylus_path(points))

    effects = np.stack([
        pose_difference(poses(places - step), poses(places + step)) / (2.0 * _DIFFERENCE_STEP)
        for step in _DIFFERENCE_STEP * np.eye(3)
    ], axis=2)  # fmt: skip
    u, strengths, v = np.linalg.svd(effects, full_matrices=False)
    trust = (_DAMPING_RATIO * strengths[:, 0]) ** 2
    inverses = np.einsum("nij,ni,nki->njk", v, strengths / (strengths**2 + trust[:, None]), u)
    unseen = np.eye(3) - inverses @ effects
    return Eye(reference.pose, poses(places), *(np.ascontiguousarray(a) for a in (places, inverses, unseen, trust)))
