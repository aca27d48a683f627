"""Stances of feet, which are held, and their load."""

import numpy as np
import pytest

from models.humanoid.skeleton import CONTACT_RADIUS
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip
from models.mocap.motion.kinematics import sole_points
from models.mocap.preparation.contact_loads import contact_forces
from models.mocap.preparation.poses import resampled
from models.mocap.preparation.stances import stances, with_feet_at_rest


def test_motion_that_ends_lying_gets_no_additional_foot_stances():
    dance = resampled(embedded("cheer"), 120.0)
    lying = Clip(dance.poses[:60] - np.eye(dance.poses.shape[1])[2] * 0.6, 120.0, "low")
    np.testing.assert_array_equal(
        with_feet_at_rest(stances(lying, lying), lying).standing, stances(lying, lying).standing
    )


def test_feet_in_the_air_bear_no_load():
    flip = resampled(embedded("backflip"), 120.0)
    rough = Clip(flip.poses + 1e-3 * np.random.default_rng(0).normal(size=flip.poses.shape), 120.0, "rough")
    schedule = stances(flip, rough)
    high = sole_points(flip.poses)[:, :, 2] > CONTACT_RADIUS + 0.15
    assert high.any()
    assert not (schedule.pushing & high).any()


def test_feet_of_a_walk_stand_alternately(walks):
    schedule = stances(walks[0], walks[0])
    left, right = schedule.standing[:, :4].any(axis=1), schedule.standing[:, 4:].any(axis=1)
    assert 0.5 < left.mean() < 0.75
    assert (left | right).all()
    assert not (left & right).all()


@pytest.fixture(scope="module")
def hop():
    """A closed clip of 4 s in which a standing body hops once at 1 s and drifts by 2 cm and back."""
    still = resampled(embedded("cheer"), 120.0).poses[0]
    poses = np.repeat(still[None], 480, axis=0)
    t = np.arange(480) / 479.0
    poses[:, 0] += 0.02 * np.sin(2.0 * np.pi * t)
    poses[:, 2] += 0.3 * np.maximum(0.0, 1.0 - ((t - 0.25) / 0.05) ** 2)
    return Clip(poses, 120.0, "hop")


def test_stance_across_the_seam_has_one_place(hop):
    schedule = stances(hop, hop)
    assert hop.closes()
    assert schedule.standing[[0, -1]].all()
    assert not schedule.standing.all(axis=1).all()
    np.testing.assert_allclose(schedule.places[0], schedule.places[-1], atol=1e-9)


def test_place_weight_ramps_linearly_beside_a_stance(walks):
    schedule = stances(walks[0], walks[0])
    weight, standing = schedule.kept[:, 0], schedule.standing[:, 0]
    lands = int(np.flatnonzero(np.diff(standing.astype(int)) > 0)[0]) + 1
    rising = weight[lands - 7 : lands + 1]
    np.testing.assert_allclose(rising, np.arange(8) / 7.0, atol=1e-12)
    np.testing.assert_array_equal(schedule.places[lands - 6 : lands, 0], np.tile(schedule.places[lands, 0], (6, 1)))
    assert (weight[standing] == 1.0).all()


def test_place_weight_is_zero_in_flight(hop):
    schedule = stances(hop, hop)
    flies = ~schedule.standing.any(axis=1)
    assert flies.any()
    assert (schedule.kept[flies] == 0.0).all()


def test_feet_that_slide_under_load_are_kept_where_they_were_captured():
    still = resampled(embedded("cheer"), 120.0).poses[0]
    poses = np.repeat(still[None], 120, axis=0)
    poses[:, 0] += 1.5 * np.arange(120) / 120.0  # [m], in a second
    slides = Clip(poses, 120.0, "slides")
    schedule = with_feet_at_rest(stances(slides, slides), slides)
    middle = slice(30, 90)
    assert schedule.sliding[middle].all()
    np.testing.assert_array_equal(schedule.kept[middle], 1.0)
    np.testing.assert_allclose(schedule.places[middle, :, :2], sole_points(poses)[middle, :, :2], atol=1e-12)
    np.testing.assert_array_equal(schedule.places[middle, :, 2], CONTACT_RADIUS)


def test_mean_load_of_a_walk_is_the_body_weight(walks):
    walk = walks[0]
    loads = contact_forces(walk, stances(walk, walk)).loads.sum(axis=1)
    assert loads.mean() == pytest.approx(1.0, abs=0.05)
