"""Travelling clips that repeat themselves take as many strides a lap as the first."""

import numpy as np
import pytest

from controllers.haptic_map.cylindrical import Cylindrical
from controllers.motion.loops import checked_clip, closed_loop
from controllers.motion.strides import in_step, natural_lap, strides
from tests.controllers.clips_for_maps import difference, stylus, swinging


def repeated(seed, times, travel, frames=60):
    """A clip that travels and repeats itself."""
    lap = swinging(seed, frames, travel=travel)
    laps = [lap[:-1].copy() for _ in range(times)]
    for k, one in enumerate(laps):
        one[:, 0] += k * travel
    last = lap[-1:].copy()
    last[:, 0] += (times - 1) * travel
    return np.concatenate([*laps, last])


def loop(poses):
    return closed_loop(checked_clip(poses, 30.0, "clip"), 30.0)


@pytest.mark.parametrize("times", [1, 2, 3, 5])
def test_repeats_are_counted(times):
    assert strides(loop(repeated(1, times, 1.1))) == times


def test_a_clip_that_stands_still_repeats_once():
    assert strides(loop(np.tile(swinging(1, 2)[:1], (9, 1)))) == 1


def test_clips_that_travel_take_the_strides_of_the_first():
    still, walk, run, step = swinging(4), repeated(1, 2, 1.1), repeated(2, 3, 2.0), swinging(3, travel=0.4)
    loops = [loop(poses) for poses in (still, walk, run, step)]
    adjusted = in_step(loops)
    np.testing.assert_allclose([np.hypot(*one.drift[:2]) for one in adjusted], [0.0, 2.2, 4.0, 0.4], atol=1e-9)
    np.testing.assert_allclose([one.duration for one in adjusted], [4.0, 4.0, 4.0, 4.0], atol=1e-9)
    s = np.linspace(0.0, 1.0, 50)
    np.testing.assert_allclose(adjusted[2].channels(s, 0.0 * s), loops[2].channels(s * 2 / 3, 0.0 * s), atol=1e-12)


def test_poses_and_stride_of_a_clip_that_was_cut_are_the_clips():
    walk, run = repeated(1, 2, 1.1), repeated(2, 3, 2.0)
    r, z = (0.03, 0.07), (-0.03, 0.03)
    h_map, alone = (Cylindrical([(c, 30.0) for c in clips], r, z) for clips in ([walk, run] * 2, [run] * 4))
    # In the run's own map a lap has three strides, in this one two, begun wherever they agree best with the walk's.
    own = [alone.pose(stylus(r[0], angle, 0.0)) for angle in np.linspace(0.0, 2 * np.pi, 721)[:-1]]
    for angle in (0.3, 2.0, 4.4):
        pose = h_map.pose(stylus(r[1], angle, 0.0))
        assert min(np.abs(difference(pose, other)[2:]).max() for other in own) < 0.02
    memory, first = h_map.compiled().memory, h_map.pose(stylus(r[1], 0.3, 0.0))
    for angle in np.linspace(0.3, 0.3 + 2 * np.pi, 60):
        pose = h_map.pose(stylus(r[1], angle, 0.0), memory)
    np.testing.assert_allclose(np.hypot(*(pose - first)[:2]), 4.0, atol=1e-6)


def test_a_lap_plays_each_clip_as_often_as_it_fits():
    # 2 s on the spot, a walk of two strides in 4 s, a run of three in 6 s.
    loops = [loop(poses) for poses in (swinging(4, 60), repeated(1, 2, 1.1), repeated(2, 3, 2.0))]
    durations = np.array([one.duration for one in loops])
    adjusted = in_step(loops, 6.0)
    assert adjusted[0].share == 3.0
    # Those that travel have as many strides, here three: 1.5 laps of the walk and one of the run.
    strides_a_lap = [adjusted[1].share * 2, adjusted[2].share * 3]
    assert strides_a_lap[0] == strides_a_lap[1] == 3.0
    for before, one in zip(loops, adjusted, strict=True):
        np.testing.assert_allclose(one.drift, one.share * before.drift)
    np.testing.assert_allclose([one.duration for one in adjusted], durations * [one.share for one in adjusted])


def test_clips_that_need_not_be_in_step_are_each_near_their_own_pace():
    # Cycles of 2 and 0.9 s: two and four of them, where in step they would be three and three.
    loops = [loop(repeated(1, 2, 1.1)), loop(repeated(2, 3, 2.0, 27))]
    durations = [one.duration for one in in_step(loops, 4.1, apart=True)]
    np.testing.assert_allclose(durations, [4.0, 3.6])
    np.testing.assert_allclose([one.duration for one in in_step(loops, 4.1)], [4.0, 1.8])


def test_in_the_natural_lap_the_first_clip_is_at_its_own_pace():
    # A cycle of 0.5 s beside one of 2.1 s that goes on the spot, and one of 0.9 s.
    loops = [loop(repeated(1, 1, 1.1, 15)), loop(swinging(3, 63)), loop(repeated(2, 1, 1.3, 27))]
    for first in range(3):
        order = loops[first:] + loops[:first]
        lap = natural_lap(order)
        assert in_step(order[:1], lap)[0].duration == pytest.approx(lap)
        assert 3.0 <= lap <= 6.0


def test_the_natural_lap_plays_clips_at_their_own_pace_where_that_can_be():
    loops = [loop(swinging(seed, frames)) for seed, frames in ((4, 30), (5, 45), (6, 90))]
    lap = natural_lap(loops)
    paces = [one.duration / lap for one in in_step(loops, lap)]
    np.testing.assert_allclose(paces, 1.0, atol=0.05)
    assert 3.0 <= lap <= 6.0
