"""The data of a moment of a run that is displayed."""

from typing import NamedTuple

from geometry.arrays import Array


class Moment(NamedTuple):
    """The displayed state of a run at one time.

    Attributes
    ----------
    t : float
        Time [s].
    qpos : Array
        Configuration of the world, with the figure.
    ghost : Array
        Pose of the ghost, shape (75,); empty if there is none.
    p, force, user : Array
        Stylus tip [m], force of the device and force of the hand [N], in H, shape (3,) each.
    target : Array
        Intended position of the hand in H [m], shape (3,); NaN if the hand has let go.
    """

    t: float
    qpos: Array
    ghost: Array
    p: Array
    force: Array
    user: Array
    target: Array
