"""The led figure: the clip itself where its path is straight, feet that stay where they stand, exact derivatives."""

import numpy as np
import pytest

from controllers.errors import ParameterError
from controllers.haptic_map.led import Led
from controllers.walking.walked_path import PATH_HEADING, STEP, lay_row, lean_row, path_front, path_value, straight_path
from experiments.fitting.figure_legs import figure_legs
from experiments.setups.parts.led_figure import led_map
from models.humanoid.skeleton import figure_model
from models.mocap.dynamics.contacts import contacts
from models.mocap.library import embedded
from models.mocap.motion.clip import pose_difference
from tests.controllers.clips_for_maps import LEG, difference, swinging
from tests.controllers.figure_soles import slide, soles


def walker(s):
    return np.array([s, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])


def winding(gait, bend, length=9.0):
    """A path that turns left and right, as far as the gait's support allows, and the lean that goes with it."""
    path, past = straight_path(0.3, -0.2, 0.5, gait.reach), 0.0
    while path_front(path) < length:
        lap = (path[0] + 0.5) * STEP / gait.stride
        feet = gait.support[int(len(gait.support) * (lap - np.floor(lap))) % len(gait.support)]
        turn = np.array([0.0, 0.75, 1.0])[feet] * bend * np.sin(1.1 * path[0] * STEP)
        lay_row(path, turn * STEP, bend, turn * gait.speed**2)
        past = lean_row(path, 20, np.exp(-STEP / (gait.speed * 0.32)), past)
    return path


@pytest.fixture(scope="module")
def figure():
    return figure_model()


@pytest.mark.parametrize("name", ["walk", "run"])
def test_straight_on_the_figure_does_what_the_clip_does(figure, name):
    clip = embedded(name)
    led = Led((clip.poses, clip.fps), figure_legs(figure))
    shown = np.array([led.pose(walker(s)) for s in np.linspace(0.0, led.stride, clip.n_frames)])
    gap = pose_difference(clip.poses, shown)
    assert np.degrees(np.abs(gap[:, 6:])).max() < 0.1
    # Moved over the floor by what closing and centring the loop takes, the same for every frame.
    assert np.ptp(gap[:, :3], axis=0).max() < 1e-3


@pytest.mark.parametrize(("name", "bend"), [("walk", 0.7), ("run", 0.2)])
def test_feet_that_stand_stay_where_they_stand(figure, name, bend):
    clip = embedded(name)
    led, gait = led_map(clip, figure)
    path = winding(gait, bend)
    places = np.arange(gait.reach, path_front(path) - gait.reach - 0.2, 0.01)
    shown = soles(figure, [led.pose(walker(s), path) for s in places])
    touching = (shown[..., 2] < 0.003).any(axis=1).mean()
    assert touching > 0.5
    assert slide(shown) < 0.03
    # Without a clock of their own feet are dragged round: the control that must fail.
    naive = Led((clip.poses, clip.fps), ())
    naive_path = path.copy()
    dragged = soles(figure, [naive.pose(walker(s), naive_path) for s in places])
    assert slide(dragged, 0.01) > 2.0 * slide(shown)


def test_a_knee_that_straightens_in_a_bend_is_not_stopped(figure):
    # The run's legs reach out to 3° of flexion before they land; leaning raises the outer hip.
    clip = embedded("run")
    led, gait = led_map(clip, figure)
    knees = [figure.joint(f"{side}_knee").dofadr[0] + 1 for side in ("left", "right")]

    def jerk(path):
        places = np.arange(gait.reach, path_front(path) - gait.reach - 0.2, 0.006)
        shown = np.array([led.pose(walker(s), path) for s in places])
        rates = pose_difference(shown[1:], shown[:-1])[:, knees] / (places[1] - places[0])
        return np.abs(np.diff(rates, axis=0)).max() / (places[1] - places[0])

    assert jerk(winding(gait, 0.12)) < 1.5 * jerk(winding(gait, 0.0))


def test_the_pelvis_turns_only_while_a_foot_bears(figure):
    clip = embedded("run")
    led, gait = led_map(clip, figure)
    from controllers.walking.walking import Walking

    shares = Walking(gait).shares
    path = straight_path(0.0, 0.0, 0.0, gait.reach)
    while path_front(path) < 8.0:
        lap = (path[0] + 0.5) * STEP / gait.stride
        lay_row(path, shares[int(len(shares) * (lap - np.floor(lap))) % len(shares)] * 0.3 * STEP, 0.3, 0.0)
    places = np.arange(0.5, 7.0, 0.01)
    lap = places / gait.stride
    flying = gait.support[(len(gait.support) * (lap - np.floor(lap))).astype(int)] == 0
    straight = led.compiled().memory
    turned = [path_value(path, s, PATH_HEADING)[0] for s in places]
    yaw = np.unwrap([_yaw(led.pose(walker(s), path)) - _yaw(led.pose(walker(s), straight)) for s in places])
    np.testing.assert_allclose(yaw, turned, atol=1e-9)
    steps = np.abs(np.diff(yaw))
    both = flying[1:] & flying[:-1]
    assert both.sum() > 50
    assert steps[both].max() < 1e-12
    assert steps[~both].max() > 1e-4


def _yaw(pose):
    w, x, y, z = pose[3:7]
    return np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def test_the_derivative_is_that_of_the_pose(figure):
    led, gait = led_map(embedded("walk"), figure)
    path, h = winding(gait, 0.7), 1e-6
    for s in np.random.default_rng(2).uniform(0.5, 7.5, 100):
        jacobian = led.jacobian(walker(s), path)
        before, after = led.pose(walker(s - h), path), led.pose(walker(s + h), path)
        np.testing.assert_allclose(jacobian[:, 0], difference(after, before) / (2.0 * h), atol=1e-6)
        np.testing.assert_array_equal(jacobian[:, 1:], 0.0)


def test_a_clip_that_walks_sideways_faces_sideways_on_its_path():
    poses = swinging(4, travel=0.0)
    poses[:, 1] += 1.2 * np.linspace(0.0, 1.0, len(poses))
    led = Led((poses, 60.0), (LEG,))
    first, last = led.pose(walker(0.0)), led.pose(walker(1.2))
    np.testing.assert_allclose(last[:3] - first[:3], [1.2, 0.0, 0.0], atol=1e-9)
    assert abs(abs(_yaw(first)) - 0.5 * np.pi) < 0.3


@pytest.mark.parametrize(
    ("poses", "says"),
    [(swinging(1), "goes 0.00 m"), (swinging(1, travel=1.0, turns=1.0), "turns 360°")],
    ids=["stands", "spins"],
)
def test_a_clip_that_goes_nowhere_is_refused(poses, says):
    with pytest.raises(ParameterError, match=f"must go somewhere.*{says}.*Walk and run do"):
        Led((poses, 60.0), (LEG,))


def test_a_foot_that_swings_low_is_not_planted():
    marks = contacts(embedded("walk"))
    assert marks.planted.sum(axis=1).min() == 1
    # A walk stands on both feet for about a quarter of its time; a skidding sole would make it more.
    assert 0.2 < np.mean(marks.planted.all(axis=1)) < 0.35
    assert np.mean(marks.loaded.all(axis=1)) > 0.5
