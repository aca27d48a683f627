"""A hand whose impedance is too stiff for the physics step is refused exactly from where it diverges."""

import numpy as np
import pytest

from experiments.config.options import run_config
from experiments.setups.wiring import wire
from models.phantom.parameters import MIN_TIP_MASS, PREMIUM_1_5
from sim.errors import SimError
from sim.users.hand.actions import Grab, Turn
from sim.users.hand.arm import Arm

TURNING = Arm(turns=(Turn(0.1, 0.5, 0.3, (0.0, 0.0, 1.0)),))
GRABBING = Arm(grabs=(Grab(0.1, (0.0, 0.0, 0.01), 0.5),))
TRACING = Arm(path=np.zeros((3, 3)))


def growth(k: float, b: float, m: float, h: float) -> float:
    """Largest modulus of an eigenvalue of semi-implicit Euler of m ẍ = −k x − b ẋ."""
    slower = np.array([[1.0 - h * b / m, -h * k / m], [0.0, 1.0]])
    return float(np.abs(np.linalg.eigvals(np.array([[1.0, 0.0], [h, 1.0]]) @ slower)).max())


@pytest.mark.parametrize(
    ("arm", "k", "b", "m", "most"),
    [
        (TURNING, 0.1, 2.5e-3, min(PREMIUM_1_5.gimbal_inertia), 1.5518e-3),
        (GRABBING, 300.0, 5.0, MIN_TIP_MASS, 9.3675e-3),
        (TRACING, 300.0, 5.0, MIN_TIP_MASS, 9.3675e-3),
    ],
)
def test_step_is_refused_from_where_the_impedance_diverges(arm: Arm, k: float, b: float, m: float, most: float) -> None:
    arm.check_step(0.999 * most)
    assert growth(k, b, m, 0.999 * most) < 1.0
    assert growth(k, b, m, 1.001 * most) > 1.0
    with pytest.raises(SimError, match=r"needs a physics step of 0\.00\d+ s or less, got "):
        arm.check_step(1.001 * most)
    Arm().check_step(1.001 * most)  # without an impedance nothing diverges


def test_run_with_unstable_turning_hand_is_refused() -> None:
    words = {"user": "turn", "servo_period": 2e-3, "physics_step": 2e-3, "figure": "none"}
    with pytest.raises(SimError, match=r"the hand that turns the stylus needs a physics step of 0\.00155 s or less"):
        wire(run_config(expressive=True, **words))
