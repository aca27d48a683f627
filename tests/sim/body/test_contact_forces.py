import numpy as np
import pytest
from scipy.optimize import nnls

from sim.body.contact_forces import N_EDGES, cone_edges, shared_forces


def _random_problem(rng):
    """Cones at random points under a body, scaled as in the figure's control, and a wrench near body weight."""
    n = int(rng.integers(1, 11))
    edges = np.empty((N_EDGES * n, 6))
    for i in range(n):
        cone_edges(rng.normal(size=3) * (0.3, 0.2, 0.05) - (0, 0, 0.9), 0.8, edges[N_EDGES * i : N_EDGES * i + N_EDGES])
    share = 3e3 * np.repeat(rng.uniform(size=n) ** 3, N_EDGES)
    return edges, share, rng.normal(size=6) * (0.2, 0.2, 0, 0.5, 0.5, 0.1) + (0, 0, 1, 0, 0, 0)


def _solve(edges, share, wrench, guess):
    residual, force = guess.copy(), np.empty(len(share))
    steps = shared_forces(edges, share, wrench, residual, force)
    return force, residual, steps


@pytest.mark.parametrize("seed", range(100))
def test_forces_equal_non_negative_least_squares(seed):
    edges, share, wrench = _random_problem(np.random.default_rng(seed))
    force, residual, steps = _solve(edges, share, wrench, np.zeros(6))
    stacked = np.vstack((edges.T, np.diag(1 / np.sqrt(share))))
    expected, _ = nnls(stacked, np.concatenate((wrench, np.zeros(len(share)))), maxiter=10000)
    np.testing.assert_allclose(force, expected, atol=1e-8)
    np.testing.assert_allclose(residual, wrench - edges.T @ expected, atol=1e-8)
    assert steps < 30


def test_warm_start_changes_the_step_count_but_not_the_forces():
    rng = np.random.default_rng(1)
    edges, share, wrench = _random_problem(rng)
    cold = _solve(edges, share, wrench, np.zeros(6))
    warm = _solve(edges, share, wrench, cold[1])
    wild = _solve(edges, share, wrench, 10 * rng.normal(size=6))
    np.testing.assert_allclose(warm[0], cold[0], atol=1e-9)
    np.testing.assert_allclose(wild[0], cold[0], atol=1e-9)
    assert warm[2] <= 1


def test_point_without_share_bears_no_force():
    edges, share, wrench = _random_problem(np.random.default_rng(4))
    share[:N_EDGES] = 0.0
    force, _, _ = _solve(edges, share, wrench, np.zeros(6))
    assert np.all(force[:N_EDGES] == 0.0)
    assert force.sum() > 0.0


def test_ground_forces_only_push():
    edges, share, _ = _random_problem(np.random.default_rng(5))
    force, residual, _ = _solve(edges, share, np.array([0, 0, -1.0, 0, 0, 0]), np.zeros(6))
    assert np.all(force >= 0.0)
    assert residual[2] <= -1.0 + 1e-6


def test_cone_edges_are_wrenches_on_the_friction_cone():
    point, friction, edges = np.array([0.2, -0.1, -0.9]), 0.7, np.empty((N_EDGES, 6))
    cone_edges(point, friction, edges)
    np.testing.assert_allclose(edges[:, 3:], np.cross(point, edges[:, :3]), atol=1e-15)
    np.testing.assert_allclose(np.hypot(edges[:, 0], edges[:, 1]), friction * edges[:, 2])
    np.testing.assert_allclose(edges[:, :3].sum(axis=0), [0, 0, N_EDGES], atol=1e-15)
