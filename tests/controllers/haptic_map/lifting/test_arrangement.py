"""The arrangement of curves: its energy, its minimum, the lattice of its starts, the least separation."""

import numpy as np
import pytest

from controllers.haptic_map.lifting.arrangement import arrange, is_apart
from controllers.haptic_map.lifting.arrangement_energy import N_ANGLES, N_ROWS, Energy, Task, evaluate_sites
from controllers.haptic_map.lifting.layouts import lattice, scaled
from controllers.haptic_map.lifting.room import Rectangle
from controllers.haptic_map.lifting.transitions import Transition
from tests.controllers.haptic_map.lifting.swinging_motions import ROOM
from tests.derivatives import central_differences


def random_task(distance, speed, acceleration):
    """Four clips with two transitions; at several rad/s, the given limits may be exceeded."""
    rng = np.random.default_rng(1)
    return Task(
        Rectangle(0.02, 0.07, -0.05, 0.05), 0.01, 0.002, speed, acceleration, distance,
        [Transition(0, 1, 1.0, 0.0, 0.0, 0.0, (0.0, 0.0)), Transition(1, 2, 3.0, 0.0, 0.0, 0.0, (0.0, 0.0))],
        6.0 + rng.normal(size=(N_ANGLES, 4)), rng.normal(size=(N_ANGLES, 4)),
    )  # fmt: skip


def random_distances():
    distance = 0.1 * np.abs(np.random.default_rng(0).normal(size=(N_ANGLES, 4, 4)))
    return distance + distance.transpose(0, 2, 1)


def test_energy_gradient_matches_finite_differences():
    rng, distance = np.random.default_rng(0), random_distances()
    task = random_task(distance, 0.1, 0.5)
    energy = Energy(task)
    start = np.tile(scaled(task.scale * distance.mean(axis=0), np.arange(4.0), task.rectangle), (N_ROWS, 1, 1))
    x = (start + 2e-3 * rng.normal(size=start.shape)).ravel()
    gradient = energy(x).gradient
    for _ in range(5):
        direction = rng.normal(size=x.size)
        slope = central_differences(lambda h, direction=direction: energy(x + h * direction).value, 0.0, 1e-7)
        assert gradient @ direction == pytest.approx(slope, rel=1e-6)


def test_energy_curvature_is_its_hessian_where_the_sites_are_farther_apart_than_wanted():
    """Equal motions are wanted as near each other as they may be; limits are exceeded."""
    rng = np.random.default_rng(2)
    energy = Energy(random_task(np.zeros((N_ANGLES, 4, 4)), 0.1, 0.5))
    corners = np.array([[0.025, -0.04], [0.065, -0.04], [0.025, 0.04], [0.065, 0.04]])
    x = (np.tile(corners, (N_ROWS, 1, 1)) + 1e-3 * rng.normal(size=(N_ROWS, 4, 2))).ravel()
    curvature = energy(x).curvature
    for _ in range(5):
        direction = rng.normal(size=x.size)
        bent = central_differences(lambda h, direction=direction: energy(x + h * direction).gradient, 0.0, 1e-7)
        np.testing.assert_allclose(curvature @ direction, bent, rtol=1e-5, atol=1e-6 * np.abs(bent).max())


def test_energy_curvature_is_positive_semidefinite_where_sites_are_too_near():
    rng = np.random.default_rng(3)
    energy = Energy(random_task(random_distances(), 0.1, 0.5))
    x = (np.array([0.045, 0.0]) + 5e-3 * rng.normal(size=(N_ROWS, 4, 2))).ravel()
    curvature = energy(x).curvature
    values = np.linalg.eigvalsh(curvature)
    np.testing.assert_allclose(curvature, curvature.T, atol=1e-9 * values[-1])
    assert values[0] > -1e-12 * values[-1]


@pytest.mark.slow
def test_arrangement_does_not_depend_on_the_starts():
    """All of them reach the same energy: rounding, in which processors differ, cannot choose another minimum."""
    task, values = random_task(random_distances(), 1.0, 8.0), list[float]()
    for seed in range(2):
        controls, _ = arrange(task, np.random.default_rng(seed))
        values.append(Energy(task)(controls.ravel()).value)
    assert values == pytest.approx([values[0]] * 2, rel=1e-6)


def test_curves_are_level_at_every_pace_and_straightest_at_a_fast_one():
    # Two motions that are alike twice a lap.
    lap = 0.05 + 0.03 * np.cos(2.0 * np.linspace(0.0, 2.0 * np.pi, N_ANGLES, endpoint=False))
    distance = lap[:, None, None] * (1.0 - np.eye(2))
    bends, paces = list[float](), list[float]()
    for rate in (0.5, 3.0, 9.0):
        still = np.zeros((N_ANGLES, 2))
        task = Task(ROOM.rectangle, 0.01, 0.002, 10.0, 100.0, distance, [], still + rate, still)
        controls, first = arrange(task, np.random.default_rng(0))
        energy = Energy(task)
        assert energy(controls.ravel()).value < energy(first.ravel()).value
        bends.append(np.ptp(controls, axis=0).max())
        sites, slopes, _ = evaluate_sites(controls)
        # Of a push across the curves with 2.5 N, against 8 N s/m, relative to the speed θ̇ r of a level curve.
        along = 2.5 / 8.0 * np.linalg.norm(slopes, axis=2) / sites[..., 0]
        paces.append((along / (rate * sites[..., 0])).max())
    assert bends[1] > 3e-4
    assert max(bends[0], bends[2]) < 0.1 * bends[1]
    assert max(paces) < 0.06


def test_lattice_is_dense_and_respects_the_separation():
    rectangle = Rectangle(0.02, 0.072, -0.05, 0.05)
    for separation in (0.004, 0.01, 0.03):
        points = lattice(rectangle, separation)
        apart = np.linalg.norm(points[:, None] - points, axis=2) + np.eye(len(points))
        assert apart.min() >= separation * (1.0 - 1e-9)
        assert (points >= rectangle.low - 1e-12).all()
        assert (points <= rectangle.high + 1e-12).all()
        # Compared with a square lattice.
        assert len(points) >= (int(0.052 / separation) + 1) * (int(0.1 / separation) + 1) * 0.9


def test_is_apart_detects_curves_that_come_too_close():
    """The check on which `arrange` relies."""
    task = Task(
        Rectangle(0.02, 0.07, -0.05, 0.05), 0.01, 0.002, 1.0, 8.0, np.ones((N_ANGLES, 2, 2)), [],
        np.ones((N_ANGLES, 2)), np.zeros((N_ANGLES, 2)),
    )  # fmt: skip
    controls = np.tile(np.array([[0.03, 0.0], [0.05, 0.0]]), (N_ROWS, 1, 1))
    assert is_apart(task, controls)
    controls[10:20, 1, 0] = 0.035
    assert not is_apart(task, controls)
    assert evaluate_sites(controls)[0].shape == (N_ANGLES, 2, 2)
