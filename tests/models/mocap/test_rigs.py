"""The same motion on any rig is the same motion of the figure, or is refused; never wrong and silent."""

import numpy as np
import pytest
from rigs import FAMILIES, UPS, ZERO_POSES, Rig, random_rig, write_rig

from models.errors import ModelError
from models.humanoid.skeleton import BODIES
from models.mocap import quaternions
from models.mocap.clip import Clip, global_rotations
from models.mocap.library import embedded, load

LARGEST = 2.0  # deg
NAMES = ("walk", "ginga", "cheer", "squat_dance")


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
    """None where the rig is refused; else the largest of the segments' 95th percentiles [deg]."""
    write_rig(rig, motions[name], path)
    try:
        clip = load(path).clip
    except ModelError as error:
        if "expected" not in str(error):
            raise
        return None
    ours, theirs = global_rotations(clip.poses), plain(name, rig.without)
    assert ours.shape == theirs.shape
    angles = np.linalg.norm(quaternions.logarithm(quaternions.product(quaternions.conjugate(theirs), ours)), axis=2)
    # Without toes and with other legs the foot meets the floor elsewhere, and its ankle bends for it.
    lacking = [*rig.without, *(["foot"] if "toe" in rig.without else [])]
    here = [k for k, body in enumerate(BODIES) if not any(part in body for part in lacking)]
    return float(np.rad2deg(np.quantile(angles[:, here], 0.95, axis=0)).max())


@pytest.mark.parametrize("family", FAMILIES)
def test_names_of_every_vendor(family, motions, plain, tmp_path):
    gap = check(
        Rig(family=family, fingers=True, twists=True, reference=True), "walk", motions, plain, tmp_path / "r.bvh"
    )
    assert gap is not None, "refused"
    assert gap < LARGEST


@pytest.mark.parametrize("zero", ZERO_POSES)
def test_any_zero_pose(zero, motions, plain, tmp_path):
    gap = check(Rig(zero=zero, seed=3), "ginga", motions, plain, tmp_path / "r.bvh")
    assert gap is not None, "refused"
    assert gap < LARGEST


@pytest.mark.parametrize("up", UPS)
def test_any_axis_up_any_facing_any_unit(up, motions, plain, tmp_path):
    rig = Rig(up=up, turn=0.7, unit=0.0254, order="YXZ")
    gap = check(rig, "cheer", motions, plain, tmp_path / "r.bvh")
    assert gap is not None, "refused"
    assert gap < LARGEST


def test_a_zero_pose_in_front_is_left_out(motions, plain, tmp_path):
    gap = check(Rig(leading=True), "walk", motions, plain, tmp_path / "r.bvh")
    assert gap is not None, "refused"
    assert gap < LARGEST
    assert load(tmp_path / "r.bvh").report.dropped == 1


def test_a_mirrored_body_is_refused(motions, tmp_path):
    write_rig(Rig(), motions["squat_dance"], tmp_path / "r.bvh")
    text = (tmp_path / "r.bvh").read_text()
    swapped = text.replace("Left", "@").replace("Right", "Left").replace("@", "Right")
    (tmp_path / "r.bvh").write_text(swapped)
    with pytest.raises(ModelError, match="the body is mirrored"):
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


def test_some_random_rigs(motions, plain, tmp_path):
    assert several(12, 1, motions, plain, tmp_path / "r.bvh") <= 1


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_many_random_rigs(seed, motions, plain, tmp_path):
    """Fifty each, and hardly any is refused."""
    assert several(50, 100 + seed, motions, plain, tmp_path / "r.bvh") <= 3
