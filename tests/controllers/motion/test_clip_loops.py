"""Clips as loops: drift, closing and temporal alignment."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from controllers.blending.alignment import aligned_channels
from controllers.errors import ParameterError
from controllers.motion.loops import append_reversal, checked_clip, closed_loop, plane_exponential, rotate_in_plane
from geometry.quaternions import about_axis, product
from tests.controllers.clips_for_maps import matrices, swinging, wxyz


def _loop(poses, fps=30.0):
    return closed_loop(checked_clip(poses, fps, "clip"), fps)


def _mean_heading(poses):
    """Mean heading [rad]: the angle of the mean of exp(iα), of the rotations' twists α about the vertical."""
    w, _, _, z = poses[:, 3:7].T
    return np.angle(np.sum((w + 1j * z) ** 2))


def _nearly_in_place(open_by=0.0):
    """A clip that moves by 14 mm, and whose height then differs."""
    poses = swinging(2, travel=0.014)
    poses[-1, 2] += open_by
    return poses


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
        (_nearly_in_place(), [0.014, 0.0, 0.0]),
        (_nearly_in_place(open_by=1e-3), [0.0, 0.0, 0.0]),
        (swinging(3, turns=1.0), [0.0, 0.0, 2 * np.pi]),
        (swinging(4, turns=-2.0), [0.0, 0.0, -4 * np.pi]),
        (_somersault(), [0.0, 0.0, 0.0]),
    ],
    ids=["in place", "walk", "closed but for 14 mm", "open", "spin", "double spin", "somersault"],
)
def test_drift_is_displacement_and_turn_per_lap(poses, drift):
    loop = _loop(poses)
    # Loops face +x on average, so the drift is turned back by the clip's mean heading.
    expected = Rotation.from_rotvec([0.0, 0.0, -_mean_heading(poses)]).apply([*drift[:2], 0.0])[:2]
    np.testing.assert_allclose(np.hypot(*loop.drift[:2]), np.hypot(*drift[:2]), atol=1e-9)
    np.testing.assert_allclose(loop.drift[:2], expected, atol=1e-9)
    assert loop.drift[2] == pytest.approx(drift[2], abs=1e-9)
    assert loop.duration == pytest.approx((len(poses) - 1) / 30.0)


def _curved_walk(turn=0.7):
    poses = swinging(5, travel=0.0)
    s = np.linspace(0.0, 1.0, len(poses))
    shift, angle = plane_exponential(s[:, None] * [1.2, 0.1, turn])
    poses[:, :2], poses[:, 3:7] = (
        rotate_in_plane(angle, poses[:, :2]) + shift,
        product(about_axis(2, angle), poses[:, 3:7]),
    )
    return poses


@pytest.mark.parametrize(("heading", "displacement"), [(0.0, [3.0, -2.0]), (2.1, [0.0, 0.0]), (-2.9, [-40.0, 7.0])])
def test_drift_of_a_rigidly_moved_clip_is_unchanged_in_its_own_frame(heading, displacement):
    poses = _curved_walk()
    moved, turn = poses.copy(), Rotation.from_euler("z", heading)
    moved[:, :3] = turn.apply(poses[:, :3]) + np.append(displacement, 0.0)
    moved[:, 3:7] = wxyz(turn * Rotation.from_quat(poses[:, 3:7], scalar_first=True))
    before, after = _loop(poses), _loop(moved)
    assert np.hypot(*before.drift[:2]) > 1.0
    np.testing.assert_allclose(after.drift, before.drift, atol=1e-9)
    s = np.linspace(0.0, 1.0, 50)
    remainders = (loop.channels(s, np.zeros(50)) for loop in (before, after))
    positions, others = zip(*((rest[:, :3], matrices(rest[:, 3:7])) for rest in remainders), strict=True)
    np.testing.assert_allclose(*positions, atol=1e-8)
    np.testing.assert_allclose(*others, atol=1e-8)


@pytest.mark.parametrize("turn", [0.0, 0.7, -2.8, 4.5, 2.0 * np.pi, -2.0 * np.pi])
def test_remainder_of_a_clip_that_turns_is_at_the_origin_and_faces_x(turn):
    """Else a change from a walk ahead to a run along an arc of 2.8 m radius moves figure and feet by a metre."""
    loop = _loop(_curved_walk(turn))
    assert np.hypot(*loop.drift[:2]) == pytest.approx(1.2, abs=0.02)
    rest = loop.channels(np.linspace(0.0, 1.0, 400, endpoint=False), np.zeros(400))
    np.testing.assert_allclose(rest[:, :2].mean(axis=0), 0.0, atol=2e-3)
    assert _mean_heading(rest) == pytest.approx(0.0, abs=2e-3)


def test_curved_walk_has_a_periodic_remainder():
    loop = _loop(_curved_walk())
    assert loop.drift[2] == pytest.approx(0.7, abs=1e-9)
    remainder = loop.channels(np.array([0.0, 1.0 - 1e-12]), np.zeros(2))
    np.testing.assert_allclose(remainder[0], remainder[1], atol=1e-8)


@pytest.mark.parametrize("turns", [-1.0, 1.0, 2.0])
def test_closed_loop_keeps_heading_drift_of_spinning_walk(turns):
    poses = swinging(2, travel=1.3)
    s = np.linspace(0.0, 1.0, len(poses))
    poses[:, 3:7] = product(about_axis(2, (2.0 * np.pi * turns - 0.24) * s), poses[:, 3:7])
    loop = _loop(poses)
    assert loop.drift[2] == pytest.approx(-0.24, abs=1e-9)
    channels = loop.channels(s, s)
    np.testing.assert_allclose(channels[:, 2], poses[:, 2], atol=1e-6)
    heading = Rotation.from_quat(channels[:, [4, 5, 6, 3]]) * Rotation.from_quat(poses[:, [4, 5, 6, 3]]).inv()
    np.testing.assert_allclose(heading.as_matrix(), heading[0].as_matrix()[None].repeat(len(s), 0), atol=1e-6)


def test_loop_with_drift_reconstructs_the_clip():
    poses = swinging(2, travel=1.3)
    loop = _loop(poses)
    s = np.linspace(0.0, 1.0, len(poses))[:-1]
    shift, angle = plane_exponential(s[:, None] * loop.drift)
    channels = loop.channels(s, np.zeros(len(s)))
    root = rotate_in_plane(angle, channels[:, :2]) + shift
    # The same path up to a rigid displacement, and the same joints.
    np.testing.assert_allclose(
        np.linalg.norm(np.diff(root, axis=0), axis=1),
        np.linalg.norm(np.diff(poses[:-1, :2], axis=0), axis=1),
        atol=1e-9,
    )
    np.testing.assert_allclose(matrices(channels[:, 7:11]), matrices(poses[:-1, 7:11]), atol=1e-12)
    np.testing.assert_allclose(channels[:, 2], poses[:-1, 2], atol=1e-12)


def test_open_clip_is_closed_smoothly_at_its_ends_only():
    whole = swinging(6, 200)
    poses = whole[:140]
    # Too fast at its ends to be played there and back.
    loop = closed_loop(checked_clip(poses, 240.0, "clip"), 240.0)
    assert np.abs(poses[-1, 7:] - poses[0, 7:]).max() > 0.02
    s = np.arange(139) / 139
    found = loop.channels(s, np.zeros(139))
    inside = (s > 0.2) & (s < 0.8)
    np.testing.assert_allclose(matrices(found[inside, 7:11]), matrices(poses[:-1][inside, 7:11]), atol=1e-12)
    # Twice differentiable over the seam: second differences have no outliers there.
    fine = loop.channels(np.arange(-60, 60) / 3000.0, np.zeros(120))[:, 7:11]
    rotations = Rotation.from_matrix(matrices(fine))
    velocity = (rotations[:-1].inv() * rotations[1:]).as_rotvec() * 3000.0
    jumps = np.abs(np.diff(velocity, axis=0)).max(axis=1)
    assert jumps.max() < 6.0 * np.median(jumps) + 1e-6


def test_clips_of_two_frames_and_still_clips_are_loops():
    for poses in (swinging(7)[[0, 40]], np.tile(swinging(7)[:1], (50, 1))):
        values = _loop(poses).channels(np.linspace(0.0, 1.0, 20), np.zeros(20))
        assert np.isfinite(values).all()
        np.testing.assert_allclose(np.linalg.norm(values[:, 7:11], axis=1), 1.0)


def test_time_shifted_and_warped_clips_are_aligned():
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
    ("poses", "fps", "message"),
    [
        (np.zeros((5, 18)), 30.0, r"shape \(n, 7 \+ 4 joints\), got \(5, 18\)"),
        (swinging(1)[:1], 30.0, "at least 2 frames, got 1"),
        (swinging(1), 0.0, "fps must be positive and finite, got 0.0"),
        (np.full((5, 19), np.nan), 30.0, "frame 0 is not finite"),
        (swinging(1) * 2.0, 30.0, "is not unit"),
    ],
)
def test_invalid_clips_raise_parameter_error(poses, fps, message):
    with pytest.raises(ParameterError, match=message):
        checked_clip(poses, fps, "clip 2")


def test_open_clip_at_rest_is_played_there_and_back():
    t = np.linspace(0.0, 1.0, 121)
    share = (t**3 * (10.0 - 15.0 * t + 6.0 * t**2))[:, None]
    poses = np.zeros((121, 11))
    poses[:, :3] = [0.0, 0.0, 0.9] + share * [0.3, 0.1, -0.2]
    poses[:, 3] = 1.0
    poses[:, 7:] = np.concatenate([np.cos(0.4 * share), np.sin(0.4 * share), 0.0 * share, 0.0 * share], axis=1)
    folded = append_reversal(poses, 60.0)
    np.testing.assert_allclose(folded[::-1], folded, atol=1e-12)
    np.testing.assert_allclose(folded[[0, len(folded) // 2, -1]], poses[[0, -1, 0]], atol=1e-6)
    loop = closed_loop(folded, 60.0)
    assert np.abs(loop.drift).max() < 1e-9
    # A clip that is closed already, or moves at an end, is unchanged.
    for clip, fps in ((folded, 60.0), (poses[:60], 240.0)):
        np.testing.assert_array_equal(append_reversal(clip, fps), clip)
