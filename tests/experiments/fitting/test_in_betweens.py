"""Blends of the embedded clips: standing feet neither slide nor sink, and the floor can provide the needed forces."""

from functools import cache

import numpy as np
import pytest

from controllers.legs.sole_heights import SWING_HEIGHT
from controllers.motion.lap import MEMORY
from experiments.config.maps import Cylindrical
from experiments.config.options import run_config
from experiments.setups.parts.clips import load_clips
from experiments.setups.parts.lap import DEFAULT_LAP
from experiments.setups.wiring import wire
from models.humanoid.skeleton import figure_model
from models.mocap.dynamics.floor_forces import Floor, residual
from models.mocap.motion.clip import pose_difference
from sim.reference.reference import map_poses
from tests.controllers.figure_soles import slide, soles

FIGURE = figure_model()
CONFIG = run_config(seconds=1.0)
FIGURE_CLIPS = Cylindrical().clips
STANDING = ("walk", "cheer", "angry", "squat_dance")
STEPPING = (("walk", "run"), ("ginga", "walk"))
SIMILAR = (("cheer", "angry"), ("cheer", "ginga"))  # blended as a whole, legs and all
SLOWER = (("ginga", "cheer", "walk", "angry"), ("ginga", "walk", "run", "spin"))
ROWS, TURN = 160, 2.0 * np.pi
MIXTURES = [(r, z) for r in (-0.8, -0.4, 0.0, 0.45, 0.9) for z in (-0.7, 0.0, 0.3, 0.8)]
DENSE_MIXTURES = [(r, z) for r in np.linspace(-0.9, 0.9, 10) for z in np.linspace(-0.85, 0.85, 8)]


@cache
def map_of(clips):
    return wire(run_config(clips=clips, seconds=1.0), load_clips(clips)[0]).haptic_map


def slow_params(values):
    return [pytest.param(value, marks=pytest.mark.slow) for value in values]


def laps(h_map, r, z, rows=ROWS, count=1.0):
    """Poses for a hand on a circle at constant speed, at (r, z) in units of the reach."""
    angles = 2 * np.pi * (np.arange(int(rows * count)) + 0.5) / rows
    reach = CONFIG.map.reach
    radius = CONFIG.map.around.radius + r * reach
    x = np.zeros((len(angles), 7))
    x[:, 0], x[:, 1], x[:, 2], x[:, 3] = radius * np.cos(angles), radius * np.sin(angles), z * reach, 1.0
    return map_poses(h_map, x)


@pytest.mark.parametrize("clips", SIMILAR)
def test_similar_clips_are_blended_including_legs(clips):
    assert map_of(clips).legs is None


@pytest.mark.parametrize("clips", [FIGURE_CLIPS, *slow_params((STANDING, *STEPPING, *SIMILAR, *SLOWER))])
def test_in_between_feet_neither_slide_nor_sink(clips):
    for r, z in DENSE_MIXTURES:
        places = soles(FIGURE, laps(map_of(clips), r, z, count=1.5))
        assert slide(places) < 0.02, (r, z)
        assert places[..., 2].min() > -0.007, (r, z)


def changing_mixture(h_map, held):
    """Poses for a hand that goes outwards and inwards three times in two laps, among mixtures of its clips."""
    memory, poses, fresh = h_map.compiled().memory, [], h_map.compiled().memory
    for s in np.linspace(0.0, 2.0, 960):
        angle, radius = TURN * s, CONFIG.map.around.radius - 0.5 * CONFIG.map.reach * np.cos(3.0 * np.pi * s)
        memory[MEMORY:] = memory[MEMORY:] if held else fresh[MEMORY:]
        x = np.array([radius * np.cos(angle), radius * np.sin(angle), 0.0, 1.0, 0.0, 0.0, 0.0])
        poses.append(h_map.pose(x, memory))
    return np.array(poses)


@pytest.mark.parametrize("clips", [SIMILAR[1], *slow_params(SIMILAR[:1])])
def test_feet_in_stance_keep_their_places_while_the_mixture_changes(clips):
    held, dragged = (slide(soles(FIGURE, changing_mixture(map_of(clips), held))) for held in (True, False))
    assert dragged > 0.02
    assert held < 0.25 * dragged


def test_feet_of_one_clip_at_all_corners_are_left_to_the_clip():
    h_map = map_of(("cheer", "cheer", "cheer", "cheer"))
    assert h_map.legs is None
    np.testing.assert_array_equal(changing_mixture(h_map, True), changing_mixture(h_map, False))


@pytest.mark.parametrize(
    "clips", [("walk", "angry", "cheer"), *slow_params([("ginga", "angry", "walk"), ("run", "walk", "cheer")])]
)
def test_composite_feet_follow_the_lower_clip_without_sliding(clips):
    h_map = wire(run_config(clips=clips, map="composite", seconds=1.0), load_clips(clips)[0]).haptic_map
    places = [soles(FIGURE, laps(h_map, r, 0.0, count=1.5)) for r in (-1.0, -0.3, 0.4, 1.0)]
    for feet in places:
        assert slide(feet) < 0.01
        np.testing.assert_allclose(feet, places[0], atol=1e-9)


# The walk's legs carry the arms of the other three: a mean of all at its pace would lack up to 0.14, 0.04 on average.
@pytest.mark.parametrize(("clips", "max_share", "mean_share"), [(FIGURE_CLIPS, 0.04, 0.025), (STANDING, 0.055, 0.03)])
def test_floor_can_provide_the_forces_of_in_betweens(clips, max_share, mean_share):
    floor, step, shares = Floor(), DEFAULT_LAP / ROWS, []
    for r, z in MIXTURES:
        poses = laps(map_of(clips), r, z, count=1.0 + 4 / ROWS)
        change = pose_difference(poses[:-1], poses[1:]) / step
        v, a, q = (change[1:] + change[:-1]) / 2, np.diff(change, axis=0) / step, poses[1:-1]
        demand = floor.demand(q, v, a)
        left = residual(demand, floor.grip(demand, soles(FIGURE, q)[..., 2] < SWING_HEIGHT))[:, :3] / floor.body_weight
        shares.append(float(np.sqrt((left**2).sum(axis=1).mean())))
    # Hicks et al. 2015: good below 5 %; where a walk has just begun to fade, a little more.
    assert max(shares) < max_share
    assert np.mean(shares) < mean_share
