"""A hand pushed towards poses beyond the joint limits meets a wall; without walls it reaches them."""

import numpy as np
import pytest

from experiments.studies.wall_trials import pushed_run


@pytest.mark.slow
def test_wall_keeps_the_hand_out_of_infeasible_region() -> None:
    without, with_walls = pushed_run(walls=False), pushed_run(walls=True)
    pushed = (without.t > 2.0) & (without.t < 5.0)
    assert np.degrees(without.excess[pushed].max()) > 35.0
    assert np.degrees(with_walls.excess[pushed].max()) < 5.0
    assert without.radius[pushed].max() - with_walls.radius[pushed].max() > 5e-3
    # The hand is not thrown by it, nor does it chatter: until the push has eased out the radius has one hill, but for
    # two counts of an encoder (0.024 mm at most with six seeds; let go, the hand swings over its curve by 0.1 mm).
    radius = with_walls.radius[pushed & (with_walls.t < 4.9)][::25]
    top = int(radius.argmax())
    assert np.diff(radius[: top + 1]).min() > -6e-5
    assert np.diff(radius[top:]).max() < 6e-5
    # Before the push both runs are the same: within the limits nothing is felt.
    before = without.t < 2.0
    np.testing.assert_array_equal(without.radius[before], with_walls.radius[before])
