"""The same motion on any rig is the same motion of the figure, or is refused; never wrong and silent.

Compared as calibrated, before the figure is set on the floor: where its toes would go through that, its ankles bend,
by as much as the proportions of the legs ask for.
"""

import re

import numpy as np
import pytest
from rigs import FAMILIES, UPS, ZERO_POSES, Rig, random_rig, write_rig

from models.errors import ModelError
from models.humanoid.skeleton import CONTACT_RADIUS
from models.mocap.library import embedded, load
from models.mocap.motion import quaternions
from models.mocap.motion.clip import Clip, global_rotations
from models.mocap.preparation.poses import sole_points
from models.mocap.retargeting import retarget

LARGEST = 2.0  # deg
NAMES = ("walk", "ginga", "cheer", "squat_dance")


@pytest.fixture
def as_calibrated(monkeypatch):
    monkeypatch.setattr(retarget, "on_the_floor", lambda root, segments, fps: (root, segments))


@pytest.fixture(scope="module")
def motions():
    """Embedded clips at some 40 frames per second."""
    clips = {name: embedded(name) for name in NAMES}
    steps = {name: max(1, round(clip.fps / 40)) for name, clip in clips.items()}
    return {name: Clip(clip.poses[:: steps[name]], clip.fps / steps[name], name) for name, clip in clips.items()}


@pytest.fixture(scope="module")
def plain(motions, tmp_path_factory):
    """Segments of the motion from a rig that is drawn as the figure is, lacking the same parts."""
    kept = {}

    def segments(name, without):
        if (name, without) not in kept:
            path = tmp_path_factory.mktemp("plain") / "plain.bvh"
            write_rig(Rig(without=without), motions[name], path)
            kept[name, without] = global_rotations(load(path).clip.poses)
        return kept[name, without]

    return segments


def check(rig, name, motions, plain, path):
    """None where the rig is refused; else the largest of the segments' 95th percentiles over time [deg]."""
    write_rig(rig, motions[name], path)
    try:
        clip = load(path).clip
    except ModelError:
        return None
    ours, theirs = global_rotations(clip.poses), plain(name, rig.without)
    assert ours.shape == theirs.shape
    angles = np.linalg.norm(quaternions.logarithm(quaternions.product(quaternions.conjugate(theirs), ours)), axis=2)
    return float(np.rad2deg(np.quantile(angles, 0.95, axis=0)).max())


@pytest.mark.usefixtures("as_calibrated")
@pytest.mark.parametrize("family", FAMILIES)
def test_names_of_every_vendor(family, motions, plain, tmp_path):
    gap = check(
        Rig(family=family, fingers=True, twists=True, reference=True), "walk", motions, plain, tmp_path / "r.bvh"
    )
    assert gap is not None, "refused"
    assert gap < LARGEST


@pytest.mark.usefixtures("as_calibrated")
@pytest.mark.parametrize("zero", ZERO_POSES)
def test_any_zero_pose(zero, motions, plain, tmp_path):
    gap = check(Rig(zero=zero, seed=3), "ginga", motions, plain, tmp_path / "r.bvh")
    assert gap is not None, "refused"
    assert gap < LARGEST


@pytest.mark.usefixtures("as_calibrated")
@pytest.mark.parametrize("up", UPS)
def test_any_axis_up_any_facing_any_unit(up, motions, plain, tmp_path):
    rig = Rig(up=up, turn=0.7, unit=0.0254, order="YXZ")
    gap = check(rig, "cheer", motions, plain, tmp_path / "r.bvh")
    assert gap is not None, "refused"
    assert gap < LARGEST


@pytest.mark.usefixtures("as_calibrated")
def test_a_zero_pose_in_front_is_left_out(motions, plain, tmp_path):
    gap = check(Rig(leading=1), "walk", motions, plain, tmp_path / "r.bvh")
    assert gap is not None, "refused"
    assert gap < LARGEST
    assert load(tmp_path / "r.bvh").report.dropped == 1


def exchanged(path, *words):
    """Left and right exchanged in a file's names that have one of these words."""
    sides = {"Left": "Right", "Right": "Left"}
    pattern = re.compile(rf"(Left|Right)(?={'|'.join(words)})")
    path.write_text(pattern.sub(lambda found: sides[found[1]], path.read_text()))


def test_a_mirrored_body_is_refused(motions, tmp_path):
    write_rig(Rig(), motions["squat_dance"], tmp_path / "r.bvh")
    exchanged(tmp_path / "r.bvh", "")
    with pytest.raises(ModelError, match=r"the body is mirrored.* --roles FILE"):
        load(tmp_path / "r.bvh")


@pytest.mark.parametrize(
    ("limbs", "words"),
    [("arms", ("Shoulder", "Arm", "ForeArm", "Hand")), ("legs", ("UpLeg", "Leg", "Foot", "ToeBase"))],
)
@pytest.mark.parametrize("name", NAMES)
def test_arms_exchanged_against_the_legs_are_refused(limbs, words, name, motions, tmp_path):
    write_rig(Rig(), motions[name], tmp_path / "r.bvh")
    exchanged(tmp_path / "r.bvh", *words)
    with pytest.raises(ModelError, match=rf"left and right of the {limbs} are exchanged.* --roles FILE"):
        load(tmp_path / "r.bvh")


def several(n, seed, motions, plain, path):
    rng = np.random.default_rng(seed)
    refused = 0
    for _ in range(n):
        rig, name = random_rig(rng), str(rng.choice(NAMES))
        gap = check(rig, name, motions, plain, path)
        refused += gap is None
        assert gap is None or gap < LARGEST, (name, rig)
    return refused


@pytest.mark.usefixtures("as_calibrated")
def test_some_random_rigs(motions, plain, tmp_path):
    assert several(12, 1, motions, plain, tmp_path / "r.bvh") <= 1


@pytest.mark.usefixtures("as_calibrated")
@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_many_random_rigs(seed, motions, plain, tmp_path):
    """Fifty each, and hardly any is refused."""
    assert several(50, 100 + seed, motions, plain, tmp_path / "r.bvh") <= 3


def test_toes_of_other_legs_stay_over_the_floor(motions, tmp_path):
    for seed, legs in enumerate(({"thigh": 1.15, "shank": 0.85}, {"thigh": 0.85, "shank": 1.15}, {"foot": 1.15})):
        write_rig(Rig(proportions=legs, seed=seed), motions["squat_dance"], tmp_path / "r.bvh")
        heights = sole_points(load(tmp_path / "r.bvh").clip.poses)[:, :, 2] - CONTACT_RADIUS
        assert np.quantile(heights[:, [2, 3, 6, 7]].min(axis=1), 0.02) > -0.015
