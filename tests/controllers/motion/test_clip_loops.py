"""Clips as loops: drift, closing, alignment in time."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from controllers.blending.alignment import aligned_channels
from controllers.errors import ParameterError
from controllers.motion.loops import checked_clip, closed_loop, plane_exponential, there_and_back, turned, yawed
from tests.controllers.clips_for_maps import matrices, swinging, wxyz


def _loop(poses, fps=30.0):
    return closed_loop(checked_clip(poses, fps, "clip"), fps)


def _somersault(frames=60):
    poses = swinging(1, frames)
    pitch = np.linspace(0.0, -2.0 * np.pi, frames + 1)
    poses[:, 3:7] = wxyz(Rotation.from_rotvec(np.outer(pitch, [0.0, 1.0, 0.0]) + np.array([0.01, 0.0, 0.0])))
    return poses


@pytest.mark.parametrize(
    ("poses", "drift"),
    [
        (swinging(1), [0.0, 0.0, 0.0]),
        (swinging(2, travel=1.3), [1.3, 0.0, 0.0]),
        (swinging(3, turns=1.0), [0.0, 0.0, 2 * np.pi]),
        (swinging(4, turns=-2.0), [0.0, 0.0, -4 * np.pi]),
        (_somersault(), [0.0, 0.0, 0.0]),
    ],
    ids=["stays", "walks", "spins", "spins twice", "somersault"],
)
def test_drift_is_what_a_lap_moves_and_turns(poses, drift):
    loop = _loop(poses)
    np.testing.assert_allclose(np.hypot(*loop.drift[:2]), np.hypot(*drift[:2]), atol=1e-9)
    assert loop.drift[2] == pytest.approx(drift[2], abs=1e-9)
    assert loop.duration == pytest.approx((len(poses) - 1) / 30.0)


def test_a_walk_in_a_curve_repeats_round_its_circle():
    poses = swinging(5, travel=0.0)
    s = np.linspace(0.0, 1.0, len(poses))
    shift, angle = plane_exponential(s[:, None] * [1.2, 0.1, 0.7])
    poses[:, :2], poses[:, 3:7] = turned(angle, poses[:, :2]) + shift, yawed(angle, poses[:, 3:7])
    loop = _loop(poses)
    assert loop.drift[2] == pytest.approx(0.7, abs=1e-9)
    # The step of the lap does not depend on where the clip stood, its twist's translation does.
    step, _ = plane_exponential(np.array([0.0, 0.0, 0.7]))
    assert np.abs(step).max() == 0.0
    remainder = loop.channels(np.array([0.0, 1.0 - 1e-12]), np.zeros(2))
    np.testing.assert_allclose(remainder[0], remainder[1], atol=1e-8)


@pytest.mark.parametrize("turns", [-1.0, 1.0, 2.0])
def test_who_turns_round_as_he_goes_is_not_pulled_shut_over_the_seam(turns):
    poses = swinging(2, travel=1.3)
    s = np.linspace(0.0, 1.0, len(poses))
    poses[:, 3:7] = yawed((2.0 * np.pi * turns - 0.24) * s, poses[:, 3:7])
    loop = _loop(poses)
    assert loop.drift[2] == pytest.approx(-0.24, abs=1e-9)
    made = loop.channels(s, s)
    np.testing.assert_allclose(made[:, 2], poses[:, 2], atol=1e-6)
    heading = Rotation.from_quat(made[:, [4, 5, 6, 3]]) * Rotation.from_quat(poses[:, [4, 5, 6, 3]]).inv()
    np.testing.assert_allclose(heading.as_matrix(), heading[0].as_matrix()[None].repeat(len(s), 0), atol=1e-6)


def test_a_loop_put_together_again_is_the_clip_where_it_was_moved_to():
    poses = swinging(2, travel=1.3)
    loop = _loop(poses)
    s = np.linspace(0.0, 1.0, len(poses))[:-1]
    shift, angle = plane_exponential(s[:, None] * loop.drift)
    again = loop.channels(s, np.zeros(len(s)))
    root = turned(angle, again[:, :2]) + shift
    # Up to one displacement of the plane, the same path and the same joints.
    np.testing.assert_allclose(
        np.linalg.norm(np.diff(root, axis=0), axis=1),
        np.linalg.norm(np.diff(poses[:-1, :2], axis=0), axis=1),
        atol=1e-9,
    )
    np.testing.assert_allclose(matrices(again[:, 7:11]), matrices(poses[:-1, 7:11]), atol=1e-12)
    np.testing.assert_allclose(again[:, 2], poses[:-1, 2], atol=1e-12)


def test_an_open_clip_is_closed_smoothly_at_its_ends_only():
    whole = swinging(6, 200)
    poses = whole[:140]
    # So fast that its ends are in the middle of the motion: it is not played there and back.
    loop = closed_loop(checked_clip(poses, 240.0, "clip"), 240.0)
    assert np.abs(poses[-1, 7:] - poses[0, 7:]).max() > 0.02
    s = np.arange(139) / 139
    found = loop.channels(s, np.zeros(139))
    inside = (s > 0.2) & (s < 0.8)
    np.testing.assert_allclose(matrices(found[inside, 7:11]), matrices(poses[:-1][inside, 7:11]), atol=1e-12)
    # Twice differentiable over the seam: second differences there are no larger than elsewhere in the loop.
    fine = loop.channels(np.arange(-60, 60) / 3000.0, np.zeros(120))[:, 7:11]
    rotations = Rotation.from_matrix(matrices(fine))
    velocity = (rotations[:-1].inv() * rotations[1:]).as_rotvec() * 3000.0
    jumps = np.abs(np.diff(velocity, axis=0)).max(axis=1)
    assert jumps.max() < 6.0 * np.median(jumps) + 1e-6


def test_a_clip_of_two_frames_and_one_that_stands_still_are_loops():
    for poses in (swinging(7)[[0, 40]], np.tile(swinging(7)[:1], (50, 1))):
        values = _loop(poses).channels(np.linspace(0.0, 1.0, 20), np.zeros(20))
        assert np.isfinite(values).all()
        np.testing.assert_allclose(np.linalg.norm(values[:, 7:11], axis=1), 1.0)


def test_clips_shifted_and_warped_in_time_come_out_together():
    reference = swinging(8, 240)
    s = np.linspace(0.0, 1.0, 241)
    warped = s + 0.03 * np.sin(2.0 * np.pi * s)
    late = swinging(8, 240, phase=0.3)
    dense = _loop(swinging(8, 240))
    slow = dense.channels(warped, np.zeros(241))
    channels = aligned_channels([_loop(reference), _loop(late), _loop(slow)], 120)
    for other, tolerance, before in ((1, 0.06, late), (2, 0.12, slow)):
        angle = _angles(channels[:, 0, 7:11], channels[:, other, 7:11])
        assert angle.max() < tolerance
        assert angle.max() < 0.5 * _angles(reference[:-1, 7:11], before[:-1, 7:11]).max()


def _angles(a, b):
    return 2.0 * np.arccos(np.clip(np.abs((a * b).sum(axis=1)), 0.0, 1.0))


@pytest.mark.parametrize(
    ("poses", "fps", "says"),
    [
        (np.zeros((5, 18)), 30.0, r"shape \(n, 7 \+ 4 joints\), got \(5, 18\)"),
        (swinging(1)[:1], 30.0, "at least 2 frames, got 1"),
        (swinging(1), 0.0, "fps must be positive and finite, got 0.0"),
        (np.full((5, 19), np.nan), 30.0, "frame 0 is not finite"),
        (swinging(1) * 2.0, 30.0, "is not unit"),
    ],
)
def test_what_is_no_clip_is_refused(poses, fps, says):
    with pytest.raises(ParameterError, match=says):
        checked_clip(poses, fps, "clip 2")


def test_an_open_clip_that_rests_is_played_there_and_back():
    t = np.linspace(0.0, 1.0, 121)
    share = (t**3 * (10.0 - 15.0 * t + 6.0 * t**2))[:, None]
    poses = np.zeros((121, 11))
    poses[:, :3] = [0.0, 0.0, 0.9] + share * [0.3, 0.1, -0.2]
    poses[:, 3] = 1.0
    poses[:, 7:] = np.concatenate([np.cos(0.4 * share), np.sin(0.4 * share), 0.0 * share, 0.0 * share], axis=1)
    folded = there_and_back(poses, 60.0)
    np.testing.assert_allclose(folded[::-1], folded, atol=1e-12)
    np.testing.assert_allclose(folded[[0, len(folded) // 2, -1]], poses[[0, -1, 0]], atol=1e-6)
    loop = closed_loop(folded, 60.0)
    assert np.abs(loop.drift).max() < 1e-9
    # What is closed, or in the middle of a motion at an end, stays as it is.
    for clip, fps in ((folded, 60.0), (poses[:60], 240.0)):
        np.testing.assert_array_equal(there_and_back(clip, fps), clip)
