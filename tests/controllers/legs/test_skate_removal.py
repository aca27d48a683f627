"""Feet of a led motion capture stand still on any path: sliding and hovering of the capture are removed."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from controllers.haptic_map.led import Led
from controllers.legs.skate_removal import levels, planted_ends, smooth_mask
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
from tests.derivatives import central_differences

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
    """A clip of the package modified so that its feet slide by a sixth of the travel, turn and hover."""
    clip = embedded(name)
    poses, share = clip.poses.copy(), np.linspace(0.0, 1.0, clip.n_frames)
    poses[:, 0] *= 1.15
    poses[:, 1] += 0.03 * np.sin(2.0 * np.pi * share)
    poses[:, 2] += 0.012 + 0.006 * np.cos(2.0 * np.pi * share)
    # One foot is on its outer edge, and the clip does not quite close.
    roll = Rotation.from_euler("x", np.radians(6.0))
    poses[:, ANKLE] = (Rotation.from_quat(poses[:, ANKLE], scalar_first=True) * roll).as_quat(scalar_first=True)
    poses[-20:, 7:11] = poses[-21, 7:11]
    return Clip(poses, clip.fps, name)


def test_windows_are_one_within_runs_of_a_mask() -> None:
    stands = np.zeros(100, dtype=bool)
    stands[80:], stands[:30] = True, True
    weights = smooth_mask(stands, 0.1)
    np.testing.assert_array_equal(weights[~stands], 0.0)
    np.testing.assert_array_equal(weights[[*range(86, 100), *range(24)]], 1.0)
    assert 0.0 < weights[80] < weights[82] < 1.0
    assert weights[29] == weights[80]
    np.testing.assert_array_equal(smooth_mask(np.ones(5, dtype=bool), 0.1), 1.0)
    heights = np.where(stands, 0.02, 0.3)
    np.testing.assert_allclose(levels(heights, stands), 0.02, atol=1e-12)


@pytest.mark.parametrize("name", ["walk", "run"])
def test_skating_clip_stands_on_a_bent_path(figure, name: str) -> None:
    clip = skating(name)
    led, gait = led_map(clip, figure)
    path = bent_path(gait, 0.5, 7.0)
    arguments = np.arange(gait.reach, path_front(path) - gait.reach - 0.2, 0.01)
    shown = soles(figure, [led.pose(walker(s), path) for s in arguments])
    # Standing feet touch the floor, and none penetrates it.
    assert (shown[..., 2].min(axis=1) < 0.003).mean() > (0.95 if name == "walk" else 0.6)
    assert shown[..., 2].min() > -0.008
    assert slide(shown) < 0.015
    unplanted = Led((clip.poses, clip.fps), figure_legs(figure), led.phase)
    assert slide(soles(figure, [unplanted.pose(walker(s), path) for s in arguments]), 0.02) > 0.05


def test_standing_foot_lies_flat(figure) -> None:
    clip = skating("walk")
    led, gait = led_map(clip, figure)
    shown = soles(figure, [led.pose(walker(s)) for s in np.arange(0.0, gait.stride, 0.01)])
    toes, heels = shown[:, 2:4], shown[:, 0:2]
    flat = (toes[..., 2].min(axis=1) < 0.003) & (heels[..., 2].min(axis=1) < 0.003)
    assert flat.sum() > 20
    # On the edge of the foot one toe would be 6 mm higher than the other.
    assert np.abs(np.diff(toes[flat][..., 2], axis=1)).max() < 0.0015


def test_rolling_sole_lies_flat_between_heel_and_toes(figure) -> None:
    n, foot = 400, figure_legs(figure)[0]
    # The pitch goes from 17° up to 17° down in the first half of the lap and back in the second.
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
    swings = smooth_mask(~stands, 0.35) == 1.0
    np.testing.assert_allclose(held[swings], slope[swings], atol=1e-12)


def test_capture_with_flight_is_grounded(figure) -> None:
    clip = skating("run")
    led, gait = led_map(clip, figure)
    assert (led.flies, led.has_grounded_form, gait.flies, gait.grounded) == (False, True, False, True)
    # Its limbs swing as fast as in the run already.
    assert leading(Lead(), gait).walking.forward == 1.0
    # The best lap has two of its six steps.
    assert led.stride == pytest.approx(2 * Capture.step)
    assert 0.4 < led.pace < 0.8
    assert gait.speed == pytest.approx(led.pace * led.stride / led.duration)
    shown = soles(figure, [led.pose(walker(s)) for s in np.arange(0.0, gait.stride, 0.01)])
    # Within the contact tolerance of `experiments.setups.modes.lead`.
    assert shown[..., 2].min(axis=1).max() < 0.012
    standing = shown[..., 2].min(axis=1) < 0.003
    assert standing.mean() > 0.6


@pytest.mark.parametrize("name", ["walk", "run"])
def test_closed_clip_is_unchanged(figure, name: str) -> None:
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
    arguments = np.arange(gait.reach, gait.reach + 2.0 * led.stride, 0.01)
    # In this capture the heel slides by 3.17 cm as the foot rolls.
    furthest = 0.033 if file == "xia/dme_example.bvh" else 0.03
    for held in (0.0, 1.0):
        shown = soles(figure, [led.pose(walker(s, held), path) for s in arguments])
        assert slide(shown) < furthest
        assert shown[..., 2].min() > -0.01


def test_jacobian_of_a_planted_capture_matches_finite_differences(figure) -> None:
    led, gait = led_map(skating("walk"), figure)
    path = bent_path(gait, 0.5, 7.0)
    for s in np.random.default_rng(4).uniform(1.0, 5.0, 60):
        jacobian = led.jacobian(walker(s), path)
        numeric = central_differences(lambda s: led.pose(walker(s), path), s, 1e-6, difference)
        np.testing.assert_allclose(jacobian[:, 0], numeric, atol=1e-5)
