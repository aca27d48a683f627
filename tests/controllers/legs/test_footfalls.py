"""Foot corrections of blends: feet step one at a time and stand still, and a single clip is unchanged."""

import numpy as np
import pytest

from controllers.legs.footfalls import foot_corrections
from controllers.legs.limbs import Limb
from controllers.motion.inbetween import FOOT, ROOT
from controllers.motion.loops import plane_exponential, rotate_in_plane
from tests.controllers.clips_for_maps import LEG

N = 400
S = np.arange(N) / N
SOLE = np.array([[-0.1, 0.03, 0.0], [-0.1, -0.03, 0.0], [0.1, 0.03, 0.0], [0.1, -0.03, 0.0]])
LEGS = [Limb(joints, LEG.offsets, LEG.axis, SOLE) for joints in ((1, 2, 3), (4, 5, 6))]
REST = 3 + 4 * 7


def bump(start, end):
    """Progress of a step from 0 to 1 over an interval of the lap, and its lift."""
    x = np.clip((S - start) / (end - start), 0.0, 1.0)
    return x**3 * (10.0 - 15.0 * x + 6.0 * x**2), np.sin(np.pi * x) ** 2


def clip(left, right):
    """Channels (N, numbers) of flat feet at (x, y, lift), shape (N, 3) each."""
    channels = np.zeros((N, REST + 8))
    channels[:, 3:REST:4] = 1.0
    for j, foot in enumerate((left, right)):
        channels[:, REST + 4 * j : REST + 4 * j + 3] = foot
    return channels


def kicking(limb, start, end, height=0.1, ahead=0.3):
    """Channels of a clip in which one foot kicks forwards and returns while the other stands."""
    _, lift = bump(start, end)
    feet = [np.zeros((N, 3)), np.zeros((N, 3))]
    feet[0][:, 1], feet[1][:, 1] = 0.1, -0.1
    feet[limb][:, 0], feet[limb][:, 2] = ahead * lift, height * lift
    return clip(*feet)


def walking(length, height):
    """Channels of a walk of two steps a lap in the frame of the drift: each foot stands except in its own step."""
    feet = []
    for y, start, end in ((0.1, 0.05, 0.45), (-0.1, 0.55, 0.95)):
        progress, lift = bump(start, end)
        feet.append(np.stack([length * (progress - S), np.full(N, y), height * lift], axis=1))
    return clip(*feet)


def paths(clips, drifts, weights):
    """Corrected feet in the world for given weights: positions (N, 2, 2) and heights (N, 2)."""
    channels, weights = np.stack(clips, axis=1), np.asarray(weights)
    d = foot_corrections(channels, drifts, LEGS, weights[None])[:, 0, ROOT:].reshape(N, 2, FOOT)
    ends = np.einsum("m,nmk->nk", weights, channels)[:, REST:].reshape(N, 2, 4)
    shift, angle = plane_exponential(S[:, None] * (weights @ drifts))
    positions = rotate_in_plane(angle[:, None], ends[..., :2] + d[..., :2]) + shift[:, None]
    return positions, ends[..., 2] + d[..., 2]


CLIPS = [kicking(0, 0.1, 0.4), kicking(1, 0.2, 0.5)]
NO_DRIFT = np.zeros((2, 3))


def test_correction_is_zero_for_a_single_clip():
    for weights in np.eye(2):
        d = foot_corrections(np.stack(CLIPS, axis=1), NO_DRIFT, LEGS, weights[None])
        np.testing.assert_allclose(d, 0.0, atol=1e-12)


@pytest.mark.parametrize("share", [0.2, 0.5, 0.7])
def test_one_of_two_feet_lifted_at_once_stands_still(share):
    positions, heights = paths(CLIPS, NO_DRIFT, [1.0 - share, share])
    mean = np.einsum("m,nmk->nk", [1.0 - share, share], np.stack(CLIPS, axis=1))[:, REST:].reshape(N, 2, 4)
    assert mean[..., 2].min(axis=1).max() > 0.01
    np.testing.assert_allclose(heights.min(axis=1), 0.0, atol=2e-3)
    for j in range(2):
        # The uncorrected mean drags this foot along while it is the lower one.
        lower = mean[:, j, 2] <= mean[:, 1 - j, 2]
        dragged = np.abs(np.diff(mean[:, j, 0]))[lower[1:] & lower[:-1]].sum()
        stands = heights[:, j] < 1e-3
        moved = np.linalg.norm(np.diff(positions[:, j], axis=0), axis=1)
        assert moved.sum() > 0.05
        assert moved[stands[1:] & stands[:-1]].sum() < 0.15 * dragged


def test_small_share_of_a_step_is_still_lifted_and_made():
    standing = clip(*(np.tile([0.0, y, 0.0], (N, 1)) for y in (0.1, -0.1)))
    drifts = np.array([[0.6, 0.0, 0.0], [0.0, 0.0, 0.0]])
    positions, heights = paths([walking(0.6, 0.03), standing], drifts, [0.1, 0.9])
    for j in range(2):
        x = positions[:, j, 0]
        assert heights[:, j].max() > 0.006
        low = heights[:, j] < 0.003
        # The uncorrected mean would move a quarter of its 6 cm this close to the floor.
        assert np.abs(np.diff(x))[low[1:] & low[:-1]].sum() < 0.004
        assert x[-1] - x[0] == pytest.approx(0.06, abs=0.02)


def test_height_at_which_all_clips_fly_is_unchanged():
    _, lift = bump(0.6, 0.9)
    flying = [c.copy() for c in CLIPS]
    for c in flying:
        for column in (2, 6):
            c[:, REST + column] += 0.2 * lift
    _, heights = paths(flying, NO_DRIFT, [0.5, 0.5])
    np.testing.assert_allclose(heights[S > 0.55], np.outer(0.2 * lift[S > 0.55], [1.0, 1.0]), atol=1e-3)


def test_correction_of_a_turning_mixture_closes_over_the_lap():
    drifts = np.array([[0.0, 0.0, 2.0 * np.pi], [0.0, 0.0, 0.0]])
    d = foot_corrections(np.stack(CLIPS, axis=1), drifts, LEGS, np.array([[0.5, 0.5]]))[:, 0]
    jumps = np.abs(np.diff(d, axis=0)).max(axis=0)
    assert (np.abs(d[0] - d[-1]) <= 3.0 * jumps + 1e-6).all()
