"""Certified rivers in random simulations: nothing diverges, and a river stiffer than certified is detected."""

import numpy as np
import pytest

from experiments.certify.trial_simulation import FULL_CONDITIONS
from experiments.studies import certified_trials
from experiments.studies.certified_trials import ASSUMED_CONDITIONS, Release, draw_certified, release


@pytest.fixture(scope="module")
def drawn():
    return draw_certified(np.random.default_rng(3))


@pytest.mark.slow
def test_released_hands_in_certified_river_do_not_diverge(drawn, monkeypatch, capsys):
    monkeypatch.setattr(certified_trials, "draw_certified", lambda rng: drawn)
    certified_trials.certified_trials(rivers=1, hands=4, seed=3)
    rows = [line.split("|") for line in capsys.readouterr().out.splitlines() if line.startswith("|")]
    counts = {row[1].strip(): (int(row[2]), int(row[3])) for row in rows[2:]}
    assert counts == {"inside the assumptions": (4, 0), "with Coulomb friction and rounding": (4, 0)}


@pytest.mark.slow
def test_trials_detect_a_river_stiffer_than_certified(drawn):
    wild = drawn._replace(river=drawn.river._replace(k_r=60.0 * drawn.river.k_r), radius=0.97)
    rng = np.random.default_rng(5)
    assert all(release(wild, conditions, rng).diverges for conditions in (ASSUMED_CONDITIONS, FULL_CONDITIONS))


def test_hand_held_by_friction_does_not_count_as_diverging():
    assert not Release(3.0e-3, 3.0e-3 + 2e-5, 5e-5).diverges
    assert Release(3.0e-3, 3.0e-3 + 2e-5, 0.0).diverges
    assert Release(np.inf, np.inf, 5e-5).diverges
