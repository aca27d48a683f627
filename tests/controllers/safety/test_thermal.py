"""Motors are never asked for more than their heat leaves, and heat follows the square of the torque."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controllers.safety.thermal import hold_to_heat

C, P, TAU, T = (0.38, 0.32, 0.32), (1.7, 1.4, 1.4), 10.0, 5e-2
SHARE = 1.0 - np.exp(-T / TAU)


@settings(max_examples=40)
@given(st.lists(st.tuples(*[st.floats(-5, 5)] * 3, st.integers(1, 100)), max_size=10))
def test_no_sequence_of_torques_heats_a_motor_beyond_its_continuous_torque(sequence) -> None:
    heat = np.zeros(3)
    for *wanted, times in sequence:
        for _ in range(times):
            torque = np.array(wanted)
            used = hold_to_heat(heat, C, P, SHARE, torque)
            assert (np.abs(torque) <= np.array(P) * (1 + 1e-12)).all()
            assert used <= 1.0 + SHARE * (P[0] / C[0]) ** 2
            assert (heat <= np.array(C) ** 2 * (1.0 + SHARE * (P[0] / C[0]) ** 2)).all()
            assert np.allclose(np.cross(torque, wanted), 0.0, atol=1e-9)


def test_the_heat_of_a_constant_torque_rises_as_a_winding_warms() -> None:
    heat = np.zeros(3)
    for k in range(2000):
        torque = np.array([0.3, 0.0, 0.0])
        used = hold_to_heat(heat, C, P, SHARE, torque)
        assert torque[0] == 0.3
        assert used == pytest.approx((0.3 / C[0]) ** 2 * (1.0 - np.exp(-(k + 1) * T / TAU)))


def test_a_stalled_motor_comes_down_to_its_continuous_torque() -> None:
    heat, given_ = np.zeros(3), []
    for _ in range(4000):
        torque = np.array([5.0, 0.0, 0.0])
        hold_to_heat(heat, C, P, SHARE, torque)
        given_.append(torque[0])
    assert given_[0] == pytest.approx(P[0])
    assert given_[-1] == pytest.approx(C[0], rel=0.03)


def test_a_heat_that_is_no_number_counts_as_the_highest() -> None:
    heat, torque = np.array([np.nan, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])
    hold_to_heat(heat, C, P, SHARE, torque)
    assert torque[0] == pytest.approx(C[0])
