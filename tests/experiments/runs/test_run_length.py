"""The length of a run affects nothing before its end, and is the same recorded and in memory."""

import numpy as np
import pytest

import hvf
from experiments.config.options import run_config
from experiments.setups.wiring import wire
from geometry.arrays import Array
from sim.loop.loop import Loop

CURVE = hvf.circle(lap=2.0)
BARE = hvf.Figure(kind="none")


def simulation(**parts: object) -> hvf.Simulation:
    around = hvf.Cylindrical(hvf.clips("cheer"), around=CURVE)
    return hvf.Simulation(field=hvf.Follow(CURVE, k_r=300, b_d=8), haptic_map=around, figure=BARE, **parts)  # pyright: ignore


@pytest.mark.parametrize("seconds", [0.0505, 0.0515, 0.05])
def test_recorded_run_is_as_long_as_in_memory(seconds: float) -> None:
    sim = simulation(clock=hvf.Clock(physics_step=5e-4))
    session = sim.session(seconds)
    in_memory = Loop(session.servo, session.world).run(seconds).simulated
    assert len(sim.run(seconds).ticks["t"]) == pytest.approx(in_memory / 1e-3)


def hands(seconds: float, shown: float) -> Array:
    """Places and forces of the tracing hand of a configured run of some length, until the time `shown` [s]."""
    rows: list[Array] = []
    session = wire(run_config(figure="none", user="trace", seconds=seconds))
    keep = lambda ticks, frames, n: rows.append(np.hstack((ticks.hand[:n], ticks.user[:n])))  # noqa: E731
    Loop(session.servo, session.world, keep).run(shown)
    return np.concatenate(rows)


def test_tracing_hand_does_not_brake_before_the_end() -> None:
    np.testing.assert_array_equal(hands(0.3, 0.3), hands(0.6, 0.3))
    sim = simulation(user=hvf.User(traces=CURVE))
    short, long = (sim.run(seconds).ticks["user"][:300] for seconds in (0.3, 0.6))
    np.testing.assert_array_equal(short, long)
