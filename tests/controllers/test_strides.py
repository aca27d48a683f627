"""Travelling clips that repeat themselves take as many strides a lap as the first."""

import numpy as np
import pytest
from clips_for_maps import difference, stylus, swinging

from controllers.haptic_map.cylindrical import Cylindrical
from controllers.motion.loops import checked_clip, closed_loop
from controllers.motion.strides import in_step, strides


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
