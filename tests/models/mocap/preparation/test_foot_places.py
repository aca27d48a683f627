"""Places of a foot in a stance, of motions whose places are known."""

import numpy as np
import pytest

from models.humanoid.skeleton import CONTACT_RADIUS, FOOT_CONTACTS, soles
from models.mocap.preparation.foot_places import place_foot, turns
from models.mocap.preparation.stances import Stances, clearance

FPS = 120.0
SOLE = soles()[:4]
TOE = FOOT_CONTACTS.index("left_toe_in")
STANDS, TURNS, N = 40, 50, 130  # frames of rest before a turn and of the turn, frames of the stance


def turning(angle: float, pivot: int):
    """Headings, and sphere centres of a foot that rests, turns about one sphere at (1, 2), and rests again."""
    x = np.clip((np.arange(N) - STANDS) / TURNS, 0.0, 1.0)
    yaw = 0.3 + angle * x**2 * (3.0 - 2.0 * x)
    c, s = np.cos(yaw), np.sin(yaw)
    arm = SOLE[:, :2] - SOLE[pivot, :2]
    level = np.einsum("ijn,sj->nsi", np.array([[c, -s], [s, c]]), arm) + np.array([1.0, 2.0])
    return yaw, np.concatenate((level, np.full((N, 4, 1), CONTACT_RADIUS)), axis=2)


def placed(yaw, points, load=1.0):
    standing, places = np.ones((N, 4), bool), np.full((N, 4, 3), CONTACT_RADIUS)
    turned = turns(np.gradient(yaw) * FPS, np.full(N, load), FPS)
    place_foot(points, yaw, SOLE, np.ones((N, 2), bool), turned, standing, places)
    return standing, places


@pytest.mark.parametrize("pivot", [TOE, 0])
def test_a_foot_that_turns_stands_on_the_sphere_that_moves_least(pivot):
    yaw, points = turning(np.pi / 2.0, pivot)
    standing, places = placed(yaw, points)
    alone = standing.sum(axis=1) == 1
    assert standing[alone][:, pivot].all()
    assert alone[STANDS + 10 : STANDS + TURNS - 10].all()
    assert standing[:STANDS].all()
    assert standing[STANDS + TURNS :].all()
    # The median heading of the frames before the turn hardly differs from that at rest.
    np.testing.assert_allclose(places[standing], points[standing], atol=0.02)
    np.testing.assert_allclose(places[:, pivot], np.broadcast_to(places[0, pivot], (N, 3)), atol=1e-12)


def test_a_foot_that_is_not_loaded_or_turns_little_has_one_heading():
    yaw, points = turning(np.pi / 2.0, TOE)
    assert placed(yaw, points, load=0.2)[0].all()
    yaw, points = turning(np.deg2rad(40.0), TOE)
    standing, places = placed(yaw, points)
    assert standing.all()
    np.testing.assert_allclose(places, np.broadcast_to(places[0], places.shape))


def test_turns_one_after_the_other_hang_together():
    yaw, points = turning(np.pi / 2.0, TOE)
    there, again = turning(-np.pi / 2.0, 1)
    # The second turn begins where the first ended, about the inner heel.
    shift = points[-1, 1] - again[0, 1]
    c, s = np.cos(yaw[-1] - there[0]), np.sin(yaw[-1] - there[0])
    moved = (again - again[0, 1]) @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) + again[0, 1] + shift
    both, heads = np.concatenate((points, moved)), np.concatenate((yaw, there + yaw[-1] - there[0]))
    n = len(both)
    standing, places = np.ones((n, 4), bool), np.full((n, 4, 3), CONTACT_RADIUS)
    turned = turns(np.gradient(heads) * FPS, np.ones(n), FPS)
    assert len(turned) == 2
    place_foot(both, heads, SOLE, np.ones((n, 2), bool), turned, standing, places)
    np.testing.assert_allclose(places[standing], both[standing], atol=0.02)
    jumps = np.linalg.norm(np.diff(places, axis=0), axis=2)
    assert jumps[standing[1:] & standing[:-1]].max() < 1e-12


def test_the_other_spheres_of_a_foot_that_turns_are_lifted():
    yaw, points = turning(np.pi / 2.0, TOE)
    standing, places = placed(yaw, points)
    both = np.hstack((standing, np.ones((N, 4), bool)))
    least = clearance(Stances(both, both, np.hstack((places, places)), np.zeros_like(both), both * 1.0), FPS, False)
    middle, others = STANDS + TURNS // 2, np.arange(4) != TOE
    # The tracking controller takes a sphere below 8 mm for a standing one.
    assert (least[middle, :4][others] > 0.008).all()
    assert least[middle, TOE] == 0.0
    assert not least[:STANDS].any()
    assert not least[:, 4:].any()
