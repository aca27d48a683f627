"""The chordal mean of rotations: global optimum, independent of quaternion signs, and its derivative."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from controllers.motion.mean import mean_derivative, mean_rotation, signed_mean, signed_mean_derivative
from tests.controllers.clips_for_maps import matrices, wxyz
from tests.derivatives import central_differences

RNG = np.random.default_rng(3)


def _mean(unit, weights, mean=mean_rotation):
    q = np.empty(4)
    mean(unit, weights, q)
    return q


def _case(spread):
    centre = Rotation.random(random_state=RNG)
    rotations = centre * Rotation.from_rotvec(RNG.normal(size=(4, 3)) * spread)
    return wxyz(rotations) * RNG.choice([-1.0, 1.0], 4)[:, None], RNG.dirichlet(np.ones(4))


@pytest.mark.parametrize("spread", [0.0, 1e-8, 0.3, 1.0, 3.0])
def test_mean_is_the_dominant_eigenvector_for_any_spread(spread):
    for _ in range(100):
        unit, weights = _case(spread)
        values, vectors = np.linalg.eigh(np.einsum("i,ij,ik->jk", weights, unit, unit))
        # Where two eigenvalues coincide the mean is not unique.
        if values[-1] - values[-2] > 1e-3:
            assert abs(_mean(unit, weights) @ vectors[:, -1]) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("spread", [0.0, 0.3, 1.0, 3.0])
def test_mean_with_negative_weights_is_the_dominant_eigenvector(spread):
    compared = 0
    for _ in range(200):
        unit, weights = _case(spread)
        weights[:2] -= RNG.uniform(0.0, 0.5, 2)
        weights /= weights.sum()
        values, vectors = np.linalg.eigh(np.einsum("i,ij,ik->jk", weights, unit, unit))
        if weights.max() < 3.0 and values[-1] - values[-2] > 1e-2:
            compared += 1
            assert abs(_mean(unit, weights) @ vectors[:, -1]) == pytest.approx(1.0, abs=1e-12)
    assert compared > 50


def test_mean_minimises_the_chordal_distance():
    for _ in range(20):
        unit, weights = _case(0.8)
        q = _mean(unit, weights)

        def cost(rotation, unit=unit, weights=weights):
            return float(weights @ ((matrices(unit) - rotation) ** 2).sum(axis=(1, 2)))

        best = cost(matrices(q))
        for _ in range(20):
            assert cost(matrices(q) @ Rotation.from_rotvec(RNG.normal(size=3) * 0.05).as_matrix()) > best


def test_mean_of_one_or_of_equal_rotations_is_that_rotation():
    unit, _ = _case(2.0)
    np.testing.assert_allclose(_mean(unit, np.array([0.0, 0.0, 1.0, 0.0])), unit[2], atol=1e-15)
    same = np.tile(unit[0], (4, 1)) * np.array([1.0, -1.0, 1.0, -1.0])[:, None]
    assert abs(_mean(same, np.full(4, 0.25)) @ unit[0]) == pytest.approx(1.0, abs=1e-15)


def test_mean_of_rotations_half_a_turn_apart_is_the_heavier_and_finite_for_equal_weights():
    unit = wxyz(Rotation.from_rotvec([[0, 0, 0], [np.pi, 0, 0], [0, 0, 0], [0, 0, 0]]))
    assert abs(_mean(unit, np.array([0.51, 0.49, 0.0, 0.0])) @ unit[0]) == pytest.approx(1.0, abs=1e-12)
    assert abs(_mean(unit, np.array([0.49, 0.51, 0.0, 0.0])) @ unit[1]) == pytest.approx(1.0, abs=1e-12)
    equal = _mean(unit, np.array([0.5, 0.5, 0.0, 0.0]))
    assert np.linalg.norm(equal) == pytest.approx(1.0)


def test_signed_mean_of_two_rotations_passes_half_a_turn_and_agrees_with_the_other_mean_before():
    for angle in np.deg2rad([10.0, 80.0, 89.0, 91.0, 130.0]):
        unit = wxyz(Rotation.from_rotvec([[angle, 0.0, 0.0], [-angle, 0.0, 0.0]]))
        equal = np.array([0.5, 0.5])
        np.testing.assert_allclose(_mean(unit, equal, signed_mean), [1.0, 0.0, 0.0, 0.0], atol=1e-15)
        assert (abs(_mean(unit, equal)[0]) > 0.999) == (angle < 0.5 * np.pi)


@pytest.mark.parametrize(("mean", "derivative"), [(mean_rotation, mean_derivative),
                                                  (signed_mean, signed_mean_derivative)])  # fmt: skip
@pytest.mark.parametrize("spread", [0.0, 0.3, 0.8])
def test_derivative_matches_finite_differences(spread, mean, derivative):
    for _ in range(20):
        unit, weights = _case(spread)
        spin, change = RNG.normal(size=(4, 3)), RNG.normal(size=(2, 4)) * 0.1
        change -= change.mean(axis=1, keepdims=True)
        tangent = np.empty((3, 2))
        unit *= np.where(unit @ unit[0] < 0.0, -1.0, 1.0)[:, None]
        q = _mean(unit, weights, mean)
        derivative(unit, spin, weights, change, q, tangent)
        rotations = Rotation.from_quat(np.roll(unit, -1, axis=1))

        def mean_at(x, rotations=rotations, unit=unit, spin=spin, weights=weights, change=change):
            # The first parameter turns the rotations and changes the weights, the second changes the weights alone.
            turned = wxyz(rotations * Rotation.from_rotvec(x[0] * spin))
            turned *= np.sign(np.sum(turned * unit, axis=1))[:, None]
            q = _mean(turned, weights + x @ change, mean)
            return Rotation.from_quat(np.roll(q, -1))

        numeric = central_differences(mean_at, np.zeros(2), 1e-5, lambda end, start: (start.inv() * end).as_rotvec())
        np.testing.assert_allclose(tangent, numeric, atol=2e-7)
