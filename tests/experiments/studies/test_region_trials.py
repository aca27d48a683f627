"""Simulations from the boundary of a certified region: none leaves it, and all end in the ball."""

import numpy as np
import pytest

from experiments.studies.region_trials import certified_region, simulate_from


@pytest.mark.slow
def test_trajectories_from_certified_region_stay_inside():
    river, verdict = certified_region()
    assert verdict.verdict == "certified"
    rng = np.random.default_rng(5)
    outcomes = np.array([simulate_from(river, verdict.figures, 1.0, rng) for _ in range(60)])
    assert outcomes[:, 0].max() < verdict.figures["largest_distance"]
    assert outcomes[:, 1].max() < verdict.figures["ball"]
