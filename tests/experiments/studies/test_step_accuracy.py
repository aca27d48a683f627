"""Separation of the difference of two trajectories into path and timing."""

import numpy as np

from experiments.studies.step_accuracy import off_path

T = np.arange(2000) * 1e-3


def circle(t: np.ndarray, radius: float = 0.05) -> np.ndarray:
    return radius * np.column_stack([np.cos(t), np.sin(t), 0.0 * t])


def test_time_lag_on_same_path_is_not_off_path() -> None:
    late = circle(T - 1e-3)
    assert np.linalg.norm(late - circle(T), axis=1).min() > 49e-6
    assert np.linalg.norm(off_path(late, circle(T)), axis=1).max() < 1e-7  # 0.5 r dt²


def test_parallel_path_is_off_by_its_distance() -> None:
    for other in (circle(T, 0.05002), circle(T) + np.array([0.0, 0.0, 2e-5])):
        assert np.allclose(np.linalg.norm(off_path(other, circle(T)), axis=1), 2e-5, rtol=1e-6)


def test_whole_distance_counts_for_a_resting_hand() -> None:
    still = np.zeros((5, 3))
    assert np.array_equal(off_path(still + 3e-6, still), still + 3e-6)
