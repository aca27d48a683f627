"""Where a held stretchy tube pulls the hand to: the curve, or where the stylus was."""

import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from controllers.fields.stretchy_tubes import StretchyTubes
from controllers.state import HandState

CIRCLE = Trajectory.circle(0.0477, 4.0)


@pytest.mark.parametrize("hold", ["curve", "stylus"])
def test_held_tube_pulls_to_the_chosen_anchor(hold):
    program = StretchyTubes(CIRCLE, 150.0, 200.0, 14.0, hold=hold).program()
    memory, wrench, away = program.fresh_memory(), np.empty(6), CIRCLE.point(1.0) * 1.1
    from controllers.fields.algebra.program import evaluate

    def force(p, switch, t):
        hand = HandState.at(p, (0.0, 0.0, 0.0), t)._replace(switch=switch).vector()
        evaluate(*program.compiled(), memory, hand, wrench)
        return wrench[:3].copy()

    force(away, False, 0.0)
    at_grab = force(away, True, 1e-3)
    pulled = force(away + 0.01, True, 2e-3)
    place = CIRCLE.point(1.0) if hold == "curve" else away
    # The whole step of the default is k_s times the distance at which it is taken hold of.
    np.testing.assert_allclose(at_grab, 200.0 * (place - away), atol=1e-3)
    np.testing.assert_allclose(pulled, 200.0 * (place - away - 0.01), atol=1e-3)
    if hold == "stylus":
        assert np.linalg.norm(at_grab) == 0.0
