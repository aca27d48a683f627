"""Where a led figure begins, which clips it leads by steps, and which are said to be no steady gait."""

import re

import mujoco
import numpy as np
import pytest
from scipy.optimize import nnls

from controllers.haptic_map.led import Led
from experiments.certify.certified_leading import leading_field
from experiments.config.modes import Lead
from experiments.config.options import run_config
from experiments.setups.parts.led_figure import lap_remark, led_parts
from models.humanoid.skeleton import CONTACT_RADIUS, FOOT_CONTACTS, figure_model
from models.mocap.library import embedded
from models.mocap.motion.clip import CLOSURE_TOLERANCE, Clip
from sim.reference.reference import map_poses


def distance_from_support(led: Led) -> float:
    """Distance of the centre of mass from the hull of the points on the floor where the map begins [m]."""
    figure = figure_model()
    data = mujoco.MjData(figure)
    data.qpos = map_poses(led, np.array([[0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0]]))[0]
    mujoco.mj_kinematics(figure, data)
    mujoco.mj_comPos(figure, data)
    points = np.array([data.geom(name).xpos for name in FOOT_CONTACTS])
    points = points[points[:, 2] - CONTACT_RADIUS < 2e-3, :2]
    # Nearest convex combination: weights that are non-negative, and with a heavy row also sum to one.
    rows = np.vstack([points.T, 1e4 * np.ones(len(points))])
    return float(nnls(rows, np.append(data.subtree_com[1, :2], 1e4))[1])


def test_refined_run_begins_where_the_figure_can_stand_still() -> None:
    parts = led_parts(run_config(mode="lead", clips=("run",)), (embedded("run"),), figure_model())
    refined = parts.refine(False)
    assert distance_from_support(parts.haptic_map) > 0.02
    assert distance_from_support(refined.haptic_map) < 2.5e-3
    n = len(parts.gait.support)
    before, after = (np.roll(each.gait.support, round(n * each.haptic_map.phase)) for each in (parts, refined))
    np.testing.assert_array_equal(before, after)


def test_clip_with_flights_is_led_by_steps_unless_it_is_authored() -> None:
    configs = [run_config(mode="lead", clips=(name,)) for name in ("run", "run.bvh")]
    authored, from_file = (led_parts(config, (embedded("run"),), figure_model()) for config in configs)
    assert authored.haptic_map.flies
    assert not from_file.haptic_map.flies
    assert from_file.gait.grounded
    assert leading_field(configs[1], Lead(), embedded("run")).walking.gait.speed == from_file.gait.speed


@pytest.mark.parametrize("first_part", [0.1, 0.3, 0.5])
def test_clip_that_stands_for_a_part_of_its_lap_is_said_to_be_no_steady_gait(first_part):
    walk = embedded("walk")
    n = walk.n_frames - 1
    standing = np.repeat(walk.poses[:1], round(n * first_part / (1.0 - first_part)), axis=0)
    clip = Clip(np.concatenate([standing, walk.poses]), walk.fps, "halting")
    assert clip.closes(CLOSURE_TOLERANCE)
    assert lap_remark(walk, "physical") == ()
    remarks = lap_remark(clip, "kinematic")
    assert len(remarks) == (first_part > 0.2)
    shares = [float(re.search("is no steady gait: for ([0-9]+) %", remark)[1]) for remark in remarks]
    np.testing.assert_allclose(shares, 100.0 * first_part, atol=3.0)
    assert all("may fall" in remark for remark in lap_remark(clip, "physical"))
