"""Noise of captures is found and removed where there is some, and captures without noise are left as they are."""

from dataclasses import replace

import numpy as np
import pytest

from geometry import quaternions
from models.mocap.library import embedded, embedded_names
from models.mocap.preparation.prepare import prepared
from models.mocap.readers.formats import read_motion
from models.mocap.retargeting.noise import without_noise
from models.mocap.retargeting.skeleton_roles import roles_of
from tests.models.mocap.retargeting.rigs import Rig, at_rate, write_rig


def source(clip, folder):
    """A clip on another rig, as a file of it is read, and which joint is which."""
    path = folder / "source.bvh"
    write_rig(Rig(zero="random", seed=4), clip, path)
    motion = read_motion(path)
    return motion, roles_of(motion.joints, motion.parents)


def jittered(motion, degrees, millimetres, seed=1):
    """The motion with white noise of its joints and its root, RMS."""
    rng = np.random.default_rng(seed)
    turns = quaternions.exponential(np.deg2rad(degrees) * rng.normal(size=(*motion.rotations.shape[:2], 3)))
    height = np.linalg.norm(motion.offsets, axis=1).sum() / 5.0  # roughly a metre in the file's unit
    moved = motion.translations.copy()
    moved[:, 0] += 1e-3 * millimetres * height * rng.normal(size=(motion.n_frames, 3))
    return replace(motion, rotations=quaternions.product(motion.rotations, turns), translations=moved)


def angles(a, b):
    return 2.0 * np.arccos(np.minimum(np.abs((a * b).sum(axis=-1)), 1.0))


@pytest.mark.parametrize("every", [1, 2])
@pytest.mark.parametrize("name", embedded_names())
def test_motion_without_noise_is_left_as_it_is(name, every, tmp_path):
    motion, roles = source(at_rate(name, embedded(name).fps / every), tmp_path)
    left, noise = without_noise(motion, roles, ())
    assert left is motion
    assert noise == (0.0, 0.0)


@pytest.mark.parametrize("degrees", [0.5, 1.5])
@pytest.mark.parametrize("name", ["walk", "jump", "run"])
def test_noise_is_measured_and_most_of_it_removed(name, degrees, tmp_path):
    motion, roles = source(at_rate(name, 120.0), tmp_path)
    noisy = jittered(motion, degrees, 5.0 * degrees)
    cleaned, noise = without_noise(noisy, roles, ())
    assert noise.turn == pytest.approx(np.deg2rad(degrees), rel=0.2)
    before, after = (angles(m.rotations, motion.rotations) for m in (noisy, cleaned))
    assert np.sqrt((after**2).mean()) < 0.5 * np.sqrt((before**2).mean())
    # Speeds are differences of frames: of the error of these an eighth is left.
    true, before, after = (angles(m.rotations[1:], m.rotations[:-1]) for m in (motion, noisy, cleaned))
    assert np.sqrt(((after - true) ** 2).mean()) < 0.15 * np.sqrt(((before - true) ** 2).mean())


def test_jump_between_takes_is_not_smeared(tmp_path):
    motion, roles = source(at_rate("walk", 120.0), tmp_path)
    noisy = jittered(motion, 1.0, 5.0)
    turned = quaternions.product(np.array([0.0, 0.0, 1.0, 0.0]), noisy.rotations[60:, 0])
    noisy.rotations[60:, 0] = turned
    cleaned, _ = without_noise(noisy, roles, (59,))
    assert angles(cleaned.rotations[59, 0], cleaned.rotations[60, 0]) > np.deg2rad(160.0)


@pytest.mark.parametrize("rate", [30.0, 20.0])
def test_noise_is_found_from_23_frames_a_second_on(rate, tmp_path):
    motion, roles = source(at_rate("run", rate), tmp_path)
    laps = [motion.rotations[:-1]] * 5
    longer = replace(motion, rotations=np.concatenate(laps), translations=np.tile(motion.translations[:-1], (5, 1, 1)))
    assert without_noise(longer, roles, ())[0] is longer
    assert any(without_noise(jittered(longer, 1.0, 5.0), roles, ())[1]) == (rate == 30.0)


def written_with_noise(source_file, degrees, target):
    """The BVH file with white noise of all its rotations, and of 6 mm a degree of its path; in centimetres."""
    head, rows = source_file.read_text().split("Frame Time:")
    seconds, *rows = rows.strip().splitlines()
    table, rng = np.array([row.split() for row in rows], dtype=float), np.random.default_rng(2)
    table += degrees * rng.normal(size=table.shape) * np.where(np.arange(table.shape[1]) < 3, 0.6, 1.0)
    target.write_text(f"{head}Frame Time:{seconds}\n" + "\n".join(" ".join(map(str, row)) for row in table) + "\n")


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [0.5, 1.5])
def test_noisy_walk_becomes_a_feasible_clip(degrees, mocap, tmp_path):
    """With the noise no foot seemed to stand, and the figure fell after 1.4 and 0.6 s."""
    written_with_noise(mocap / "snu" / "walk.bvh", degrees, tmp_path / "noisy.bvh")
    made = prepared(tmp_path / "noisy.bvh")
    assert made.near
    assert made.looped.kind == "cycle"
    assert made.attempt.residual < 0.03
    assert "noise of" in " ".join(made.report.remarks)
