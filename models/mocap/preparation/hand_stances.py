r"""Hands that bear load: where a palm rests near the floor, and the motion cannot do without it.

A hand that rests within reach of the floor (`contacts`) need not push: one that ties a shoe does not. So the wrench w
that the motion needs (`floor_forces`) is met with the standing feet alone, and with the resting hands as well; a hand
bears load over a whole stance if these make up, in the mean of the stance, for at least `_NEEDED` body weights:

.. math:: \frac1{m g}\,\overline{\lVert S (w - A f^*)\rVert_{feet} - \lVert S (w - A f^*)\rVert_{feet, hands}}

The figure lacks fingers, and a capture's wrist may be fixed: a resting palm is up to 12 cm above the floor or beneath
it. Its place is on the floor.
"""

import numpy as np
import numpy.typing as npt

from models.arrays import Array, Mask
from models.humanoid.skeleton import CONTACT_RADIUS, FOOT_CONTACTS, HAND_CONTACTS
from models.mocap.dynamics.contacts import GAP, HAND_REACH, SHORT, contacts
from models.mocap.dynamics.floor_forces import WITH_HANDS, Floor
from models.mocap.motion.clip import Clip, pose_difference
from models.mocap.motion.spans import cleaned, spans

# [body weights]: of 39 times that a palm rests near the floor in falls of LAFAN and in a crawl, a roll and two gettings
# up of DeepMimic, 32 make up for 0.27 or more, 7 for 0.17 or less; with half of it five more bear load, with twice
# three fewer. Of the 28 captures of docs/validation/prepared-captures.md hands bear load in two cartwheels alone (0.64
# and more).
_NEEDED = 0.2


def bearing_hands(points: Array, poses: Array, calm: Array, feet: Mask, fps: float) -> Mask:
    """Whether each palm bears load, left and right, shape (n, 2).

    Parameters
    ----------
    points : Array
        Centres of the contact spheres of feet and palms, shape (n, 10, 3) [m].
    poses, calm : Array
        Poses as captured, and low-passed, shape (n, 75).
    feet : Mask
        Which of the feet's spheres stand, shape (n, 8).
    fps : float
        Frame rate [1/s].
    """
    n = len(points)
    none = np.zeros((n, len(HAND_CONTACTS)), dtype=bool)
    if n < 3 or points[:, len(FOOT_CONTACTS) :, 2].min() - CONTACT_RADIUS > HAND_REACH:
        return none
    resting = contacts(Clip(poses, fps, "hands")).resting[:, len(FOOT_CONTACTS) : len(WITH_HANDS)]
    rests = np.stack([cleaned(hand, round(GAP * fps), round(SHORT * fps)) for hand in resting.T], axis=1)
    frames = np.flatnonzero(rests.any(axis=1))
    if not len(frames):
        return none
    gain = np.zeros(n)
    gain[frames] = _made_up_for(calm, frames, feet[frames], rests[frames], fps)
    bears = none
    for hand in range(len(HAND_CONTACTS)):
        for start, end in spans(rests[:, hand]):
            bears[start:end, hand] = gain[start:end].mean() > _NEEDED
    return bears


def bear_longer(palms: Array, hands: Mask, start: int, end: int, far: float) -> None:
    """Extend the stances of hands over frames start to end, in which nothing stands under load.

    A stance before or after lasts for as long as its palm (n, 2, 3) is within reach, and within `far` [m] of where the
    stance ended or began.
    """
    within = palms[:, :, 2] - CONTACT_RADIUS < HAND_REACH
    for edge, frames in ((start - 1, range(start, end)), (end, range(end - 1, start - 1, -1))):
        for hand in range(len(HAND_CONTACTS)):
            if not (0 <= edge < len(hands) and hands[edge, hand]):
                continue
            for k in frames:
                if not within[k, hand] or np.linalg.norm(palms[k, hand, :2] - palms[edge, hand, :2]) > far:
                    break
                hands[k, hand] = True


def _made_up_for(calm: Array, frames: npt.NDArray[np.intp], feet: Mask, hands: Mask, fps: float) -> Array:
    """By how much the hands lower the residual ‖S (w − A f*)‖ of some frames [body weights]."""
    floor = Floor(spheres=WITH_HANDS)
    steps = pose_difference(calm[:-1], calm[1:]) * fps
    inner = np.clip(frames, 1, len(calm) - 2)
    v, a = 0.5 * (steps[inner - 1] + steps[inner]), (steps[inner] - steps[inner - 1]) * fps
    demand = floor.demand(calm[inner], v, a)
    without, given = (np.concatenate((feet, palms), axis=1) for palms in (np.zeros_like(hands), hands))
    return floor.lacking(demand, without) - floor.lacking(demand, given)
