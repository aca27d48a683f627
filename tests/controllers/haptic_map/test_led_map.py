"""The led figure: the clip itself on a straight path, standing feet without sliding, exact Jacobian."""

import numpy as np
import pytest

from controllers.errors import ParameterError
from controllers.haptic_map.led import Led
from controllers.walking.walked_path import PATH_HEADING, STEP, lay_row, lean_row, path_front, path_value, straight_path
from experiments.fitting.figure_legs import figure_legs
from experiments.setups.parts.led_figure import led_map
from models.mocap.dynamics.contacts import contacts
from models.mocap.library import embedded
from models.mocap.motion.clip import pose_difference
from tests.controllers.clips_for_maps import LEG, difference, swinging, walker
from tests.controllers.figure_soles import slide, soles
from tests.derivatives import central_differences


def winding(gait, bend, length=9.0):
    """A path that turns left and right as far as the gait's support allows, with the corresponding lean."""
    path, lean_state = straight_path(0.3, -0.2, 0.5, gait.reach), 0.0
    while path_front(path) < length:
        lap = (path[0] + 0.5) * STEP / gait.stride
        feet = gait.support[int(len(gait.support) * (lap - np.floor(lap))) % len(gait.support)]
        turn = np.array([0.0, 0.75, 1.0])[feet] * bend * np.sin(1.1 * path[0] * STEP)
        lay_row(path, turn * STEP, bend, turn * gait.speed**2)
        lean_state = lean_row(path, 20, np.exp(-STEP / (gait.speed * 0.32)), lean_state)
    return path


@pytest.mark.parametrize("name", ["walk", "run"])
def test_straight_path_plays_the_clip(figure, name):
    clip = embedded(name)
    led = Led((clip.poses, clip.fps), figure_legs(figure))
    shown = np.array([led.pose(walker(s)) for s in np.linspace(0.0, led.stride, clip.n_frames)])
    gap = pose_difference(clip.poses, shown)
    assert np.degrees(np.abs(gap[:, 6:])).max() < 0.1
    # Closing and centring the loop displaces every frame by the same vector.
    assert np.ptp(gap[:, :3], axis=0).max() < 1e-3


@pytest.mark.parametrize(("name", "bend"), [("walk", 0.7), ("run", 0.2)])
def test_standing_feet_do_not_slide_on_a_bent_path(figure, name, bend):
    clip = embedded(name)
    led, gait = led_map(clip, figure)
    path = winding(gait, bend)
    arguments = np.arange(gait.reach, path_front(path) - gait.reach - 0.2, 0.01)
    shown = soles(figure, [led.pose(walker(s), path) for s in arguments])
    touching = (shown[..., 2] < 0.003).any(axis=1).mean()
    assert touching > 0.5
    assert slide(shown) < 0.03
    # Control: without leg correction the feet are dragged along.
    naive = Led((clip.poses, clip.fps), ())
    naive_path = path.copy()
    dragged = soles(figure, [naive.pose(walker(s), naive_path) for s in arguments])
    assert slide(dragged, 0.01) > 2.0 * slide(shown)


def test_straightening_knee_has_no_jerk_in_a_bend(figure):
    # The run's knees straighten to 3° of flexion before landing, and leaning raises the outer hip.
    clip = embedded("run")
    led, gait = led_map(clip, figure)
    knees = [figure.joint(f"{side}_knee").dofadr[0] + 1 for side in ("left", "right")]

    def jerk(path):
        arguments = np.arange(gait.reach, path_front(path) - gait.reach - 0.2, 0.006)
        shown = np.array([led.pose(walker(s), path) for s in arguments])
        rates = pose_difference(shown[1:], shown[:-1])[:, knees] / (arguments[1] - arguments[0])
        return np.abs(np.diff(rates, axis=0)).max() / (arguments[1] - arguments[0])

    assert jerk(winding(gait, 0.12)) < 1.5 * jerk(winding(gait, 0.0))


def test_pelvis_turns_only_while_a_foot_stands(figure):
    clip = embedded("run")
    led, gait = led_map(clip, figure)
    from controllers.walking.walking import Walking

    shares = Walking(gait).shares
    path = straight_path(0.0, 0.0, 0.0, gait.reach)
    while path_front(path) < 8.0:
        lap = (path[0] + 0.5) * STEP / gait.stride
        lay_row(path, shares[int(len(shares) * (lap - np.floor(lap))) % len(shares)] * 0.3 * STEP, 0.3, 0.0)
    arguments = np.arange(0.5, 7.0, 0.01)
    lap = arguments / gait.stride
    flying = gait.support[(len(gait.support) * (lap - np.floor(lap))).astype(int)] == 0
    straight = led.compiled().memory
    turned = [path_value(path, s, PATH_HEADING)[0] for s in arguments]
    yaw = np.unwrap([_yaw(led.pose(walker(s), path)) - _yaw(led.pose(walker(s), straight)) for s in arguments])
    np.testing.assert_allclose(yaw, turned, atol=1e-9)
    steps = np.abs(np.diff(yaw))
    both = flying[1:] & flying[:-1]
    assert both.sum() > 50
    assert steps[both].max() < 1e-12
    assert steps[~both].max() > 1e-4


def _yaw(pose):
    w, x, y, z = pose[3:7]
    return np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def test_jacobian_matches_finite_differences(figure):
    led, gait = led_map(embedded("walk"), figure)
    path = winding(gait, 0.7)
    for s in np.random.default_rng(2).uniform(0.5, 7.5, 100):
        jacobian = led.jacobian(walker(s), path)
        numeric = central_differences(lambda s: led.pose(walker(s), path), s, 1e-6, difference)
        np.testing.assert_allclose(jacobian[:, 0], numeric, atol=1e-6)
        np.testing.assert_array_equal(jacobian[:, 1:], 0.0)


def test_sideways_clip_faces_sideways_on_its_path():
    poses = swinging(4, travel=0.0)
    poses[:, 1] += 1.2 * np.linspace(0.0, 1.0, len(poses))
    led = Led((poses, 60.0), (LEG,))
    first, last = led.pose(walker(0.0)), led.pose(walker(1.2))
    np.testing.assert_allclose(last[:3] - first[:3], [1.2, 0.0, 0.0], atol=1e-9)
    assert abs(abs(_yaw(first)) - 0.5 * np.pi) < 0.3


@pytest.mark.parametrize(
    ("poses", "message"),
    [(swinging(1), "goes 0.00 m"), (swinging(1, travel=1.0, turns=1.0), "turns 360°")],
    ids=["stands", "spins"],
)
def test_clip_without_net_travel_raises_parameter_error(poses, message):
    with pytest.raises(ParameterError, match=f"must go somewhere.*{message}.*Walk and run do"):
        Led((poses, 60.0), (LEG,))


def test_clip_that_travels_in_a_bend_is_refused_with_advice():
    with pytest.raises(ParameterError, match=r"turns 90°.*cut out a straight part"):
        Led((swinging(1, travel=1.5, turns=0.25), 60.0), (LEG,))


def test_low_swinging_foot_is_not_planted():
    marks = contacts(embedded("walk"))
    assert marks.planted.sum(axis=1).min() == 1
    # A walk stands on both feet for about a quarter of the time; a low swinging foot would increase it.
    assert 0.2 < np.mean(marks.planted.all(axis=1)) < 0.35
    assert np.mean(marks.loaded.all(axis=1)) > 0.5
