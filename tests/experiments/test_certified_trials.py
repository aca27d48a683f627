"""Certified rivers in random simulations: nothing diverges, and the experiment notices a river that does."""

import numpy as np
import pytest

from experiments.certified_trials import ASSUMED, EVERYTHING, Let, certified_trials, draw_certified, let_go


@pytest.mark.slow
def test_hands_let_go_in_certified_rivers_do_not_diverge(tmp_path):
    certified_trials(tmp_path, rivers=2, hands=4, seed=3)
    rows = [line.split("|") for line in (tmp_path / "certified.md").read_text().splitlines() if line.startswith("|")]
    told = {row[1].strip(): (int(row[2]), int(row[3])) for row in rows[2:]}
    assert told == {"inside the assumptions": (8, 0), "with Coulomb friction and rounding": (8, 0)}


@pytest.mark.slow
def test_a_river_that_is_no_longer_what_was_certified_is_noticed():
    drawn = draw_certified(np.random.default_rng(3))
    wild = drawn._replace(river=drawn.river._replace(k_r=60.0 * drawn.river.k_r), radius=0.97)
    rng = np.random.default_rng(5)
    outcomes = [let_go(wild, conditions, rng) for conditions in (ASSUMED, EVERYTHING) for _ in range(3)]
    assert all(let.diverges for let in outcomes)


def test_a_hand_that_friction_holds_is_not_taken_for_one_that_diverges():
    assert not Let(3.0e-3, 3.0e-3 + 2e-5, 5e-5).diverges
    assert Let(3.0e-3, 3.0e-3 + 2e-5, 0.0).diverges
    assert Let(np.inf, np.inf, 5e-5).diverges
