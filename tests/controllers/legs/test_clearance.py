"""Feet between the mixtures at which footfalls were found: raised where they would be dragged, else left alone."""

import numpy as np
import pytest
from test_footfalls import LEGS, REST, STILL, N, bump, clip, kicking

from controllers.legs.clearance import cleared
from controllers.legs.footfalls import foot_corrections
from controllers.motion.inbetween import FOOT, ROOT, interpolation

TOUCH = 0.003
# Which of the feet is the lower one when both kick changes soon with the mixture.
CLIPS = np.stack([kicking(0, 0.1, 0.4, ahead=0.6), kicking(1, 0.15, 0.5, ahead=0.6)], axis=1)


def mixtures(count):
    share = np.linspace(0.0, 1.0, count)
    return np.stack([1.0 - share, share], axis=1)


def dragged(clips, values, fine):
    """Way of each foot while it touches, at mixtures between the nodes of values, shape (fine, 2)."""
    weights = mixtures(fine)
    d = np.einsum("ck,nkx->ncx", interpolation(values.shape[1], weights[:, 1]), values)
    d = d[..., ROOT:].reshape(N, fine, 2, FOOT)
    ends = np.einsum("cm,nmk->nck", weights, clips)[..., REST:].reshape(N, fine, 2, 5)
    places, heights = ends[..., :2] + d[..., :2], ends[..., 2] + d[..., 2]
    moved, low = np.linalg.norm(np.diff(places, axis=0), axis=-1), heights < TOUCH
    return (moved * (low[1:] & low[:-1])).sum(axis=0)


def corrected(clips, count):
    nodes = mixtures(count)
    found = foot_corrections(clips, STILL, LEGS, nodes)
    between = mixtures(2 * count - 1)
    return found, cleared(found, clips, STILL, LEGS, nodes, between, interpolation(count, between[:, 1]))


@pytest.mark.parametrize("count", [5, 6, 7])
def test_feet_that_a_coarse_table_drags_are_lifted(count):
    found, raised = corrected(CLIPS, count)
    before, after = (dragged(CLIPS, values, 61) for values in (found, raised))
    own = before[[0, -1]].max()
    assert before.max() > own + 0.02
    assert after.max() < own + 0.4 * (before.max() - own)
    change = raised - found
    upwards = np.zeros(change.shape[2], dtype=bool)
    upwards[ROOT + 2 :: FOOT] = True
    np.testing.assert_array_equal(change[..., ~upwards], 0.0)
    assert change.min() >= 0.0
    assert 0.002 < change.max() < 0.01


def turning(angle):
    """Both feet on the ground, the left one turned to and fro about its middle."""
    channels = clip(*(np.tile([0.0, y, 0.0], (N, 1)) for y in (0.1, -0.1)))
    half = 0.5 * angle * np.sin(2.0 * np.pi * 3.0 * np.arange(N) / N)
    at = 3 + 4 * LEGS[0].joints[2]
    channels[:, at], channels[:, at + 3] = np.cos(half), np.sin(half)
    return channels


@pytest.mark.parametrize(("angle", "lifted"), [(0.6, True), (0.05, False)])
def test_the_toes_of_a_foot_that_turns_in_its_place_sweep_over_the_ground(angle, lifted):
    clips = np.stack([turning(angle), turning(0.0), turning(2.0 * angle)], axis=1)
    nodes = np.array([[0.0, 1.0, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5]])
    raised = cleared(np.zeros((N, 3, ROOT + 2 * FOOT)), clips, np.zeros((3, 3)), LEGS, nodes, nodes, np.eye(3))
    left, right = raised[..., ROOT + 2], raised[..., ROOT + FOOT + 2]
    np.testing.assert_array_equal(right, 0.0)
    np.testing.assert_array_equal(left[:, 0], 0.0)
    assert (left[:, 1:].max() > 0.003) == lifted
    assert (left.max() > 0.0) == lifted


def test_a_foot_that_sinks_between_the_nodes_is_lifted_there():
    found = foot_corrections(CLIPS, STILL, LEGS, mixtures(5))
    found[:, 2, ROOT + FOOT + 2] -= 0.02 * bump(0.7, 0.95)[1]
    between = mixtures(9)
    shares = interpolation(5, between[:, 1])
    raised = cleared(found, CLIPS, STILL, LEGS, mixtures(5), between, shares)
    mean = np.einsum("cm,nmk->nck", between, CLIPS)[..., REST + 5 + 2]
    before, after = (mean + np.einsum("ck,nkx->ncx", shares, d)[..., ROOT + FOOT + 2] for d in (found, raised))
    assert before.min() < -0.018
    assert after.min() > -0.0065


def test_feet_are_lifted_in_full_beside_a_clip_alone():
    """Of the mixtures next to the corner, 4 % of the other clip drag a foot as 50 % do."""
    nodes = np.array([[1.0, 0.0], [0.96, 0.04], [0.5, 0.5], [0.0, 1.0]])
    slow = np.stack([kicking(0, 0.1, 0.4, height=0.0, ahead=0.3), kicking(0, 0.1, 0.4, height=0.0, ahead=0.3)], axis=1)
    slow[:, 1, REST + 1] += 0.01
    raised = cleared(np.zeros((N, 4, ROOT + 2 * FOOT)), slow, STILL, LEGS, nodes, nodes, np.eye(4))[..., ROOT + 2]
    np.testing.assert_array_equal(raised[:, [0, 3]], 0.0)
    assert raised[:, 1].max() > 0.9 * raised[:, 2].max() > 0.003


def test_a_clip_that_is_given_twice_counts_as_one():
    clips = np.stack([CLIPS[:, 0], CLIPS[:, 0], CLIPS[:, 1]], axis=1)
    nodes = np.array([[1.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.0, 0.0, 1.0]])
    found = foot_corrections(clips, np.zeros((3, 3)), LEGS, nodes)
    raised = cleared(found, clips, np.zeros((3, 3)), LEGS, nodes, nodes, np.full((3, 3), 1.0 / 3.0))
    np.testing.assert_array_equal(raised, found)


def test_a_clip_alone_and_feet_that_are_not_dragged_are_left_as_they_are():
    found, raised = corrected(CLIPS, 5)
    np.testing.assert_array_equal(raised[:, [0, -1]], found[:, [0, -1]])
    small = np.stack([kicking(0, 0.1, 0.4, ahead=0.01), kicking(1, 0.15, 0.5, ahead=0.01)], axis=1)
    found, raised = corrected(small, 5)
    np.testing.assert_array_equal(raised, found)


def test_a_lift_has_no_jump():
    found, raised = corrected(CLIPS, 5)
    change = (raised - found)[..., ROOT + 2 :: FOOT]
    steps = np.abs(np.diff(np.concatenate([change, change[:1]]), axis=0))
    # It takes two hundredths of the lap to come.
    assert steps.max() < 0.5 * change.max()
