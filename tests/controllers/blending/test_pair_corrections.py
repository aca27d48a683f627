"""Foot corrections for any number of clips: pairwise, zero for a single clip, and with analytic derivatives."""

import numpy as np
import pytest

from controllers.blending.pair_corrections import neighbouring_pairs, packed_pairs, pair_channels, pair_correction
from controllers.legs.footfalls import foot_corrections
from tests.controllers.legs.test_footfalls import LEGS, REST, N, kicking, walking
from tests.derivatives import central_differences

CLIPS = np.stack([kicking(0, 0.1, 0.4), kicking(1, 0.2, 0.5), walking(0.6, 0.03)], axis=1)
DRIFTS = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.6, 0.0, 0.0]])
PAIRS = [(0, 1), (0, 2), (1, 2)]
PACKED = packed_pairs(CLIPS, DRIFTS, LEGS, PAIRS)
ALL_CLIPS = np.arange(3)


def correction(angle, w, changes=None, clips=ALL_CLIPS):
    d = np.empty((4, pair_channels(PACKED)))
    none = np.zeros((3, len(w)))
    pair_correction(PACKED, angle, clips, np.asarray(w, dtype=float), none if changes is None else changes, d)
    return d


@pytest.mark.parametrize(("i", "j"), PAIRS)
@pytest.mark.parametrize("share", [1 / 4, 1 / 2, 3 / 4])
def test_correction_between_two_clips_equals_foot_corrections(i, j, share):
    w = np.zeros(3)
    w[i], w[j] = 1.0 - share, share
    expected = foot_corrections(CLIPS, DRIFTS, LEGS, w[None])[:, 0]
    assert np.abs(expected).max() > 0.002
    for row in range(0, N, 7):
        np.testing.assert_allclose(correction(2.0 * np.pi * row / N, w)[0], expected[row], atol=1e-12)


def test_correction_is_zero_for_a_single_clip_and_independent_of_clip_order():
    for w in np.eye(3):
        np.testing.assert_array_equal(correction(1.3, w)[0], 0.0)
    w, order = np.array([0.5, 0.2, 0.3]), np.array([2, 0, 1])
    np.testing.assert_allclose(correction(1.3, w)[0], correction(1.3, w[order], clips=order)[0], atol=1e-15)


def test_derivatives_match_finite_differences():
    rng = np.random.default_rng(0)
    for _ in range(50):
        angle, w, changes = rng.uniform(0.1, 6.1), rng.uniform(-0.2, 0.8, 3), rng.normal(size=(3, 3))
        found = correction(angle, w, changes)
        # The first derivative is along the angle, the others are along changes of the weights alone.
        for rate, change, derivative in zip((1.0, 0.0, 0.0), changes, found[1:], strict=True):

            def along(h, rate=rate, change=change, angle=angle, w=w):
                return correction(angle + h * rate, w + h * change)[0]

            expected = central_differences(along, 0.0, 1e-5)
            np.testing.assert_allclose(derivative, expected, atol=1e-6 * (1.0 + np.abs(expected).max()))


def test_neighbouring_pairs_have_no_other_clip_between_them_at_any_phase():
    line = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
    assert neighbouring_pairs(np.stack([line, line])) == [(0, 1), (1, 2)]
    away = line.copy()
    away[1, 1] = 3.0
    assert neighbouring_pairs(np.stack([line, away])) == [(0, 1), (0, 2), (1, 2)]
    assert neighbouring_pairs(np.zeros((4, 1, 2))) == []


def test_neighbouring_pairs_for_a_share_need_that_share_of_the_lap_without_clips_between():
    square = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    assert neighbouring_pairs(np.tile(square, (96, 1, 1)), 0.5) == [(0, 1), (0, 2), (1, 3), (2, 3)]
    line = np.tile([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]], (96, 1, 1))
    assert neighbouring_pairs(line, 0.5) == [(0, 1), (1, 2)]
    aside = line.copy()
    aside[:47, 1] = 0.5, 3.0
    assert (0, 2) not in neighbouring_pairs(aside, 0.5)
    aside[:48, 1] = 0.5, 3.0
    assert (0, 2) in neighbouring_pairs(aside, 0.5)


def test_no_channels_without_limbs():
    assert pair_channels(packed_pairs(CLIPS[..., :REST], DRIFTS, [], PAIRS)) == 0
