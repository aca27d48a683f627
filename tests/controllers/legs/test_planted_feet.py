"""Feet of a led capture stand where they stand, on any path: what the capture slides and hovers is taken from it."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from controllers.haptic_map.led import Led
from controllers.legs.planted import levels, planted_ends, window
from controllers.motion.captures import Capture
from controllers.walking.walked_path import STEP, lay_row, path_front, straight_path
from experiments.config.modes import Lead
from experiments.fitting.figure_legs import figure_legs
from experiments.setups.modes.lead import leading
from experiments.setups.parts.led_figure import led_map
from models.humanoid.skeleton import JOINTS, figure_model
from models.mocap.library import embedded, load_clip
from models.mocap.motion.clip import Clip
from tests.controllers.clips_for_maps import difference
from tests.controllers.figure_soles import slide, soles

MOCAP = Path(__file__).parents[4] / "shared" / "mocap"
ANKLE = slice(7 + 4 * JOINTS.index("left_ankle"), 11 + 4 * JOINTS.index("left_ankle"))
CAPTURES = (
    "cmu_amc/02_01.amc", "cmu_amc/02_03.amc", "cmu_amc/16_09.amc", "deepmimic/humanoid3d_walk.txt",
    "deepmimic/humanoid3d_run.txt", "snu/walk.bvh", "snu/run.bvh", "xia/strutting_01_000.bvh", "xia/angry_13_000.bvh",
    "xia/dme_example.bvh",
)  # fmt: skip


def walker(s: float, held: float = 0.0) -> np.ndarray:
    return np.array([s, held, 0.0, 1.0, 0.0, 0.0, 0.0])


def bent_path(gait, bend: float, length: float) -> np.ndarray:
    """A path that turns left and right while a foot stands."""
    path = straight_path(0.0, 0.0, 0.2, gait.reach)
    while path_front(path) < length:
        lap = (path[0] + 0.5) * STEP / gait.stride
        feet = gait.support[int(len(gait.support) * (lap - np.floor(lap))) % len(gait.support)]
        turn = min(feet, 1) * bend * np.sin(1.5 * path[0] * STEP)
        lay_row(path, turn * STEP, bend, 0.0)
    return path


@pytest.fixture(scope="module")
def figure():
    return figure_model()


def skating(name: str) -> Clip:
    """A clip of the package whose feet slide by a sixth of their way, turn, and hover."""
    clip = embedded(name)
    poses, share = clip.poses.copy(), np.linspace(0.0, 1.0, clip.n_frames)
    poses[:, 0] *= 1.15
    poses[:, 1] += 0.03 * np.sin(2.0 * np.pi * share)
    poses[:, 2] += 0.012 + 0.006 * np.cos(2.0 * np.pi * share)
    # A foot lies on its outer edge, and it does not quite close either.
    roll = Rotation.from_euler("x", np.radians(6.0))
    poses[:, ANKLE] = (Rotation.from_quat(poses[:, ANKLE], scalar_first=True) * roll).as_quat(scalar_first=True)
    poses[-20:, 7:11] = poses[-21, 7:11]
    return Clip(poses, clip.fps, name)


def test_windows_are_one_within_the_runs_of_a_mask() -> None:
    stands = np.zeros(100, dtype=bool)
    stands[80:], stands[:30] = True, True
    stays = window(stands, 0.1)
    np.testing.assert_array_equal(stays[~stands], 0.0)
    np.testing.assert_array_equal(stays[[*range(86, 100), *range(24)]], 1.0)
    assert 0.0 < stays[80] < stays[82] < 1.0
    assert stays[29] == stays[80]
    np.testing.assert_array_equal(window(np.ones(5, dtype=bool), 0.1), 1.0)
    heights = np.where(stands, 0.02, 0.3)
    np.testing.assert_allclose(levels(heights, stands), 0.02, atol=1e-12)


@pytest.mark.parametrize("name", ["walk", "run"])
def test_a_clip_that_skates_stands_on_a_bent_path(figure, name: str) -> None:
    clip = skating(name)
    led, gait = led_map(clip, figure)
    path = bent_path(gait, 0.5, 7.0)
    places = np.arange(gait.reach, path_front(path) - gait.reach - 0.2, 0.01)
    shown = soles(figure, [led.pose(walker(s), path) for s in places])
    # Standing feet touch, and none goes through the floor.
    assert (shown[..., 2].min(axis=1) < 0.003).mean() > (0.95 if name == "walk" else 0.6)
    assert shown[..., 2].min() > -0.008
    assert slide(shown) < 0.015
    skates = Led((clip.poses, clip.fps), figure_legs(figure), led.phase)
    assert slide(soles(figure, [skates.pose(walker(s), path) for s in places]), 0.02) > 0.05


def test_a_foot_that_stands_lies_level(figure) -> None:
    clip = skating("walk")
    led, gait = led_map(clip, figure)
    shown = soles(figure, [led.pose(walker(s)) for s in np.arange(0.0, gait.stride, 0.01)])
    toes, heels = shown[:, 2:4], shown[:, 0:2]
    flat = (toes[..., 2].min(axis=1) < 0.003) & (heels[..., 2].min(axis=1) < 0.003)
    assert flat.sum() > 20
    # On its edge a toe is 6 mm higher than the other.
    assert np.abs(np.diff(toes[flat][..., 2], axis=1)).max() < 0.0015


def test_a_sole_that_rolls_from_heel_to_toes_lies_flat_in_between(figure) -> None:
    n, foot = 400, figure_legs(figure)[0]
    # In the first half of the lap it rolls from 17° up to 17° down at an even pace, in the second half back.
    slope = 0.3 * np.interp(np.arange(n) / n, [0.0, 0.5, 1.0], [-1.0, 1.0, -1.0])
    channels = np.zeros((n, 3 + 4 * 18))
    channels[:, 2], channels[:, 3::4] = 0.9, 1.0
    column, stands = 3 + 4 * foot.joints[2], np.arange(n) < n // 2
    pitched = Rotation.from_rotvec(np.outer(slope, [0.0, 1.0, 0.0]))
    channels[:, column : column + 4] = pitched.as_quat(scalar_first=True)
    quaternions, _ = planted_ends(channels, np.array([1.3, 0.0, 0.0]), foot, stands, 0.02, 1.0)
    held = -np.arcsin(Rotation.from_quat(quaternions, scalar_first=True).as_matrix()[:, 2, 0])
    middle = slice(n // 20, n // 2 - n // 20)
    assert np.all(np.diff(held[middle]) > 0.0)
    assert np.abs(held - slope).max() < 0.03
    # Two millimetres over the length of a foot.
    assert np.sum(np.abs(held[stands]) < 0.01) > 2.5 * np.sum(np.abs(slope[stands]) < 0.01)
    swings = window(~stands, 0.35) == 1.0
    np.testing.assert_allclose(held[swings], slope[swings], atol=1e-12)


def test_a_capture_that_flies_steps_instead(figure) -> None:
    clip = skating("run")
    led, gait = led_map(clip, figure)
    assert (led.flies, led.grounds, gait.flies, gait.grounded) == (False, True, False, True)
    # Its limbs swing as fast already as they do in the run.
    assert leading(Lead(), gait).walking.forward == 1.0
    # Of its six steps the lap that repeats itself best has two.
    assert led.stride == pytest.approx(2 * Capture.step)
    assert 0.4 < led.pace < 0.8
    assert gait.speed == pytest.approx(led.pace * led.stride / led.duration)
    shown = soles(figure, [led.pose(walker(s)) for s in np.arange(0.0, gait.stride, 0.01)])
    # Within what the physical figure is led with takes for touching (`experiments.fitting.led_balance`).
    assert shown[..., 2].min(axis=1).max() < 0.012
    standing = shown[..., 2].min(axis=1) < 0.003
    assert standing.mean() > 0.6


@pytest.mark.parametrize("name", ["walk", "run"])
def test_a_clip_that_closes_is_led_as_it_is(figure, name: str) -> None:
    clip = embedded(name)
    led, _ = led_map(clip, figure)
    plain = Led((clip.poses, clip.fps), figure_legs(figure), led.phase)
    for s in np.linspace(0.0, led.stride, 30):
        np.testing.assert_array_equal(led.pose(walker(s)), plain.pose(walker(s)))


@pytest.mark.parametrize("file", CAPTURES)
def test_soles_of_captured_gaits_keep_their_contacts(figure, file: str) -> None:
    if not MOCAP.is_dir():
        pytest.skip("the motion capture data is not beside the project")
    led, gait = led_map(load_clip(MOCAP / file), figure)
    path = bent_path(gait, 0.35, gait.reach + 2.0 * led.stride + 1.0)
    places = np.arange(gait.reach, gait.reach + 2.0 * led.stride, 0.01)
    # On its levelled floor this one's heel lands flatter, and slides by 3.17 cm as it rolls.
    furthest = 0.033 if file == "xia/dme_example.bvh" else 0.03
    for held in (0.0, 1.0):
        shown = soles(figure, [led.pose(walker(s, held), path) for s in places])
        assert slide(shown) < furthest
        assert shown[..., 2].min() > -0.01


def test_the_derivative_of_a_planted_capture_is_that_of_the_pose(figure) -> None:
    led, gait = led_map(skating("walk"), figure)
    path, h = bent_path(gait, 0.5, 7.0), 1e-6
    for s in np.random.default_rng(4).uniform(1.0, 5.0, 60):
        jacobian = led.jacobian(walker(s), path)
        step = difference(led.pose(walker(s + h), path), led.pose(walker(s - h), path)) / (2.0 * h)
        np.testing.assert_allclose(jacobian[:, 0], step, atol=1e-5)
