"""Test whether clips are similar enough to be blended as a whole; otherwise a map plays the legs and trunk of one clip.

The mean of a walk, a kick and a dance plants a foot where one clip stands while another one steps: corrected feet
skate, and floor contact cannot give the forces that the mean needs. So the animation in the middle of a map is compared
with its clips in two measures: the residual force by inverse dynamics, and the foot skate during stance.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from controllers.haptic_map.composite import Composite
from controllers.haptic_map.cylindrical import Cylindrical
from controllers.legs.limbs import Limb
from experiments.files.array_cache import cached_array
from geometry.arrays import Array
from models.humanoid.skeleton import BODIES, CONTACT_RADIUS
from models.mocap.motion.clip import Clip
from sim.compilation.sources import results_folder
from sim.reference.reference import map_poses

MAX_FOOT_SKATE = 0.02
"""Largest foot skate of a blend, in 95 % of the stances [m]: the bound of docs/validation/blended-motions.md."""

MAX_EXCESS_RESIDUAL = (
    0.06  # [body weights] RMS residual above the clips' from which clips differ; for foot skate it is `MAX_FOOT_SKATE`
)
_FPS = 60.0
_TRUNK_BODIES = ("abdomen", "chest")
_MIDDLE, _CORNERS = (0.5, 0.5), ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0))  # shares of the domain in r and z


class Motion(NamedTuple):
    """Measures of a motion's faults.

    Attributes
    ----------
    residual : float
        RMS of the force that floor contact cannot give, by inverse dynamics [body weights].
    lowest : float
        Height of the lowest point of the soles [m].
    skate, furthest : float
        Foot skate (`models.mocap.preparation.skate`), hands included: 95th percentile of the stances and largest [m].
    """

    residual: float
    lowest: float
    skate: float
    furthest: float


def upper_joints(legs: Sequence[Limb]) -> list[int]:
    """Joints of the figure that do not belong to its legs, counted from 1."""
    return sorted(set(range(1, len(BODIES))).difference(*(leg.joints for leg in legs)))


def motion_of(poses: Array, fps: float) -> Motion:
    """Measure a motion (n, 75)."""
    # Imported here: they load signal processing, which a run with cached results does not need.
    from models.mocap.preparation.feasible import contact_forces
    from models.mocap.preparation.poses import smoothed, sole_points
    from models.mocap.preparation.skate import skates
    from models.mocap.preparation.stances import stances

    clip = Clip(poses, fps, "blend")
    schedule = stances(clip, smoothed(clip))
    support = contact_forces(clip, schedule)
    slides, lowest = skates(clip, schedule, support.loads), sole_points(poses)[:, :, 2].min() - CONTACT_RADIUS
    return Motion(support.residual, float(lowest), float(np.quantile(slides, 0.95)), float(slides.max()))


def moves_alike(made: Cylindrical, lap: float) -> bool:
    """Whether residual and foot skate in the middle of a map are little above the median at its corners.

    Needs compiled code; the measures are cached beside it.
    """

    def find() -> Array:
        return np.array([motion_at(made, place, lap) for place in (_MIDDLE, *_CORNERS)])

    found = cached_array(results_folder(__name__), "alike", (made.compiled().params, np.array([lap])), (5, 4), find)
    corner_median = np.median(found[1:], axis=0)
    return bool(
        found[0, 0] < corner_median[0] + MAX_EXCESS_RESIDUAL and found[0, 2] < corner_median[2] + MAX_FOOT_SKATE
    )


def carries_alike(made: Composite, lap: float) -> bool:
    """Whether the residual of a composite map's legs grows little with other clips' upper bodies."""
    lower = made.clips[0]
    own = Composite(lower, lower, lower, made.upper_joints, made.r_range, made.limbs, made.lap)

    def find() -> Array:
        return np.array([motion_at(own, _MIDDLE, lap), *(motion_at(made, (r, 0.0), lap) for r in (0.0, 0.5, 1.0))])

    found = cached_array(results_folder(__name__), "carries", (made.compiled().params, np.array([lap])), (4, 4), find)
    return bool(found[1:, 0].max() < found[0, 0] + MAX_EXCESS_RESIDUAL)


def motion_at(made: Cylindrical | Composite, place: tuple[float, float], lap: float) -> Motion:
    """Measure a lap [s] of a map round a circle, at shares `place` of its domain in r and z; needs compiled code."""
    (r_low, r_high), (z_low, z_high) = made.r_range, made.z_range if isinstance(made, Cylindrical) else (0.0, 0.0)
    rows = max(64, round(_FPS * lap))
    # The last pose repeats the first, as in a closed clip: otherwise the motion would count as one that stops.
    angles, r = 2.0 * np.pi * np.arange(rows + 1) / rows, r_low + place[0] * (r_high - r_low)
    stylus = np.zeros((rows + 1, 7))
    stylus[:, 0], stylus[:, 1] = r * np.cos(angles), r * np.sin(angles)
    stylus[:, 2], stylus[:, 3] = z_low + place[1] * (z_high - z_low), 1.0
    return motion_of(map_poses(made, stylus), rows / lap)


def arms(legs: Sequence[Limb]) -> list[int]:
    """Joints of arms and head."""
    return [joint for joint in upper_joints(legs) if joint not in {BODIES.index(name) for name in _TRUNK_BODIES}]
