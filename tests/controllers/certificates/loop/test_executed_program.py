"""The linearised loop of an executed program: spectral radius at states along the curve."""

import hvf
from controllers.certificates.loop.executed import looked_at
from controllers.certificates.loop.hand import HandImpedance
from controllers.certificates.loop.laws import FOLLOW_LAW
from controllers.certificates.loop.sampled_loop import SampledLoop
from controllers.certificates.loop.sampling import Sampling
from controllers.certificates.loop.stability import River
from controllers.curves.trajectory import Trajectory
from controllers.fields.follow import Follow
from experiments.certify.certified_device import phantom_device

CIRCLE = Trajectory.circle(0.0477, 4.0)
DEVICE = phantom_device()


def river(law=FOLLOW_LAW, k_r=300.0, b_d=8.0, width=0.25, curve=CIRCLE):
    return River(law, k_r, b_d, width, curve, DEVICE, Sampling(1e-3))


def test_executed_radius_matches_symbolic_loop():
    stable = looked_at(
        Follow(CIRCLE, 300.0, 8.0, 0.25).program(), river(k_r=1.0, b_d=0.0), 0.02, [HandImpedance()], n=4
    )
    shaking = looked_at(Follow(CIRCLE, 2e4, 8.0, 0.25).program(), river(k_r=1.0, b_d=0.0), 0.02, [HandImpedance()], n=4)
    assert stable.radius < 1.0 < shaking.radius
    # The differences are the derivatives: on the curve the radius is the symbolic one.
    exact = SampledLoop(river(k_r=2e4).still_at(river().phases(4)), Sampling(1e-3)).radius(2e4, 8.0).max()
    assert shaking.radius >= exact - 1e-3


def test_time_dependent_law_is_evaluated_in_the_first_lap():
    """And not at the times of the curve that is slowed down for the plant: there this law is as stiff as a wall."""

    @hvf.law
    def later(hand, k=0.01):
        return 0.0, 0.0, -k * hand.t

    seen = looked_at((Follow(CIRCLE, 300.0, 8.0, 0.25) + later).program(), river(), 0.02, [HandImpedance()], n=4)
    assert seen.radius < 1.0
    assert seen.strongest < 10.0
