"""A moment of a run, as it is shown."""

from typing import NamedTuple

from controllers.state import Array


class Shown(NamedTuple):
    """What is drawn of a run at one time.

    Attributes
    ----------
    t : float
        [s]
    qpos : Array
        Configuration of the world, with the figure.
    ghost : Array
        Pose of the ghost, shape (75,), or nothing.
    p, force, user : Array
        Stylus tip [m], force of the device and of the hand on it [N], in H, shape (3,).
    target : Array
        Where the hand means to be, in H [m], shape (3,); NaN where it has let go.
    """

    t: float
    qpos: Array
    ghost: Array
    p: Array
    force: Array
    user: Array
    target: Array
