"""Led motion captures: their feet keep their contacts on any path, and runs step instead of flying."""

import numpy as np
import pytest

from controllers.haptic_map.led import Led
from controllers.walking.walked_path import STEP, lay_row, path_front, straight_path
from experiments.config.maps import Led as LedMap
from experiments.config.modes import Lead
from experiments.fitting.figure_legs import figure_legs
from experiments.setups.modes.lead import leading
from experiments.setups.parts.led_figure import MAX_STEP, led_clips, led_map
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip
from tests.captures import MOCAP, needs_mocap
from tests.controllers.clips_for_maps import difference, walker
from tests.controllers.figure_soles import slide, soles
from tests.derivatives import central_differences

CAPTURES = (
    "cmu_amc/02_01.amc", "cmu_amc/02_03.amc", "cmu_amc/16_09.amc", "deepmimic/humanoid3d_walk.txt",
    "deepmimic/humanoid3d_run.txt", "snu/walk.bvh", "snu/run.bvh", "xia/strutting_01_000.bvh", "xia/angry_13_000.bvh",
    "xia/dme_example.bvh",
)  # fmt: skip


def bent_path(gait, bend: float, length: float) -> np.ndarray:
    """A path that turns left and right while a foot stands."""
    path = straight_path(0.0, 0.0, 0.2, gait.reach)
    while path_front(path) < length:
        lap = (path[0] + 0.5) * STEP / gait.stride
        feet = gait.support[int(len(gait.support) * (lap - np.floor(lap))) % len(gait.support)]
        turn = min(feet, 1) * bend * np.sin(1.5 * path[0] * STEP)
        lay_row(path, turn * STEP, bend, 0.0)
    return path


def test_captured_run_steps_instead_of_flying(figure) -> None:
    led, gait = led_map(embedded("run"), figure, authored=False)
    assert (led.flies, led.has_grounded_form, gait.flies, gait.grounded) == (False, True, False, True)
    # Its limbs swing as fast as in the run already.
    assert leading(Lead(), gait).walking.forward == 1.0
    assert led.stride == pytest.approx(6 * MAX_STEP)
    assert 0.4 < led.pace < 0.8
    assert gait.speed == pytest.approx(led.pace * led.stride / led.duration)
    shown = soles(figure, [led.pose(walker(s)) for s in np.arange(0.0, gait.stride, 0.01)])
    lowest = shown[..., 2].min(axis=1)
    # A foot bears load up to 6 mm (`experiments.setups.modes.lead`).
    assert lowest.max() < 0.006
    assert lowest.min() > -0.005
    both = (shown[:, :4, 2].min(axis=1) < 0.003) & (shown[:, 4:, 2].min(axis=1) < 0.003)
    assert both.mean() > 0.2
    # Steps are shorter than in the run, and swinging feet lower in proportion, but for the clearance that they keep.
    flown, _ = led_map(embedded("run"), figure)
    poses = [flown.pose(walker(s)) for s in np.arange(0.0, flown.stride, 0.01)]
    raised, highest = (each[:, :4, 2].min(axis=1).max() for each in (shown, soles(figure, poses)))
    ratio = led.stride / flown.stride
    assert ratio * highest < raised < ratio * highest + 0.005


@pytest.mark.parametrize("name", ["walk", "run"])
def test_closed_clip_is_unchanged(figure, name: str) -> None:
    clip = embedded(name)
    led, _ = led_map(clip, figure)
    plain = Led((clip.poses, clip.fps), figure_legs(figure), led.phase)
    for s in np.linspace(0.0, led.stride, 30):
        np.testing.assert_array_equal(led.pose(walker(s)), plain.pose(walker(s)))


@needs_mocap
@pytest.mark.slow
@pytest.mark.parametrize("file", CAPTURES)
def test_soles_of_captured_gaits_keep_their_contacts(figure, file: str) -> None:
    (clip,), _ = led_clips(LedMap(clips=(str(MOCAP / file),)))
    led, gait = led_map(clip, figure, authored=False)
    path = bent_path(gait, 0.35, gait.reach + 2.0 * led.stride + 1.0)
    arguments = np.arange(gait.reach, gait.reach + 2.0 * led.stride, 0.01)
    shown = soles(figure, [led.pose(walker(s), path) for s in arguments])
    assert slide(shown) < 0.03
    assert shown[..., 2].min() > -0.01


def test_clip_without_a_cycle_is_closed_over_its_best_lap(figure) -> None:
    walk = embedded("walk")
    poses = np.vstack([walk.poses[:-1], walk.displacement.moved(walk.poses)])[7:]
    poses[-5:, 7:11] = poses[-6, 7:11]
    led, gait = led_map(Clip(poses, walk.fps, "more than a lap"), figure, authored=False)
    assert led.duration == pytest.approx(0.5 * walk.duration, abs=0.05)  # its lap has two cycles
    shown = soles(figure, [led.pose(walker(s)) for s in np.arange(0.0, gait.stride, 0.01)])
    assert slide(shown) < 0.03


def test_jacobian_of_a_stepping_run_matches_finite_differences(figure) -> None:
    led, gait = led_map(embedded("run"), figure, authored=False)
    path = bent_path(gait, 0.5, 7.0)
    for s in np.random.default_rng(4).uniform(1.0, 5.0, 60):
        jacobian = led.jacobian(walker(s), path)
        numeric = central_differences(lambda s: led.pose(walker(s), path), s, 1e-6, difference)
        np.testing.assert_allclose(jacobian[:, 0], numeric, atol=1e-5)
