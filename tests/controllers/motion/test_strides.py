"""Strides per lap: travelling clips are trimmed or repeated to the number of strides of the first."""

import numpy as np
import pytest

from controllers.haptic_map.cylindrical import Cylindrical
from controllers.motion.loops import checked_clip, closed_loop
from controllers.motion.strides import _best_repeat_count, fit_to_lap, natural_lap, strides
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


def test_still_clip_repeats_once():
    assert strides(loop(np.tile(swinging(1, 2)[:1], (9, 1)))) == 1


def test_travelling_clips_take_as_many_strides_as_the_first():
    still, walk, run, step = swinging(4), repeated(1, 2, 1.1), repeated(2, 3, 2.0), swinging(3, travel=0.4)
    loops = [loop(poses) for poses in (still, walk, run, step)]
    adjusted = fit_to_lap(loops)
    np.testing.assert_allclose([np.hypot(*one.drift[:2]) for one in adjusted], [0.0, 2.2, 4.0, 0.4], atol=1e-9)
    np.testing.assert_allclose([one.duration for one in adjusted], [4.0, 4.0, 4.0, 4.0], atol=1e-9)
    s = np.linspace(0.0, 1.0, 50)
    np.testing.assert_allclose(adjusted[2].channels(s, 0.0 * s), loops[2].channels(s * 2 / 3, 0.0 * s), atol=1e-12)


def test_trimmed_clip_keeps_its_poses_and_stride():
    walk, run = repeated(1, 2, 1.1), repeated(2, 3, 2.0)
    r, z = (0.03, 0.07), (-0.03, 0.03)
    h_map, run_only = (Cylindrical([(c, 30.0) for c in clips], r, z) for clips in ([walk, run] * 2, [run] * 4))
    # In the run's own map a lap has three strides; here it has two, from where they agree best with the walk.
    own = [run_only.pose(stylus(r[0], angle, 0.0)) for angle in np.linspace(0.0, 2 * np.pi, 721)[:-1]]
    for angle in (0.3, 2.0, 4.4):
        pose = h_map.pose(stylus(r[1], angle, 0.0))
        assert min(np.abs(difference(pose, other)[2:]).max() for other in own) < 0.02
    memory, first = h_map.compiled().memory, h_map.pose(stylus(r[1], 0.3, 0.0))
    for angle in np.linspace(0.3, 0.3 + 2 * np.pi, 60):
        pose = h_map.pose(stylus(r[1], angle, 0.0), memory)
    np.testing.assert_allclose(np.hypot(*(pose - first)[:2]), 4.0, atol=1e-6)


def test_lap_of_given_duration_plays_each_clip_a_fitting_number_of_times():
    # 2 s in place, a walk of two strides in 4 s, a run of three in 6 s.
    loops = [loop(poses) for poses in (swinging(4, 60), repeated(1, 2, 1.1), repeated(2, 3, 2.0))]
    durations = np.array([one.duration for one in loops])
    adjusted = fit_to_lap(loops, 6.0)
    assert adjusted[0].share == 3.0
    # Travelling clips have the same number of strides, here three: 1.5 times the walk and once the run.
    strides_a_lap = [adjusted[1].share * 2, adjusted[2].share * 3]
    assert strides_a_lap[0] == strides_a_lap[1] == 3.0
    for before, one in zip(loops, adjusted, strict=True):
        np.testing.assert_allclose(one.drift, one.share * before.drift)
    np.testing.assert_allclose([one.duration for one in adjusted], durations * [one.share for one in adjusted])


def test_clips_not_in_step_keep_nearly_their_own_pace():
    # Cycles of 2 and 0.9 s: two and four of them; in step their numbers are equal.
    loops = [loop(repeated(1, 2, 1.1)), loop(repeated(2, 3, 2.0, 27))]
    durations = [one.duration for one in fit_to_lap(loops, 4.1, apart=True)]
    np.testing.assert_allclose(durations, [4.0, 3.6])
    np.testing.assert_allclose([one.duration for one in fit_to_lap(loops, 4.1)], [4.0, 1.8])


def test_natural_lap_plays_the_first_clip_at_its_own_pace():
    # Cycles of 0.5 s, of 2.1 s in place, and of 0.9 s.
    loops = [loop(repeated(1, 1, 1.1, 15)), loop(swinging(3, 63)), loop(repeated(2, 1, 1.3, 27))]
    for first in range(3):
        order = loops[first:] + loops[:first]
        lap = natural_lap(order)
        assert fit_to_lap(order[:1], lap)[0].duration == pytest.approx(lap)
        assert 3.0 <= lap <= 6.0


@pytest.mark.parametrize(("first", "lap"), [(42, 29.4), (1200, 40.0)])
def test_natural_lap_of_long_clips_leaves_the_hand_fast_enough(first, lap):
    """30 s at most, which keeps 1.4 s and a clip of 70 s as near as possible to their pace, or the first clip alone."""
    assert natural_lap([loop(swinging(4, first)), loop(swinging(5, 2100))]) == pytest.approx(lap)


def test_natural_lap_plays_all_clips_near_their_own_pace_if_possible():
    loops = [loop(swinging(seed, frames)) for seed, frames in ((4, 30), (5, 45), (6, 90))]
    lap = natural_lap(loops)
    paces = [one.duration / lap for one in fit_to_lap(loops, lap)]
    np.testing.assert_allclose(paces, 1.0, atol=0.05)
    assert 3.0 <= lap <= 6.0


def test_number_of_repeats_is_that_of_an_exhaustive_search():
    rng = np.random.default_rng(3)
    for _ in range(300):
        durations, lap = np.exp(rng.uniform(-2.0, 2.0, rng.integers(1, 5))), float(np.exp(rng.uniform(-1.0, 3.0)))
        faster = np.log(np.arange(1, 300)[:, None] * durations / lap)
        best = 1 + np.maximum(-faster, 3.0 * faster).max(axis=1).argmin()
        assert _best_repeat_count(durations, lap) == best
    assert _best_repeat_count(np.array([1.0 / 120.0]), 86_400.0) == 10_368_000
