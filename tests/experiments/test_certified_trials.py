"""Hands inside the assumptions of random certified rivers, let go in MuJoCo: none diverges."""

import numpy as np
import pytest

from experiments.certified_trials import ASSUMED, EVERYTHING, draw_certified, let_go


@pytest.mark.slow
def test_no_hand_diverges_in_a_certified_river():
    rng = np.random.default_rng(3)
    for _ in range(3):
        drawn = draw_certified(rng)
        assert drawn.radius < 1.0
        for conditions in (ASSUMED, EVERYTHING):
            assert not any(let_go(drawn, conditions, rng).diverges for _ in range(6))
        # The same hands in a river far beyond its critical stiffness: the trials could have refuted it.
        wild = drawn._replace(river=drawn.river._replace(k_r=4.0 * drawn.river.k_r / 0.05))
        assert let_go(wild, ASSUMED, rng).diverges
