"""The grounded form of a gait with flight: no flight, feet stand where they do in the clip, legs are long enough."""

import numpy as np
import pytest

from controllers.haptic_map.led import Led
from experiments.fitting.figure_legs import figure_legs
from experiments.setups.parts.led_figure import led_map
from models.mocap.dynamics.contacts import contacts
from models.mocap.library import embedded
from models.mocap.motion.clip import pose_difference
from tests.controllers.clips_for_maps import walker
from tests.controllers.figure_soles import slide, soles
from tests.derivatives import central_differences


@pytest.fixture(scope="module")
def run(figure):
    return led_map(embedded("run"), figure)


def test_grounded_run_has_no_flight_and_no_foot_skate(figure, run):
    led, gait = run
    arguments = np.arange(0.0, gait.stride, 0.01)
    flown, held = (soles(figure, [led.pose(walker(s, u)) for s in arguments]) for u in (0.0, 1.0))
    lowest = held[..., 2].min(axis=1)
    assert flown[..., 2].min(axis=1).max() > 0.03
    # Less than the tolerance of the physical figure's contact points (`sim.body.figure_state`).
    assert lowest.max() < 0.005
    assert lowest.min() > -0.005
    assert slide(held) < 0.01
    both = (held[:, :4, 2].min(axis=1) < 0.003) & (held[:, 4:, 2].min(axis=1) < 0.003)
    assert 0.01 < both.mean() < 0.2


def test_feet_stand_where_they_stand_in_the_clip(figure, run):
    led, gait = run
    arguments = np.arange(0.0, gait.stride, 0.01)
    flown, held = (soles(figure, [led.pose(walker(s, u)) for s in arguments]) for u in (0.0, 1.0))
    flat = (flown[..., 2] < 0.003) & (held[..., 2] < 0.003)
    assert flat.sum() > 500
    assert np.linalg.norm(flown[..., :2] - held[..., :2], axis=-1)[flat].max() < 0.02


def test_root_height_is_nearly_constant_and_knees_stay_bendable(run):
    led, gait = run
    poses = np.array([led.pose(walker(s, 1.0)) for s in np.arange(0.0, gait.stride, 0.02)])
    clip = np.array([led.pose(walker(s, 0.0)) for s in np.arange(0.0, gait.stride, 0.02)])
    assert np.ptp(clip[:, 2]) > 0.08
    assert np.ptp(poses[:, 2]) < 0.03
    assert poses[:, 2].max() < clip[:, 2].min()
    for knee in (12, 16):
        bend = 2.0 * np.degrees(np.arccos(np.clip(np.abs(poses[:, 3 + 4 * knee]), 0.0, 1.0)))
        assert bend.max() < 140.0


@pytest.mark.parametrize("held", [0.0, 0.3, 1.0])
def test_jacobian_by_argument_and_blend_matches_finite_differences(run, held):
    led, gait = run
    tangent = lambda end, start: pose_difference(start, end)  # noqa: E731
    for s in np.random.default_rng(5).uniform(0.0, gait.stride, 25):
        jacobian = led.jacobian(walker(s, held))
        numeric = central_differences(lambda x: led.pose(walker(*x)), [s, held], 1e-6, tangent)
        np.testing.assert_allclose(jacobian[:, :2], numeric, atol=2e-6)
        assert np.abs(numeric[:, 1]).max() > 0.05


def test_walk_has_no_grounded_form(figure):
    led, gait = led_map(embedded("walk"), figure)
    assert not led.has_grounded_form
    assert not gait.flies
    np.testing.assert_array_equal(led.pose(walker(0.7, 1.0)), led.pose(walker(0.7, 0.0)))
    np.testing.assert_array_equal(led.jacobian(walker(0.7, 1.0))[:, 1], 0.0)


def test_one_legged_hop_cannot_be_grounded(figure):
    clip = embedded("run")
    standing = contacts(clip).planted[:-1]
    hop = np.column_stack([standing.any(axis=1), np.zeros(len(standing), dtype=bool)])
    hop[: len(hop) // 2] = False
    assert Led((clip.poses, clip.fps), figure_legs(figure), standing=standing).has_grounded_form
    # After a flight of more than half a lap onto the same foot its earlier and later stances would overlap.
    assert not Led((clip.poses, clip.fps), figure_legs(figure), standing=hop).has_grounded_form
