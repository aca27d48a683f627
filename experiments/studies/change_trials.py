"""Changes of river and stops at random moments: slide and height of the soles, and jumps of velocities.

``python -m experiments.studies.change_trials CLIP CLIP CLIP...`` lets rivers play embedded clips, and prints the worst
of many changes from one river to another, and of as many hands that are pushed out of all rivers. The animation is
measured at every update; a jump is the change of a velocity from one update to the next, 8 ms later.
"""

import sys
from typing import NamedTuple

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.fields.algebra.instructions import TRACE_PHASE, TRACE_RIVER, TRACE_SIZE
from controllers.haptic_map.river_clips import RiverClips
from controllers.state import stylus_path
from experiments.fitting.figure_legs import figure_legs, packed_legs
from experiments.fitting.rest_phases import with_rests
from experiments.results.measures.soles import Soles
from experiments.setups.modes.rivers import river_bundle
from experiments.setups.parts.clips import load_clips
from geometry.arrays import Array
from geometry.easing import smooth_steps
from models.humanoid.skeleton import CONTACT_RADIUS, figure_model
from models.mocap.motion.clip import pose_difference
from models.mocap.motion.kinematics import sole_points
from models.world.scene import SceneConfig
from sim.reference.reference import make_reference, reference_along

PERIOD, LAP, BLEND = 8e-3, 3.4, 0.4  # [s] update period, duration of a lap, shortest change
_TUBE_RADIUS = 0.015  # [m] radius
# [s] duration of the hand's change, and time measured from its beginning on
_CHANGE_DURATION, _MEASURED_TIME = 0.3, 0.8
_EXIT_DISPLACEMENT = np.array([0.1, 0.0, 0.1])  # [m] of a hand that leaves all rivers, in the same duration
_FIRST_MOMENT, _MOMENT_RANGE = 1.2, 3.0  # [s] earliest moment, and range of the moments
_TRIAL_COUNT, _SEED = 200, 11  # of random moments
_MAX_SLIDE = 0.03  # [m] slide above which a change is counted


class Change(NamedTuple):
    """Worst values in a change of river, or in a stop.

    Attributes
    ----------
    slide, height, depth : float
        Slide of a point of a sole, height of the lowest point, and its depth below the floor [m].
    horizontal_jump, vertical_jump, joint_jump : float
        Jumps of the root's horizontal and vertical velocity [m/s], and of a joint's velocity [rad/s].
    """

    slide: float
    height: float
    depth: float
    horizontal_jump: float
    vertical_jump: float
    joint_jump: float


def measured_change(poses: Array, period: float = PERIOD) -> Change:
    """Measure a change from its poses, shape (n, 75), one per period [s]."""
    heights, feet = sole_points(poses)[..., 2] - CONTACT_RADIUS, Soles(SceneConfig())
    feet.add(poses)
    jumps = np.abs(np.diff(pose_difference(poses[:-1], poses[1:]) / period, axis=0))
    return Change(
        slide=feet.slide,
        height=float(heights.min(axis=1).max()),
        depth=float(-heights.min()),
        horizontal_jump=float(jumps[:, :2].max()),
        vertical_jump=float(jumps[:, 2].max()),
        joint_jump=float(jumps[:, 6:].max()),
    )


def rivers_that_play(names: tuple[str, ...]) -> RiverClips:
    """The default rivers, one for each of three embedded clips, with the phases at which these can stand."""
    figure = figure_model()
    rivers = river_bundle(Trajectory.circle(0.0477, LAP), 0.025, 0.02, 4.0, _TUBE_RADIUS).rivers
    clips = [(clip.poses, clip.fps) for clip in load_clips(names, raw=True)[0]]
    return with_rests(RiverClips([river.curve for river in rivers], clips, _TUBE_RADIUS, figure_legs(figure)), figure)


def played_change(rivers: RiverClips, first: int, second: int | None, moment: float, period: float = PERIOD) -> Array:
    """Poses from the moment [s] at which the hand changes to the second river or, if it is None, leaves all rivers."""
    figure = figure_model()
    t = period * np.arange(round((moment + _MEASURED_TIME) / period), dtype=np.float64)
    s = smooth_steps((t - moment) / _CHANGE_DURATION + (0.0 if second is None else 0.5))[:, None]
    there = rivers.curves[first].point(t % LAP)
    away = _EXIT_DISPLACEMENT if second is None else rivers.curves[second].point(t % LAP) - there
    traces = np.zeros((len(t), TRACE_SIZE))
    traces[:, TRACE_PHASE] = t % LAP
    # A run that does not begin on the first river changes to its own at once, long before the moment.
    traces[:, TRACE_RIVER] = np.where(t < moment, first, -1.0 if second is None else second)
    reference = make_reference(figure, rivers.compiled(), period, 6.0, BLEND, packed_legs(figure))
    poses = np.empty((len(t), figure.nq))
    reference_along(reference, stylus_path(there + s * away), traces, poses)
    return poses[round(moment / period) :]


def drawn_changes(rivers: RiverClips, count: int, rng: np.random.Generator, stops: bool) -> list[Change]:
    """Measure changes, or stops, between random rivers and at random moments."""
    changes = []
    for _ in range(count):
        first, second = rng.permutation(len(rivers.curves))[:2]
        moment = _FIRST_MOMENT + _MOMENT_RANGE * rng.random()
        changes.append(measured_change(played_change(rivers, first, None if stops else second, moment)))
    return changes


def main(arguments: list[str]) -> None:
    """Print a row for changes of river, and one for stops."""
    rivers = rivers_that_play(tuple(arguments))
    for stops in (False, True):
        found = np.array(drawn_changes(rivers, _TRIAL_COUNT, np.random.default_rng(_SEED), stops))
        worst = Change(*found.max(axis=0))
        median, most = np.quantile(found[:, 5], [0.5, 0.9])
        print(f"{_TRIAL_COUNT} {'stops' if stops else 'changes'}")
        print(f"  slide {100 * worst.slide:.1f} cm, {(found[:, 0] > _MAX_SLIDE).sum()} of them more than 3 cm")
        print(f"  in the air {100 * worst.height:.1f} cm, below the floor {100 * worst.depth:.1f} cm")
        print(f"  jumps of the root {worst.horizontal_jump:.2f} m/s over the ground, {worst.vertical_jump:.2f} m/s up")
        print(f"  jumps of joints {worst.joint_jump:.0f} rad/s, median {median:.1f}, nine of ten at most {most:.1f}")


if __name__ == "__main__":
    main(sys.argv[1:])
