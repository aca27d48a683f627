"""Test whether clips are similar enough to be blended as a whole; otherwise a map plays the legs and trunk of one clip.

The mean of a walk, a kick and a dance plants a foot where one clip stands while another one steps: corrected feet
skate, and floor contact cannot give the forces that the mean needs. So the animation in the middle of a map is compared
with its clips in two measures: the residual force by inverse dynamics, and the foot skate during stance.
"""

from collections.abc import Sequence

import numpy as np

from controllers.haptic_map.composite import Composite
from controllers.haptic_map.cylindrical import Cylindrical
from controllers.legs.limbs import Limb
from experiments.files.array_cache import cached_array
from experiments.fitting.hand_tours import domain, poses_about_circle
from experiments.fitting.motion_faults import MAX_FOOT_SKATE, MotionFaults, motion_faults
from geometry.arrays import Array
from models.humanoid.skeleton import BODIES

# [body weights] RMS residual above the clips' from which clips differ; for foot skate it is `MAX_FOOT_SKATE`
_MAX_EXCESS_RESIDUAL = 0.06
_FPS = 60.0
_TRUNK_BODIES = ("abdomen", "chest")
_MIDDLE, _CORNERS = (0.5, 0.5), ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0))  # shares of the domain in r and z


def upper_joints(legs: Sequence[Limb]) -> list[int]:
    """Joints of the figure that do not belong to its legs, counted from 1."""
    return sorted(set(range(1, len(BODIES))).difference(*(leg.joints for leg in legs)))


def moves_alike(haptic_map: Cylindrical, lap: float) -> bool:
    """Whether residual and foot skate in the middle of a map are little above the median at its corners.

    Needs compiled code; the measures are cached beside it.
    """

    def find() -> Array:
        return np.array([faults_at(haptic_map, place, lap) for place in (_MIDDLE, *_CORNERS)])

    made_of = (haptic_map.compiled().params, np.array([lap]))
    found = cached_array(__name__, "alike", made_of, (5, 4), find)
    corner_median = np.median(found[1:], axis=0)
    return bool(
        found[0, 0] < corner_median[0] + _MAX_EXCESS_RESIDUAL and found[0, 2] < corner_median[2] + MAX_FOOT_SKATE
    )


def carries_alike(haptic_map: Composite, lap: float) -> bool:
    """Whether the residual of a composite map's legs grows little with other clips' upper bodies."""
    lower = haptic_map.clips[0]
    own = Composite(lower, lower, lower, haptic_map.upper_joints, haptic_map.r_range, haptic_map.limbs, haptic_map.lap)

    def find() -> Array:
        others = [faults_at(haptic_map, (r, 0.0), lap) for r in (0.0, 0.5, 1.0)]
        return np.array([faults_at(own, _MIDDLE, lap), *others])

    made_of = (haptic_map.compiled().params, np.array([lap]))
    found = cached_array(__name__, "carries", made_of, (4, 4), find)
    return bool(found[1:, 0].max() < found[0, 0] + _MAX_EXCESS_RESIDUAL)


def faults_at(haptic_map: Cylindrical | Composite, place: tuple[float, float], lap: float) -> MotionFaults:
    """Measure a lap [s] of a map round a circle, at shares `place` of its domain in r and z; needs compiled code."""
    low, high = domain(haptic_map).T
    r, z = low + np.array(place) * (high - low)
    rows = max(64, round(_FPS * lap))
    # The last pose repeats the first, as in a closed clip: otherwise the motion would count as one that stops.
    return motion_faults(poses_about_circle(haptic_map, r, 2.0 * np.pi * np.arange(rows + 1) / rows, z), rows / lap)


def arms(legs: Sequence[Limb]) -> list[int]:
    """Joints of arms and head."""
    return [joint for joint in upper_joints(legs) if joint not in {BODIES.index(name) for name in _TRUNK_BODIES}]
