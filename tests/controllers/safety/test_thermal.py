"""Thermal limits of motors: heat follows the square of the torque, and torque is limited by the heat."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controllers.safety.thermal import limit_by_heat

C, P, TAU, T = (0.38, 0.32, 0.32), (1.7, 1.4, 1.4), 10.0, 5e-2
SHARE = 1.0 - np.exp(-T / TAU)


@settings(max_examples=40)
@given(st.lists(st.tuples(*[st.floats(-5, 5)] * 3, st.integers(1, 100)), max_size=10))
def test_no_torque_sequence_heats_a_motor_beyond_its_continuous_torque(sequence) -> None:
    heat = np.zeros(3)
    for *requested, ticks in sequence:
        for _ in range(ticks):
            torque = np.array(requested)
            used = limit_by_heat(heat, C, P, SHARE, torque)
            assert (np.abs(torque) <= np.array(P) * (1 + 1e-12)).all()
            assert used <= 1.0 + SHARE * (P[0] / C[0]) ** 2
            assert (heat <= np.array(C) ** 2 * (1.0 + SHARE * (P[0] / C[0]) ** 2)).all()
            assert np.allclose(np.cross(torque, requested), 0.0, atol=1e-9)


def test_heat_of_a_constant_torque_follows_the_time_constant() -> None:
    heat = np.zeros(3)
    for k in range(2000):
        torque = np.array([0.3, 0.0, 0.0])
        used = limit_by_heat(heat, C, P, SHARE, torque)
        assert torque[0] == 0.3
        assert used == pytest.approx((0.3 / C[0]) ** 2 * (1.0 - np.exp(-(k + 1) * T / TAU)))


def test_stalled_motor_falls_to_its_continuous_torque() -> None:
    heat, torques = np.zeros(3), []
    for _ in range(4000):
        torque = np.array([5.0, 0.0, 0.0])
        limit_by_heat(heat, C, P, SHARE, torque)
        torques.append(torque[0])
    assert torques[0] == pytest.approx(P[0])
    assert torques[-1] == pytest.approx(C[0], rel=0.03)


def test_non_finite_heat_counts_as_the_maximum() -> None:
    heat, torque = np.array([np.nan, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])
    limit_by_heat(heat, C, P, SHARE, torque)
    assert torque[0] == pytest.approx(C[0])
