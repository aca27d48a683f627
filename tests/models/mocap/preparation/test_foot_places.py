"""Places of the contact spheres of a foot in a stance, on motions of known places."""

import numpy as np
import pytest

from models.humanoid.skeleton import CONTACT_RADIUS, FOOT_CONTACTS, soles
from models.mocap.preparation.foot_places import foot_turns, place_foot
from models.mocap.preparation.stances import Stances, clearance

FPS = 120.0
SOLE = soles()[:4]
TOE = FOOT_CONTACTS.index("left_toe_in")
REST_FRAMES, TURN_FRAMES, N = 40, 50, 130  # frames of rest before the turn, of the turn and of the stance


def turning(angle: float, pivot: int):
    """Headings, and sphere centres of a foot that rests, turns about one sphere at (1, 2), and rests again."""
    x = np.clip((np.arange(N) - REST_FRAMES) / TURN_FRAMES, 0.0, 1.0)
    yaw = 0.3 + angle * x**2 * (3.0 - 2.0 * x)
    c, s = np.cos(yaw), np.sin(yaw)
    arm = SOLE[:, :2] - SOLE[pivot, :2]
    level = np.einsum("ijn,sj->nsi", np.array([[c, -s], [s, c]]), arm) + np.array([1.0, 2.0])
    return yaw, np.concatenate((level, np.full((N, 4, 1), CONTACT_RADIUS)), axis=2)


def placed(yaw, points, load=1.0):
    standing, places = np.ones((N, 4), bool), np.full((N, 4, 3), CONTACT_RADIUS)
    turned = foot_turns(np.gradient(yaw) * FPS, np.full(N, load), FPS)
    place_foot(points, yaw, SOLE, np.ones((N, 2), bool), turned, standing, places)
    return standing, places


@pytest.mark.parametrize("pivot", [TOE, 0])
def test_turning_foot_stands_on_the_sphere_that_moves_least(pivot):
    yaw, points = turning(np.pi / 2.0, pivot)
    standing, places = placed(yaw, points)
    alone = standing.sum(axis=1) == 1
    assert standing[alone][:, pivot].all()
    assert alone[REST_FRAMES + 10 : REST_FRAMES + TURN_FRAMES - 10].all()
    assert standing[:REST_FRAMES].all()
    assert standing[REST_FRAMES + TURN_FRAMES :].all()
    # The median heading of the frames before the turn hardly differs from that at rest.
    np.testing.assert_allclose(places[standing], points[standing], atol=0.02)
    np.testing.assert_allclose(places[:, pivot], np.broadcast_to(places[0, pivot], (N, 3)), atol=1e-12)


def test_unloaded_or_slightly_turning_foot_keeps_one_place():
    yaw, points = turning(np.pi / 2.0, TOE)
    assert placed(yaw, points, load=0.2)[0].all()
    yaw, points = turning(np.deg2rad(40.0), TOE)
    standing, places = placed(yaw, points)
    assert standing.all()
    np.testing.assert_allclose(places, np.broadcast_to(places[0], places.shape))


def test_consecutive_turns_give_continuous_places():
    yaw, points = turning(np.pi / 2.0, TOE)
    second_yaw, second = turning(-np.pi / 2.0, 1)
    # The second turn begins where the first ended, about the inner heel.
    shift = points[-1, 1] - second[0, 1]
    c, s = np.cos(yaw[-1] - second_yaw[0]), np.sin(yaw[-1] - second_yaw[0])
    moved = (second - second[0, 1]) @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) + second[0, 1] + shift
    spheres, headings = np.concatenate((points, moved)), np.concatenate((yaw, second_yaw + yaw[-1] - second_yaw[0]))
    n = len(spheres)
    standing, places = np.ones((n, 4), bool), np.full((n, 4, 3), CONTACT_RADIUS)
    turned = foot_turns(np.gradient(headings) * FPS, np.ones(n), FPS)
    assert len(turned) == 2
    place_foot(spheres, headings, SOLE, np.ones((n, 2), bool), turned, standing, places)
    np.testing.assert_allclose(places[standing], spheres[standing], atol=0.02)
    jumps = np.linalg.norm(np.diff(places, axis=0), axis=2)
    assert jumps[standing[1:] & standing[:-1]].max() < 1e-12


def test_spheres_beside_the_pivot_of_a_turning_foot_are_lifted():
    yaw, points = turning(np.pi / 2.0, TOE)
    standing, places = placed(yaw, points)
    both_feet = np.hstack((standing, np.ones((N, 4), bool)))
    least = clearance(
        Stances(both_feet, both_feet, np.hstack((places, places)), np.zeros_like(both_feet), both_feet * 1.0),
        FPS,
        False,
    )
    middle, others = REST_FRAMES + TURN_FRAMES // 2, np.arange(4) != TOE
    # Below 8 mm the tracking controller takes a sphere for a standing one.
    assert (least[middle, :4][others] > 0.008).all()
    assert least[middle, TOE] == 0.0
    assert not least[:REST_FRAMES].any()
    assert not least[:, 4:].any()
