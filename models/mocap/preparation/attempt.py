"""Attempt at a feasible motion near a looped capture, in passes.

A pass shifts the root so that supporting feet rest, low-passes, detects stances, and optimises. Contacts are thereby
fixed before the optimisation: a foot that bears load while it was captured sliding slides in the result, too, though
less. Where a result does not keep the bounds of contact, another pass begins with it, as a sequence of convex problems
does (Schulman et al. 2014, Int. J. Robot. Res. 33, section III). A pass that hardly improves any does not count.
"""

from typing import NamedTuple

import numpy as np

from geometry.arrays import Array, rms
from models.mocap.motion.clip import Clip, pose_difference
from models.mocap.motion.interpenetration import depths
from models.mocap.motion.ranges import beyond_ranges
from models.mocap.preparation.bounds import MAX_RESIDUAL, MAX_RESIDUAL_IN_FLIGHTS, MAX_SKATE
from models.mocap.preparation.feasible import feasible
from models.mocap.preparation.looping import LoopedClip
from models.mocap.preparation.poses import smoothed
from models.mocap.preparation.root_path import shifted_over_floor, without_foot_sliding
from models.mocap.preparation.stances import Stances, stances, with_feet_at_rest
from models.mocap.preparation.well_formed import well_formed

# With 3 passes the figure follows two of 28 captures, the somersaults, with 20 % of weight and by chance; with 5 with 4
# and 6 % (docs/validation/preparation-choices.md#passes).
_MAX_PASSES = 5
# Ratio to which a pass has to lower one measure of contact: a punch whose feet skate by 7 mm is changed by another 1°
# without it, and the third pass of a spin, which the figure follows with 7 instead of 16 %, has 0.4.
_MIN_IMPROVEMENT = 0.9
# RMS change of joints [rad] and of the root's height [m] beyond which the result counts as another motion. Of nine
# captures that change by 5 to 24°, six look like the same motion in pictures, and the figure tracks none of the nine
# worse than the capture; results more than 30° away also have a residual of 27 % of body weight or more. The root's
# displacement over the floor does not count, as captures drift.
_MAX_ROTATION_CHANGE, _MAX_HEIGHT_CHANGE = 0.5, 0.15
# How much further beyond its range a joint may be than in the capture [rad]. Of 177 prepared captures, those that are
# tracked have 1° at most; runs that are cut at full speed come to rest by decay 50 to 80° further beyond.
_MAX_ADDED_EXCESS = float(np.deg2rad(20.0))


class RmsChange(NamedTuple):
    """RMS change of the root's place over the floor and of its height [m], and of the joints' rotations [rad]."""

    moved: float
    raised: float
    turned: float


class Attempt(NamedTuple):
    """An attempt at a feasible motion.

    Attributes
    ----------
    cycle : LoopedClip
        The looped capture.
    planted : Clip
        The same with its root shifted over the floor so that supporting feet rest.
    schedule : Stances
        The contact schedule of the result.
    clip : Clip
        The result.
    residual : float
        RMS of the remaining residual force [body weights].
    change : RmsChange
        From `planted`, low-passed, to the result.
    near : bool
        Whether the result is feasible, and still the captured motion.
    """

    cycle: LoopedClip
    planted: Clip
    schedule: Stances
    clip: Clip
    residual: float
    change: RmsChange
    near: bool


def attempt(cycle: LoopedClip, captured: Clip, fps: float) -> Attempt:
    """Make a looped clip feasible, in as many passes of `_MAX_PASSES` as its contacts need.

    Parameters
    ----------
    cycle : LoopedClip
        The looped capture, at `fps`.
    captured : Clip
        The capture, whose limbs are as deep in each other, and joints as far beyond their ranges, as the result may be.
    fps : float
        Frame rate of the result [1/s].
    """
    overlap, start = depths(captured.poses).max(axis=0), smoothed(cycle.clip)
    last, clip, shift = None, cycle.clip, np.zeros((cycle.clip.n_frames, 2))
    before = np.full(3, np.inf)
    for _ in range(_MAX_PASSES):
        planted = without_foot_sliding(clip, smoothed(clip))
        shift = shift + (planted.poses - clip.poses)[:, :2]
        calm = smoothed(planted)
        schedule = with_feet_at_rest(stances(planted, calm), planted)
        result = feasible(calm, schedule, fps=fps, overlap=overlap)
        change = _rms_change(shifted_over_floor(start, shift), result.clip)
        near = (
            change.turned < _MAX_ROTATION_CHANGE
            and change.raised < _MAX_HEIGHT_CHANGE
            and result.residual < MAX_RESIDUAL_IN_FLIGHTS
            and _range_excess(result.clip) < max(_range_excess(captured), 0.0) + _MAX_ADDED_EXCESS
        )
        excess = _contact_excess(result.clip)
        if last is not None and (not near or np.all(excess > _MIN_IMPROVEMENT * before)):
            break
        last = Attempt(
            cycle, shifted_over_floor(cycle.clip, shift), schedule, result.clip, result.residual, change, near
        )
        # From a motion that is not near, passes lead away: a roll floated over the floor, 27° from the capture.
        if not near or np.all(excess <= 1.0):
            break
        clip, before = result.clip, excess
    assert last is not None
    return last


def unchanged(clip: Clip) -> Attempt | None:
    """A clip that is well-formed already, as its own feasible motion; None if it is not."""
    measures = well_formed(clip, ())
    if measures.faults():
        return None
    cycle = LoopedClip(clip, "cycle" if measures.closed else "open", 0.0, clip.duration, 0.0)
    schedule = stances(clip, smoothed(clip))
    return Attempt(cycle, clip, schedule, clip, measures.residual, RmsChange(0.0, 0.0, 0.0), True)


def _rms_change(start: Clip, end: Clip) -> RmsChange:
    tangents = pose_difference(start.poses, end.poses)
    turns = np.linalg.norm(tangents[:, 6:].reshape(len(tangents), -1, 3), axis=2)
    return RmsChange(rms(np.linalg.norm(tangents[:, :2], axis=1)), rms(tangents[:, 2]), rms(turns))


def _range_excess(clip: Clip) -> float:
    """Largest excess of a joint over its range [rad], negative within it."""
    return float(beyond_ranges(clip.poses).max())


def _contact_excess(clip: Clip) -> Array:
    """Ratios to their bounds of foot skate under load, of the residual force, and of a joint's torque, shape (3,)."""
    found = well_formed(clip, ())
    return np.array([found.skate / MAX_SKATE, found.residual / MAX_RESIDUAL, found.strain])
