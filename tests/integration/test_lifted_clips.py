"""Lifted clips: h along each clip's curve equals the clip at every frame, alone and among others."""

from pathlib import Path

import numpy as np
import pytest

from controllers.haptic_map.lifted import Lifted
from controllers.haptic_map.lifting.frames import closing_gap
from controllers.haptic_map.lifting.room import Room
from controllers.motion.loops import MAX_CLOSURE_GAP
from experiments.fitting.figure_legs import figure_legs
from experiments.lifting.lift import lift_clips
from models.errors import ModelError
from models.humanoid.skeleton import BODIES, rest_pose
from models.mocap.library import embedded, embedded_names, load_clip
from models.mocap.motion.clip import Clip, pose_difference
from models.mocap.readers.formats import READABLE_SUFFIXES
from models.mocap.readers.own_bvh import write_bvh
from models.world.scene import SceneConfig
from sim.reference.reference import map_poses
from sim.world.world import World
from tests.captures import MOCAP, needs_mocap

TURN = 2.0 * np.pi
LEGS = figure_legs(World(SceneConfig()).body)
EMBEDDED = [embedded(name) for name in embedded_names()]


def lifted(clips):
    """Clips on a lattice of wavy curves, closed if the clip closes, all at a varying pace."""
    m, side = len(clips), int(np.ceil(np.sqrt(len(clips))))
    lap, k = np.arange(64)[:, None] * TURN / 64, np.arange(m)
    r, z = 0.036 + 0.012 * (k % side), -0.012 + 0.012 * (k // side)
    sites = np.stack([r + 2e-3 * np.sin(lap + k), z + 2e-3 * np.cos(2.0 * lap + k)], axis=-1)
    closed = [clip.n_frames >= 4 and closing_gap(clip.poses) <= MAX_CLOSURE_GAP for clip in clips]
    angles = []
    for i, (clip, closes) in enumerate(zip(clips, closed, strict=True)):
        s = np.linspace(0.0, 1.0, clip.n_frames)
        s += 0.02 * np.sin(TURN * s)
        angles.append((0.6 * i) % 6.0 + TURN * s if closes else 0.2 + min(TURN - 0.8, len(s) - 1.0) * s)
    motions = [(clip.poses, clip.fps) for clip in clips]
    return Lifted(motions, closed, angles, sites, LEGS, [f"{i} {clip.name}" for i, clip in enumerate(clips)])


def worst_at_frames(h_map):
    """Largest difference [m, rad] between h along the curves and the clips, at all frames."""
    worst = 0.0
    for i, (poses, fps) in enumerate(h_map.clips):
        points = h_map.curve(i).point(np.arange(len(poses)) / fps)
        stylus = np.hstack([points, np.tile([1.0, 0.0, 0.0, 0.0], (len(points), 1))])
        shown = map_poses(h_map, stylus)
        worst = max(worst, float(np.abs(pose_difference(h_map.placed(i), shown)).max()))
        # Moved over the ground as a whole, and not changed otherwise.
        joints = pose_difference(poses, h_map.placed(i))
        assert np.abs(joints[:, 6:]).max() < 1e-9
        assert np.ptp(np.linalg.norm(h_map.placed(i)[:, :2] - h_map.placed(i)[0, :2], axis=1)) == pytest.approx(
            np.ptp(np.linalg.norm(poses[:, :2] - poses[0, :2], axis=1)), abs=1e-9
        )
    return worst


@pytest.mark.parametrize("clip", EMBEDDED, ids=lambda clip: clip.name)
def test_single_embedded_clip_is_exact_at_every_frame(clip):
    assert worst_at_frames(lifted([clip])) < 1e-9


@pytest.mark.parametrize("clip", EMBEDDED, ids=lambda clip: clip.name)
def test_open_embedded_clip_is_exact_at_every_frame(clip):
    cut = Clip(clip.poses[: round(0.7 * clip.n_frames)], clip.fps, clip.name)
    assert not lifted([cut]).closed[0]
    assert worst_at_frames(lifted([cut])) < 1e-9


def test_all_embedded_clips_and_a_distorted_copy_are_exact_at_every_frame():
    assert worst_at_frames(lifted(EMBEDDED)) < 1e-9
    walk = EMBEDDED[embedded_names().index("walk")]
    poses = walk.poses.copy()
    poses[:, 2] += 0.05 * np.sin(np.linspace(0.0, TURN, len(poses)))
    poses[:, 7:11] = poses[:, 11:15]
    assert worst_at_frames(lifted([*EMBEDDED, Clip(poses, walk.fps, "distorted")])) < 1e-9


def recorded():
    """Clips of all motion files of the shared collection that can be read on the figure."""
    clips = []
    for path in sorted(MOCAP.rglob("*")):
        if path.suffix.lower() in READABLE_SUFFIXES:
            try:
                clips.append(load_clip(path))
            except ModelError:
                continue
    return [clip for clip in clips if clip.n_frames > 1]


@pytest.mark.slow
@needs_mocap
def test_captured_clips_alone_and_together_are_exact_at_every_frame():
    clips = recorded()
    assert len(clips) >= 10
    for clip in clips:
        assert worst_at_frames(lifted([clip])) < 1e-6
    assert worst_at_frames(lifted(clips[:10])) < 1e-6


@pytest.mark.slow
def test_clip_at_rest_at_both_ends_is_lifted_forth_and_back(tmp_path: Path) -> None:
    bow, share = np.tile(rest_pose(), (61, 1)), 0.5 - 0.5 * np.cos(np.pi * np.linspace(0.0, 1.0, 61))
    abdomen = 7 + 4 * (BODIES.index("abdomen") - 1)
    bow[:, abdomen], bow[:, abdomen + 2] = np.cos(0.3 * share), np.sin(0.3 * share)
    walk = embedded("walk")
    steps = Clip(walk.poses[: walk.n_frames // 3], walk.fps, "steps")
    for clip in (Clip(bow, 50.0, "bow"), steps):
        write_bvh(clip, tmp_path / f"{clip.name}.bvh")
    lifted = lift_clips([str(tmp_path / "bow.bvh"), str(tmp_path / "steps.bvh")], Room(), raw=True)
    assert lifted.turned == lifted.haptic_map.closed == (True, False)
    there = lifted.clips[0]
    assert there.n_frames % 2 == 1
    np.testing.assert_array_equal(there.poses, there.poses[::-1])
    assert np.abs(pose_difference(there.poses[there.n_frames // 2], bow[-1])).max() < 1e-4
    assert worst_at_frames(lifted.haptic_map) < 1e-6
