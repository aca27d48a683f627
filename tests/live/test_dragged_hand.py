"""The force of a dragged hand: spring and damper to a target that is set anew for each block."""

import numpy as np
import pytest

from sim.users.hand.arm import Arm, hand_force
from sim.users.hand.dragged import dragged, relaxed, tremor

RNG = np.random.default_rng(3)
START, END, P, V = (0.05 * RNG.normal(size=3) for _ in range(4))


@pytest.mark.parametrize("pressed", [False, True])
@pytest.mark.parametrize("t0", [0.0, 7.3, 20_000.0])
def test_dragging_force_is_spring_and_damper_to_a_moving_point(pressed, t0):
    arm = dragged(Arm(stiffness=250.0, damping=4.0).compiled(), t0, 0.008, START, END, pressed)
    force = np.full(3, np.nan)
    for share in (0.0, 0.25, 0.875):
        hand_force.py_func(arm, t0 + 0.008 * share, P, V, force)
        wanted = 250.0 * (START + share * (END - START) - P) + 4.0 * ((END - START) / 0.008 - V)
        # After six hours a double knows the time to 4e-12 s, and the point moves at 10 m/s here.
        np.testing.assert_allclose(force, wanted, atol=1e-9 if t0 < 100.0 else 1e-5)
        assert arm.switch[0] == float(pressed)


def test_released_hand_has_no_force_and_no_switch():
    arm = dragged(Arm().compiled(), 0.0, 0.008, START, END, True)
    force = np.ones(3)
    hand_force.py_func(arm, 0.001, P, V, force)
    let_go = relaxed(arm)
    hand_force.py_func(let_go, 0.008, P, V, force)
    assert np.all(force == 0.0)
    assert let_go.switch[0] == 0.0


def test_tremor_is_0_1_mm_between_8_and_12_hz():
    t = np.arange(0.0, 10.0, 1e-3)
    path = np.array([tremor(s) for s in t])
    spectrum = np.abs(np.fft.rfft(path, axis=0)) ** 2
    rates = np.fft.rfftfreq(len(t), 1e-3)
    assert spectrum[(rates >= 8.0) & (rates <= 12.0)].sum() > 0.99 * spectrum.sum()
    assert np.abs(path).max() == pytest.approx(1e-4, rel=1e-3)
