r"""The pace at which a capture's flights fall as they must.

Nothing but gravity moves the centre of mass in flight, so over a flight it is a parabola whose acceleration is −g. A
clip played σ times as fast is accelerated σ² times as much: one whose flights fall with a is right at

.. math:: \sigma = \sqrt{g / a} .

Files are played at a wrong rate, and figures of another size fall with another time scale; a motion keeps its
character at another pace, while flights that are bent to gravity one by one do not. Only what falls too fast is slowed:
nothing pulls a body down, but one that falls too slowly may be borne by a foot that was captured too high. With several
flights the acceleration is the mean with weights T⁴: that of a parabola through points with noise is known as well as
T² is large.
"""

from typing import NamedTuple

import numpy as np

from models.humanoid.skeleton import CONTACT_RADIUS, FOOT_CONTACTS, HAND_CONTACTS
from models.mocap.clip import Clip
from models.mocap.dynamics.momentum import momentum
from models.mocap.preparation.poses import contact_points

GRAVITY = 9.81  # [m/s²]
_HIGH = 0.03  # of feet and hands in flight [m]: captured feet hover by 1 to 2 cm where they stand
_CLEAR = 0.08  # that they reach in it [m]: dancers' feet hover higher than walkers'
_SHORT = 0.09  # [s], of flights that tell an acceleration
_RIGHT = 1.5  # [m/s²] beyond gravity that is kept, what `well_formed` allows
_SLOWEST = 0.35  # below which something else is wrong


class Paced(NamedTuple):
    """A clip at its pace.

    Attributes
    ----------
    clip : Clip
        The same frames at another rate.
    pace : float
        Times the file's.
    falls : float or None
        With what the file's flights fall [m/s²], if it has any.
    """

    clip: Clip
    pace: float
    falls: float | None


def paced(clip: Clip) -> Paced:
    """The clip at the pace that its flights allow; as it is where they fall with g or less, or there are none."""
    falls = falling(clip)
    if falls is None or falls < GRAVITY + _RIGHT or falls > GRAVITY / _SLOWEST**2:
        return Paced(clip, 1.0, falls)
    pace = float(np.sqrt(GRAVITY / falls))
    return Paced(Clip(clip.poses, clip.fps * pace, clip.name), pace, falls)


def falling(clip: Clip) -> float | None:
    """With what the centre of mass falls while neither feet nor hands are near the floor [m/s²]."""
    heights = contact_points(clip.poses, FOOT_CONTACTS + HAND_CONTACTS)[:, :, 2].min(axis=1) - CONTACT_RADIUS
    edges = np.flatnonzero(np.diff(np.concatenate(([0], (heights > _HIGH).astype(int), [0]))))
    spans = [
        (a, b)
        for a, b in zip(edges[::2], edges[1::2], strict=True)
        if b - a >= max(4, _SHORT * clip.fps) and heights[a:b].max() > _CLEAR
    ]
    if not spans:
        return None
    height = momentum(clip).com[:, 2]
    falls = [-2.0 * np.polyfit(np.arange(b - a) / clip.fps, height[a:b], 2)[0] for a, b in spans]
    return float(np.average(falls, weights=[float(b - a) ** 4 for a, b in spans]))
