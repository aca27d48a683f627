"""Features of motions, and the common lap in which motions that are alike are so at the same angle."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from controllers.haptic_map.lifting.common_lap import N_SAMPLES, common_lap
from controllers.haptic_map.lifting.motion_features import features
from tests.controllers.clips_for_maps import JOINTS, difference, swinging, wxyz
from tests.controllers.haptic_map.lifting.swinging_motions import WEIGHTS, motion


def test_distance_of_close_poses_equals_their_weighted_tangent():
    rng = np.random.default_rng(0)
    poses = swinging(1, frames=8)
    nearby = poses.copy()
    nearby[:, 2] += 1e-4 * rng.normal(size=9)
    for first in range(7, 19, 4):
        turn = Rotation.from_rotvec(1e-4 * rng.normal(size=(9, 3)))
        nearby[:, first : first + 4] = wxyz(Rotation.from_quat(np.roll(poses[:, first : first + 4], -1, axis=1)) * turn)
    here, there = (features(motion(p), WEIGHTS, 9).pose for p in (poses, nearby))
    for k in range(9):
        tangent = difference(nearby[k], poses[k])
        turns = WEIGHTS[1:, None] * tangent[6:].reshape(JOINTS, 3)
        expected = np.sqrt(tangent[2] ** 2 + (turns**2).sum())
        assert np.linalg.norm(there[k] - here[k]) == pytest.approx(expected, rel=1e-6)


def test_features_do_not_depend_on_position_and_heading():
    poses = swinging(2, travel=1.0)
    moved, turn = poses.copy(), Rotation.from_rotvec([0.0, 0.0, 2.1])
    moved[:, :3] = turn.apply(poses[:, :3]) + np.array([3.0, -1.0, 0.0])
    moved[:, 3:7] = wxyz(turn * Rotation.from_quat(np.roll(poses[:, 3:7], -1, axis=1)))
    for here, there in zip(*(features(motion(p), WEIGHTS, 50) for p in (poses, moved)), strict=True):
        np.testing.assert_allclose(there, here, atol=1e-9)


def test_feature_velocities_match_differences_of_poses():
    poses = swinging(3, frames=240)
    own = features(motion(poses), WEIGHTS, 241)
    step = np.array([difference(poses[k + 1], poses[k - 1]) * 15.0 for k in range(1, 240)])
    spin = (step[:, 3:].reshape(239, -1, 3) * WEIGHTS[:, None]).reshape(239, -1)
    np.testing.assert_allclose(own.velocity[1:-1, 3:], spin, atol=2e-3)
    assert np.linalg.norm(own.velocity[120, :3]) == pytest.approx(np.linalg.norm(step[119, :3]), rel=1e-2)


def test_common_lap_removes_a_phase_shift():
    clips = [motion(swinging(5), "a"), motion(swinging(5, phase=0.3), "b")]
    a, b = common_lap(clips, [features(m, WEIGHTS, N_SAMPLES) for m in clips])
    # b at share s is a at s + 0.3.
    lag = np.mod(a.share(np.array([0.2])) - b.share(np.array([0.2])), 1.0)
    assert lag == pytest.approx(0.3, abs=0.5 / 96)


def test_common_lap_removes_a_time_warp():
    even = swinging(6, frames=200)
    s = np.linspace(0.0, 1.0, 201)
    late = s - 0.05 * np.sin(2.0 * np.pi * s)
    warped = np.stack([np.interp(late, s, column) for column in even.T], axis=1)
    warped[:, 3:] /= np.repeat(np.linalg.norm(warped[:, 3:].reshape(201, -1, 4), axis=2), 4, axis=1)
    clips = [motion(even, "even"), motion(warped, "late")]
    a, b = common_lap(clips, [features(m, WEIGHTS, N_SAMPLES) for m in clips])
    lap = np.arange(96) / 96
    error = np.interp(np.mod(b.share(lap), 1.0), s, late) - np.mod(a.share(lap), 1.0)
    error -= np.round(error)
    # Unwarped it would be 0.05.
    assert np.abs(error).max() < 0.02


def test_common_lap_aligns_clips_by_contacts_where_poses_are_equal():
    """Two clips of a still figure that differ in their contacts alone."""
    still = np.tile(swinging(1)[:1], (101, 1))
    s = np.linspace(0.0, 1.0, 101)
    walks = []
    for name, lead in (("a", 0.0), ("b", 0.35)):
        left = np.mod(s + lead, 1.0) < 0.5
        walks.append(motion(still, name, supports=np.stack([left, ~left], axis=1)))
    a, b = common_lap(walks, [features(m, WEIGHTS, N_SAMPLES) for m in walks])
    lap = np.arange(96) / 96
    stands = [np.mod(phase.share(lap) + lead, 1.0) < 0.5 for phase, lead in ((a, 0.0), (b, 0.35))]
    assert np.mean(stands[0] == stands[1]) > 0.97
