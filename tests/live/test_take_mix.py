"""Mixing of takes: a region is taken from another take at equal phase of the curve."""

import numpy as np
import pytest

from controllers.errors import ParameterError
from experiments.live.panels.takes_panel import next_name
from experiments.live.session.take_mix import FPS, Region, TakeData, between, mixed

LAP = 4.0


def take(name: str, seconds: float, pace: float, height: float, start: float = 0.0) -> TakeData:
    """A take in which the root's x tells the phase, its z the take, and the first joint turns with the phase."""
    t = np.arange(0.0, seconds, 1.0 / FPS)
    phase = start + pace * t
    poses = np.zeros((len(t), 75))
    poses[:, 0], poses[:, 2], poses[:, 3::4] = phase % LAP, height, 1.0
    poses[:, 7], poses[:, 8] = np.cos(0.3 * phase), np.sin(0.3 * phase)
    none = np.zeros(len(t))
    return TakeData(name, poses, phase / LAP, True, np.zeros((len(t), 3)), none, none)


def test_mix_uses_the_other_take_at_equal_phase_inside_the_region():
    one, other = take("one", 6.0, 0.5, 1.0), take("other", 4.0, 1.0, 2.0)
    poses = mixed(one, [Region(1.0, 4.0, other)], ease=0.3)
    t = one.times
    outside, inside = (t < 1.0) | (t > 4.0), (t > 1.35) & (t < 3.65)
    np.testing.assert_array_equal(poses[outside], one.poses[outside])
    np.testing.assert_allclose(poses[inside, 2], 2.0, atol=1e-12)
    np.testing.assert_allclose(poses[inside, 0], 0.5 * t[inside], atol=1e-9)  # the same phase, not the same time


def test_mix_eases_between_the_takes():
    one, other = take("one", 6.0, 1.0, 1.0), take("other", 6.0, 1.0, 2.0)
    height = mixed(one, [Region(1.0, 3.0, other)], ease=0.5)[:, 2]
    assert np.abs(np.diff(height)).max() < 1.9 / 0.5 / FPS  # the steepest of the ease is 15/8
    assert np.abs(np.diff(height, n=2)).max() < 6.0 / 0.5**2 / FPS**2
    assert np.all((height >= 1.0) & (height <= 2.0))


def test_mixed_quaternions_stay_normalised():
    one, other = take("one", 6.0, 1.0, 1.0), take("other", 6.0, 0.7, 2.0)
    poses = mixed(one, [Region(1.0, 3.0, other)])
    np.testing.assert_allclose(np.linalg.norm(poses[:, 3:].reshape(len(poses), -1, 4), axis=2), 1.0, atol=1e-12)
    half = between(one.poses[:1], one.poses[50:51], np.array([0.5]))
    np.testing.assert_allclose(half[0, 7:9], [np.cos(0.15), np.sin(0.15)], atol=1e-12)


def test_other_take_may_be_in_another_lap():
    one, other = take("one", 6.0, 1.0, 1.0), take("other", 6.0, 1.0, 2.0, start=8.0)
    poses = mixed(one, [Region(1.0, 3.0, other)])
    inside = (one.times > 1.4) & (one.times < 2.6)
    np.testing.assert_allclose(poses[inside, 0], one.poses[inside, 0], atol=1e-9)
    np.testing.assert_allclose(poses[inside, 2], 2.0, atol=1e-12)


@pytest.mark.parametrize(
    ("start", "end", "message"), [(3.0, 2.0, "two times"), (1.0, 9.0, "two times"), (1.0, 1.2, "lasts 0.20 s")]
)
def test_invalid_region_is_refused(start, end, message):
    one = take("one", 6.0, 1.0, 1.0)
    with pytest.raises(ParameterError, match=message):
        mixed(one, [Region(start, end, one)])


def test_take_without_the_phases_of_the_region_is_refused():
    one, short = take("one", 6.0, 0.5, 1.0), take("short", 1.0, 0.5, 2.0)
    with pytest.raises(ParameterError, match="both takes go through"):
        mixed(one, [Region(1.0, 5.0, short)])


def test_next_take_name_has_the_next_number():
    assert next_name("take 1") == "take 2"
    assert next_name("take 19") == "take 20"
    assert next_name("proud") == "proud 2"
