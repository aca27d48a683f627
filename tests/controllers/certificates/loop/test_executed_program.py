"""The linearised loop of an executed program: spectral radius at states along the curve."""

import hvf
from controllers.certificates.loop.executed import examine_curve
from controllers.certificates.loop.hand import HandImpedance
from controllers.certificates.loop.sampled_loop import SampledLoop
from controllers.certificates.loop.sampling import Sampling
from controllers.fields.follow import Follow
from tests.controllers.rivers_for_certificates import CIRCLE, river


def test_executed_radius_matches_symbolic_loop():
    stable = examine_curve(
        Follow(CIRCLE, 300.0, 8.0, 0.25).program(), river(k_r=1.0, b_d=0.0), 0.02, [HandImpedance()], n=4
    )
    oscillating = examine_curve(
        Follow(CIRCLE, 2e4, 8.0, 0.25).program(), river(k_r=1.0, b_d=0.0), 0.02, [HandImpedance()], n=4
    )
    assert stable.radius < 1.0 < oscillating.radius
    # On the curve, finite differences give the radius of the symbolic loop.
    exact = SampledLoop(river(k_r=2e4).still_at(river().phases(4)), Sampling(1e-3)).radius(2e4, 8.0).max()
    assert oscillating.radius >= exact - 1e-3


def test_time_dependent_law_is_evaluated_in_the_first_lap():
    """Not at the times of the slowed-down curve, where this law would be as stiff as a wall."""

    @hvf.law
    def growing_with_time(hand, k=0.01):
        return 0.0, 0.0, -k * hand.t

    linearised = examine_curve(
        (Follow(CIRCLE, 300.0, 8.0, 0.25) + growing_with_time).program(), river(), 0.02, [HandImpedance()], n=4
    )
    assert linearised.radius < 1.0
    assert linearised.strongest < 10.0
