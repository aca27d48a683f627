r"""Hands that bear load: where a palm rests near the floor, and the motion needs its support.

A hand that rests within reach of the floor (`contacts`) need not push: one that ties a shoe does not. So contact forces
for the wrench w that the motion needs (`floor_forces`) are found with the standing feet alone, and with the resting
hands as well. A hand bears load over a whole stance if the hands lower the residual, on average over the stance, by at
least `_MIN_RESIDUAL_DECREASE` body weights:

.. math:: \frac1{m g}\,\overline{\lVert S (w - A f^*)\rVert_{feet} - \lVert S (w - A f^*)\rVert_{feet, hands}}

The figure lacks fingers, and a capture's wrist may be fixed, so a resting palm may be up to 12 cm above the floor, or
below it. Its place in the schedule is on the floor.
"""

import numpy as np
import numpy.typing as npt

from geometry.arrays import Array, Mask
from geometry.spans import cleaned, spans
from models.humanoid.skeleton import CONTACT_RADIUS, FOOT_CONTACTS, HAND_CONTACTS
from models.mocap.dynamics.contacts import HAND_REACH, MAX_FILLED_GAP, MIN_STANCE_TIME, contacts
from models.mocap.dynamics.floor_forces import ALL_CONTACTS, Floor
from models.mocap.motion.clip import Clip, pose_difference

# Least decrease of the residual by the hands [body weights]. Of 39 stances of palms in falls of LAFAN, and in a crawl,
# a roll and two motions of getting up of DeepMimic, 32 lower it by 0.27 or more, 7 by 0.17 or less; with half the value
# five more bear load, with twice the value three fewer. Of the 28 captures of docs/validation/prepared-captures.md,
# hands bear load only in two cartwheels (0.64 and more).
_MIN_RESIDUAL_DECREASE = 0.2
# Height of a palm up to which its stance is extended [m]: palms that rest at about `HAND_REACH` stood in pieces. With
# 0.2 m the residual of the cartwheel on which it was chosen is 1.1 instead of 0.9 %.
_MAX_EXTENDED_REACH = 0.15


def loaded_hands(points: Array, poses: Array, calm: Array, feet: Mask, fps: float) -> Mask:
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
    no_hands = np.zeros((n, len(HAND_CONTACTS)), dtype=bool)
    if n < 3 or points[:, len(FOOT_CONTACTS) :, 2].min() - CONTACT_RADIUS > HAND_REACH:
        return no_hands
    resting = contacts(Clip(poses, fps, "hands")).resting[:, len(FOOT_CONTACTS) : len(ALL_CONTACTS)]
    stances = np.stack(
        [cleaned(hand, round(MAX_FILLED_GAP * fps), round(MIN_STANCE_TIME * fps)) for hand in resting.T], axis=1
    )
    frames = np.flatnonzero(stances.any(axis=1))
    if not len(frames):
        return no_hands
    decrease = np.zeros(n)
    decrease[frames] = _residual_decrease(calm, frames, feet[frames], stances[frames], fps)
    bearing = no_hands
    for hand in range(len(HAND_CONTACTS)):
        for start, end in spans(stances[:, hand]):
            bearing[start:end, hand] = decrease[start:end].mean() > _MIN_RESIDUAL_DECREASE
    return bearing


def extend_hand_stances(palms: Array, hands: Mask, start: int, end: int, far: float) -> None:
    """Extend the stances of hands over frames start to end, in which nothing else stands although the body is loaded.

    A stance before or after is extended for as long as its palm (n, 2, 3) is below `_MAX_EXTENDED_REACH`, and within
    `far` [m] of where the stance ended or began: a palm that rests at about the reach of a hand stands throughout.
    """
    within = palms[:, :, 2] - CONTACT_RADIUS < _MAX_EXTENDED_REACH
    for edge, frames in ((start - 1, range(start, end)), (end, range(end - 1, start - 1, -1))):
        for hand in range(len(HAND_CONTACTS)):
            if not (0 <= edge < len(hands) and hands[edge, hand]):
                continue
            for k in frames:
                if not within[k, hand] or np.linalg.norm(palms[k, hand, :2] - palms[edge, hand, :2]) > far:
                    break
                hands[k, hand] = True


def _residual_decrease(calm: Array, frames: npt.NDArray[np.intp], feet: Mask, hands: Mask, fps: float) -> Array:
    """Decrease of the residual ‖S (w − A f*)‖ by the hands in the given frames [body weights]."""
    floor = Floor(spheres=ALL_CONTACTS)
    steps = pose_difference(calm[:-1], calm[1:]) * fps
    inner = np.clip(frames, 1, len(calm) - 2)
    v, a = 0.5 * (steps[inner - 1] + steps[inner]), (steps[inner] - steps[inner - 1]) * fps
    demand = floor.demand(calm[inner], v, a)
    without_hands, with_hands = (np.concatenate((feet, palms), axis=1) for palms in (np.zeros_like(hands), hands))
    return floor.residual_norm(demand, without_hands) - floor.residual_norm(demand, with_hands)
