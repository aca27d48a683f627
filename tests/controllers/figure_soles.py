"""Positions of a figure's sole points and how far they slide."""

from controllers.legs.sole_heights import STANCE_HEIGHT
from models.humanoid.skeleton import CONTACT_RADIUS, FOOT_CONTACTS
from models.mocap.motion.foot_skate import ContactSlide
from models.mocap.motion.kinematics import contact_points


def soles(figure, poses):
    """Positions [m] of the contact points, shape (poses, points, 3)."""
    return contact_points(poses, FOOT_CONTACTS, figure) - [0.0, 0.0, CONTACT_RADIUS]


def slide(positions, touch=STANCE_HEIGHT):
    """Largest slide [m] of a point that is lower than `touch`."""
    found = ContactSlide()
    found.add(positions, positions[..., 2] < touch)
    return found.largest
