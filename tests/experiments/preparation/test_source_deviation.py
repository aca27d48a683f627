"""Deviation of a motion from its file, for faithful motions and for ones altered by a known amount."""

from types import SimpleNamespace

import numpy as np
import pytest

from experiments.preparation.source_deviation import LINES, deviation, deviations, source_of
from geometry import quaternions
from models.humanoid.skeleton import JOINTS
from models.mocap.library import embedded, load
from models.mocap.motion.clip import Clip, PlanarDisplacement
from models.mocap.preparation.looping import close_or_rest
from models.mocap.preparation.poses import resampled
from tests.captures import MOCAP, needs_mocap
from tests.models.mocap.retargeting.rigs import Rig, write_rig

RIGS = (
    Rig(),
    Rig(up="+Z", turn=2.0, unit=1.0, proportions={"leg": 1.3, "arm": 0.7, "shoulders": 1.1}),
    Rig(without=("toe",), tips=None, leading=1),
)


def read(path):
    clip, report, _ = load(path)
    return source_of(path, clip, report), clip.poses


@pytest.fixture(scope="module")
def dance(tmp_path_factory):
    """A dance on another skeleton, read back: its body, and its poses on the figure."""
    path = tmp_path_factory.mktemp("rig") / "dance.bvh"
    clip = embedded("squat_dance")
    write_rig(RIGS[1], Clip(clip.poses[:60], clip.fps, "dance"), path)
    return read(path)


@pytest.mark.parametrize("rig", RIGS, ids=["plain", "other proportions", "without toes"])
def test_retargeted_motion_deviates_little_from_its_file(rig, tmp_path):
    clip = embedded("squat_dance")
    write_rig(rig, Clip(clip.poses[:60], clip.fps, "dance"), tmp_path / "dance.bvh")
    found = deviation(*read(tmp_path / "dance.bvh"))
    assert found.direction < np.deg2rad(0.5)
    assert found.place < 0.01


def test_deviation_ignores_place_and_heading(dance):
    source, poses = dance
    moved = PlanarDisplacement(3.0, -2.0, 2.5).moved(poses)
    np.testing.assert_allclose(deviation(source, moved)[::2], deviation(source, poses)[::2], atol=1e-6)


@pytest.mark.parametrize("line", [line for line in LINES if "_" in line])
def test_turned_segment_is_detected(dance, line):
    """Its joint is turned about an axis across it in more than half of the frames."""
    source, poses = dance
    joint = {"upper_arm": "shoulder", "forearm": "elbow", "thigh": "hip", "shank": "knee", "foot": "ankle"}
    side, limb = line.split("_", 1)
    columns = 7 + 4 * JOINTS.index(f"{side}_{joint[limb]}") + np.arange(4)
    axis = 1 if limb in ("thigh", "shank", "foot") else 0
    turned = poses.copy()
    turned[15:, columns] = quaternions.product(turned[15:, columns], quaternions.about_axis(axis, np.array(0.2)))
    found = deviation(source, turned)
    assert found.direction == pytest.approx(0.2, abs=np.deg2rad(1.0))
    # Limbs beyond it turn with it.
    assert found.segment in (
        line,
        line.replace("upper_arm", "forearm"),
        *(f"{side}_{part}" for part in ("shank", "foot")),
    )
    assert limb == "foot" or found.place > 0.03


def test_leaning_and_raised_bodies_are_detected(dance):
    source, poses = dance
    lean, raised = poses.copy(), poses.copy()
    lean[:, 3:7] = quaternions.product(quaternions.about_axis(0, np.array(0.1)), lean[:, 3:7])
    raised[:, 2] += 0.05
    assert deviation(source, lean).direction == pytest.approx(0.1, abs=np.deg2rad(1.0))
    found = deviation(source, raised)
    assert found.direction < np.deg2rad(0.5)
    assert found.place == pytest.approx(0.05, abs=0.01)


@pytest.mark.parametrize("pace", [1.0, 0.8])
def test_prepared_part_is_compared_at_the_times_of_the_file(tmp_path, pace):
    walk = embedded("walk")
    write_rig(RIGS[0], Clip(walk.poses[: walk.n_frames // 3], walk.fps, "walk"), tmp_path / "walk.bvh")
    clip, report, _ = load(tmp_path / "walk.bvh")
    part = close_or_rest(resampled(Clip(clip.poses, pace * clip.fps, "walk"), 120.0), "open")
    assert part.start < -0.2
    result = SimpleNamespace(
        clip=part.clip, captured=clip, report=report, looped=part, paced=SimpleNamespace(pace=pace)
    )
    was, now = deviations(tmp_path / "walk.bvh", result)
    assert now.direction == pytest.approx(was.direction, abs=np.deg2rad(0.1))
    assert now.place == pytest.approx(was.place, abs=0.002)
    late = SimpleNamespace(**vars(result) | {"looped": part._replace(start=part.start + 0.1, end=part.end + 0.1)})
    assert deviations(tmp_path / "walk.bvh", late)[1].direction > np.deg2rad(3.0)


@needs_mocap
@pytest.mark.parametrize(
    "name",
    [
        "animated_drawings/jumping.bvh", "cmu_amc/02_01.amc", "cmu_bvh/131_03.bvh", "deepmimic/humanoid3d_kick.txt",
        "snu/backflip.bvh", "snu/dance.bvh", "xia/dme_example.bvh", "quirks/bvh_test3.bvh",
    ],
)  # fmt: skip
def test_captures_deviate_little_from_their_files(name):
    """Trunk, hips, shoulders, limbs and feet within 2°, joints within 3 cm; 1.8° and 2.9 cm where a floor slopes."""
    found = deviation(*read(MOCAP / name))
    assert found.direction < np.deg2rad(2.0), found.segment
    assert found.place < 0.03, found.joint
