"""The chordal mean of rotations: global, blind to signs, and its derivative."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from controllers.motion.mean import mean_derivative, mean_rotation
from tests.controllers.clips_for_maps import matrices, wxyz

RNG = np.random.default_rng(3)


def _mean(unit, weights):
    q = np.empty(4)
    mean_rotation(unit, weights, q)
    return q


def _case(spread):
    centre = Rotation.random(random_state=RNG)
    rotations = centre * Rotation.from_rotvec(RNG.normal(size=(4, 3)) * spread)
    return wxyz(rotations) * RNG.choice([-1.0, 1.0], 4)[:, None], RNG.dirichlet(np.ones(4))


@pytest.mark.parametrize("spread", [0.0, 1e-8, 0.3, 1.0, 3.0])
def test_it_is_the_dominant_eigenvector_for_any_spread(spread):
    for _ in range(100):
        unit, weights = _case(spread)
        values, vectors = np.linalg.eigh(np.einsum("i,ij,ik->jk", weights, unit, unit))
        # Where two eigenvalues meet the mean is not unique, and rounding decides.
        if values[-1] - values[-2] > 1e-3:
            assert abs(_mean(unit, weights) @ vectors[:, -1]) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("spread", [0.0, 0.3, 1.0, 3.0])
def test_with_negative_weights_it_is_still_the_eigenvector_of_the_largest_eigenvalue(spread):
    told = 0
    for _ in range(200):
        unit, weights = _case(spread)
        weights[:2] -= RNG.uniform(0.0, 0.5, 2)
        weights /= weights.sum()
        values, vectors = np.linalg.eigh(np.einsum("i,ij,ik->jk", weights, unit, unit))
        if weights.max() < 3.0 and values[-1] - values[-2] > 1e-2:
            told += 1
            assert abs(_mean(unit, weights) @ vectors[:, -1]) == pytest.approx(1.0, abs=1e-12)
    assert told > 50


def test_it_minimises_the_chordal_distance():
    for _ in range(20):
        unit, weights = _case(0.8)
        q = _mean(unit, weights)

        def cost(rotation, unit=unit, weights=weights):
            return float(weights @ ((matrices(unit) - rotation) ** 2).sum(axis=(1, 2)))

        best = cost(matrices(q))
        for _ in range(20):
            assert cost(matrices(q) @ Rotation.from_rotvec(RNG.normal(size=3) * 0.05).as_matrix()) > best


def test_one_rotation_alone_and_equal_rotations_are_their_own_mean():
    unit, _ = _case(2.0)
    np.testing.assert_allclose(_mean(unit, np.array([0.0, 0.0, 1.0, 0.0])), unit[2], atol=1e-15)
    same = np.tile(unit[0], (4, 1)) * np.array([1.0, -1.0, 1.0, -1.0])[:, None]
    assert abs(_mean(same, np.full(4, 0.25)) @ unit[0]) == pytest.approx(1.0, abs=1e-15)


def test_half_a_turn_apart_it_follows_the_heavier_and_stays_finite_in_equal_parts():
    unit = wxyz(Rotation.from_rotvec([[0, 0, 0], [np.pi, 0, 0], [0, 0, 0], [0, 0, 0]]))
    assert abs(_mean(unit, np.array([0.51, 0.49, 0.0, 0.0])) @ unit[0]) == pytest.approx(1.0, abs=1e-12)
    assert abs(_mean(unit, np.array([0.49, 0.51, 0.0, 0.0])) @ unit[1]) == pytest.approx(1.0, abs=1e-12)
    equal = _mean(unit, np.array([0.5, 0.5, 0.0, 0.0]))
    assert np.linalg.norm(equal) == pytest.approx(1.0)


@pytest.mark.parametrize("spread", [0.0, 0.3, 0.8])
def test_its_derivative_agrees_with_differences(spread):
    for _ in range(20):
        unit, weights = _case(spread)
        spin, change = RNG.normal(size=(4, 3)), RNG.normal(size=(2, 4)) * 0.1
        change -= change.mean(axis=1, keepdims=True)
        tangent = np.empty((3, 2))
        q = _mean(unit, weights)
        mean_derivative(unit, spin, weights, change, q, tangent)
        rotations, h = Rotation.from_quat(np.roll(unit, -1, axis=1)), 1e-5

        def moved(spun, weighed, rotations=rotations, spin=spin, weights=weights, change=change):
            q = _mean(wxyz(rotations * Rotation.from_rotvec(spun * spin)), weights + weighed @ change)
            return Rotation.from_quat(np.roll(q, -1))

        # The first parameter turns the rotations and changes the weights, the second changes the weights alone.
        first, second = np.array([h, 0.0]), np.array([0.0, h])
        by_spin = (moved(-h, -first).inv() * moved(h, first)).as_rotvec() / (2 * h)
        by_weight = (moved(0.0, -second).inv() * moved(0.0, second)).as_rotvec() / (2 * h)
        np.testing.assert_allclose(tangent, np.column_stack([by_spin, by_weight]), atol=2e-7)
