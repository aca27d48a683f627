"""Arrangement of curves round the z axis: that of least energy which keeps them apart, from several starts."""

import numpy as np

from controllers.haptic_map.lifting.arrangement_energy import N_ANGLES, N_ROWS, Energy, Task, evaluate_sites
from controllers.haptic_map.lifting.bounded_descent import minimise
from controllers.haptic_map.lifting.layouts import on_lattice, scaled
from geometry.arrays import Array

# Energies that differ by less are equal: a mirror image has the same, and rounding must not choose.
_ENERGY_TOLERANCE = 1e-6


def arrange(task: Task, rng: np.random.Generator) -> tuple[Array, Array]:
    """Control points (N_ROWS, n, 2) of the arrangement, and of the first initial guess.

    The energy is minimised from positions that reproduce the motions' mean distances, from a lattice, and
    from a perturbation of the first; the result of least energy that keeps the curves apart is returned. If none does,
    the lattice is returned.

    Parameters
    ----------
    task : Task
        The rectangle must have room: at least as many points on `lattice` as clips.
    rng : numpy.random.Generator
    """
    n = task.distance.shape[1]
    rectangle = task.rectangle
    first = scaled(task.scale * task.distance.mean(axis=0), task.rate.mean(axis=0), rectangle)
    lattice_layout = on_lattice(first, rectangle, task.separation)
    jitter = 0.1 * (rectangle.high - rectangle.low)
    layouts = [first, lattice_layout, first + rng.uniform(-1.0, 1.0, (n, 2)) * jitter]
    energy, best, least = Energy(task), np.tile(lattice_layout, (N_ROWS, 1, 1)), np.inf
    low, high = (np.tile(corner, N_ROWS * n) for corner in (rectangle.low, rectangle.high))
    for layout in layouts:
        # Without noise, coincident sites would have no gradient that separates them.
        noise = 1e-4 * rng.uniform(-1.0, 1.0, (n, 2))
        start = np.clip(layout + noise, rectangle.low, rectangle.high)
        found, value = minimise(energy, np.tile(start, (N_ROWS, 1, 1)).ravel(), low, high)
        controls = found.reshape(N_ROWS, n, 2)
        if value < (1.0 - _ENERGY_TOLERANCE) * least and is_apart(task, controls):
            best, least = controls, value
    return best, np.tile(first, (N_ROWS, 1, 1))


def is_apart(task: Task, controls: Array) -> bool:
    """Whether sites keep the separation at every angle, and near their transitions half of the approach."""
    q = evaluate_sites(controls)[0]
    n = q.shape[1]
    least = np.full((N_ANGLES, n, n), task.separation)
    for first, second, near in task.windows():
        allowed = np.where(near < 1.0, 0.5 * task.approach, task.separation)
        least[:, first, second] = least[:, second, first] = np.minimum(least[:, first, second], allowed)
    distance = np.linalg.norm(q[:, :, None] - q[:, None], axis=3)
    i, j = np.triu_indices(n, 1)
    return bool((distance[:, i, j] >= least[:, i, j]).all())
