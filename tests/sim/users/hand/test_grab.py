"""A simulated hand that grabs: where it wants to be, and when the switch is pressed."""

import numpy as np
import pytest

from controllers.errors import ParameterError
from models.humanoid.skeleton import rest_pose
from sim.errors import SimError
from sim.users.hand.actions import Grab
from sim.users.hand.arm import Arm, hand_force
from sim.world.world import World
from tests.sim.bare_servos import SteppedPhantom

GRAB = Grab(1.0, (0.0, 0.02, 0.0), seconds=0.5, hold=0.2, place=(0.05, 0.0, 0.0), reach=0.4)


class Hand:
    """A hand held at a point: its force divided by its stiffness tells where it wants to be."""

    def __init__(self, arm: Arm):
        self.arm = arm.compiled()
        self.stiffness = arm.stiffness

    def at(self, t: float, p: tuple[float, float, float] = (0.03, 0.0, 0.0)) -> tuple[np.ndarray, float]:
        force = np.zeros(3)
        hand_force(self.arm, t, np.array(p), np.zeros(3), force)
        return force, float(self.arm.switch[0])


def test_grab_reaches_presses_carries_holds_and_releases() -> None:
    hand = Hand(Arm(stiffness=200.0, damping=0.0, grabs=(GRAB,)))
    start = np.array([0.03, 0.0, 0.0])
    for t, wanted, switch in (
        (0.99, start, 0.0),
        (1.0, start, 0.0),
        (1.2, [0.04, 0.0, 0.0], 0.0),
        (1.3999, [0.05, 0.0, 0.0], 0.0),
        (1.4001, [0.05, 0.0, 0.0], 1.0),
        (1.65, [0.05, 0.01, 0.0], 1.0),
        (1.9, [0.05, 0.02, 0.0], 1.0),
        (2.09, [0.05, 0.02, 0.0], 1.0),
        (2.11, start, 0.0),
    ):
        force, pressed = hand.at(t)
        np.testing.assert_allclose(force, 200.0 * (np.array(wanted) - start), atol=1e-6)
        assert pressed == switch


def test_steady_grab_moves_at_constant_speed() -> None:
    grab = Grab(1.0, (0.0, 0.02, 0.0), seconds=0.5, hold=0.0, steady=True)
    hand, damped = (Hand(Arm(stiffness=k, damping=b, grabs=(grab,))) for k, b in ((200.0, 0.0), (1e-9, 5.0)))
    for share in (0.0, 0.1, 0.5, 0.99):
        force, pressed = hand.at(1.0 + 0.5 * share)
        np.testing.assert_allclose(force, [0.0, 200.0 * 0.02 * share, 0.0], atol=1e-9)
        np.testing.assert_allclose(damped.at(1.0 + 0.5 * share)[0], [0.0, 5.0 * 0.04, 0.0], atol=1e-9)
        assert pressed == 1.0
    assert not hand.at(1.501)[0].any()


def test_damping_is_relative_to_the_wanted_speed() -> None:
    still = Hand(Arm(stiffness=200.0, damping=0.0, grabs=(GRAB,)))
    damped = Hand(Arm(stiffness=200.0, damping=3.0, grabs=(GRAB,)))
    h = 1e-5
    for t in (1.1, 1.33, 1.5, 1.77, 2.0):
        speed = (still.at(t + h)[0] - still.at(t - h)[0]) / (2.0 * h * 200.0)
        np.testing.assert_allclose(damped.at(t)[0] - still.at(t)[0], 3.0 * speed, atol=1e-6)


def test_grab_without_a_place_presses_at_the_current_point() -> None:
    hand = Hand(Arm(grabs=(Grab(0.5, (0.0, 0.0, 0.0), seconds=0.2, hold=0.0),)))
    assert hand.at(0.4) == (pytest.approx(np.zeros(3)), 0.0)
    force, pressed = hand.at(0.5)
    np.testing.assert_allclose(force, 0.0, atol=1e-12)
    assert pressed == 1.0
    assert hand.at(0.71)[1] == 0.0


def test_device_reports_the_switch() -> None:
    world = World()
    world.reset(np.array([0.03, 0.02, 0.02]), rest_pose())
    arm = Arm(grabs=(Grab(0.02, (0.0, 0.0, 0.0), seconds=0.03, hold=0.0),))
    phantom, switches = SteppedPhantom(world, arm), []
    for _ in range(80):
        switches.append(phantom.read().switch)
        phantom.write(np.zeros(3))
    pressed = np.flatnonzero(switches)
    # The switch is read at the beginning of the period after the one in which it was pressed.
    np.testing.assert_array_equal(pressed, np.arange(pressed[0], pressed[0] + 30))
    assert pressed[0] in (20, 21)


@pytest.mark.parametrize(
    "grab",
    [
        {"at": -1.0, "carry": (0.0, 0.0, 0.0)},
        {"at": 0.0, "carry": (0.0, np.nan, 0.0)},
        {"at": 0.0, "carry": (0.0, 0.0)},
        {"at": 0.0, "carry": (0.0, 0.0, 0.0), "seconds": 0.0},
        {"at": 0.0, "carry": (0.0, 0.0, 0.0), "hold": -0.1},
        {"at": 0.0, "carry": (0.0, 0.0, 0.0), "place": (0.0, 0.0, 0.0), "reach": 0.0},
    ],
)
def test_invalid_grab_is_refused(grab: dict) -> None:
    with pytest.raises((SimError, ParameterError)):
        Grab(**grab)


def test_overlapping_grabs_or_grabs_on_a_path_are_refused() -> None:
    with pytest.raises(SimError, match=r"begins at 1\.5 s, before another has ended at 2\.1 s"):
        Arm(grabs=(GRAB, Grab(1.5, (0.0, 0.0, 0.0))))
    with pytest.raises(SimError, match="path"):
        Arm(path=np.zeros((5, 3)), grabs=(GRAB,))
