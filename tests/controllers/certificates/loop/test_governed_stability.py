"""Stability of a loop with a speed governor: certified, refuted, and unknown in between."""

import pytest

from controllers.certificates.loop.governed import governed_stability, max_drag
from controllers.certificates.loop.hand import HandImpedance
from controllers.certificates.loop.sampled_loop import SampledLoop
from controllers.certificates.loop.sampling import Sampling
from tests.controllers.rivers_for_certificates import river


@pytest.mark.slow
def test_governor_drag_is_certified_by_circle_criterion_or_refuted_if_unstable():
    hands = [HandImpedance(), HandImpedance(0.1, 2.0, 100.0)]
    soft, hard, between = (governed_stability(river(), drag, hands) for drag in (8.0, 200.0, 45.0))
    assert (soft.verdict, hard.verdict, between.verdict) == ("certified", "refuted", "unknown")
    assert 20.0 < soft.figures["governor_certain"] < 45.0
    assert "governor of 200" in hard.reason
    assert hard.counterexample["growth_rate"] > 100.0


def test_circle_criterion_drag_is_below_critical_drag():
    loop = SampledLoop(river().still(), Sampling(1e-3))
    assert 0.3 < max_drag(loop, 300.0, 8.0) / 70.0 < 1.0
    assert max_drag(loop, 20_000.0, 8.0) == 0.0
