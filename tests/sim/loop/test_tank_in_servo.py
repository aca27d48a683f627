"""The energy tank of the servo: does not affect passive fields, and limits active ones to its budget."""

from collections import deque

import numpy as np
import pytest

from controllers.fields.own.own_law import PythonLaw
from controllers.safety.energy_tank import TANK_ENERGY, EnergyTank
from experiments.config.options import run_config
from experiments.setups.parts.clips import load_clips
from experiments.setups.parts.hands import lap_pushes
from experiments.setups.wiring import wire
from sim.loop.loop import Loop
from sim.users.hand.actions import Push
from tests.loop_with_law import loop_with

CLIPS = ("cheer", "angry")
CONFIG = run_config(clips=CLIPS, seconds=1.0)
UNLIMITED_TANK = EnergyTank(1e-3, power=1e3, capacity=1e3)


def run(program, tank=None, seconds=1.0, config=CONFIG):
    """Session, positions, forces and tank of a run with a field; by default the configuration's field."""
    logs = []

    def append_block(ticks, frames, n):
        logs.append((ticks.hand[:n, 1:4].copy(), ticks.force[:n].copy(), ticks.tank[:n].copy()))

    if program is None:
        session = wire(config)
        loop = Loop(session.servo, session.world, append_block)
    else:
        session, loop = loop_with(config, program, append_block, tank)
    loop.run(seconds)
    return session, *(np.concatenate(channel) for channel in zip(*logs, strict=True))


def work_on_hand(p, force):
    """Work of the forces, held constant within each tick, on the hand up to each tick [J]."""
    return np.cumsum(np.sum(force[:-1] * np.diff(p, axis=0), axis=1))


@pytest.mark.parametrize(
    "changes",
    [
        {"mode": "follow", "user": "push", "pushes": lap_pushes(0.0, 1.0, 4.0)},
        {"mode": "bunny"},
        {"mode": "rivers", "user": "push", "pushes": lap_pushes(0.0, 1.0, 2.0)},
        {"mode": "stretch-then-follow"},
    ],
    ids=lambda changes: changes["mode"],
)
def test_built_in_fields_are_never_limited(changes):
    session, _, _, tank = run(None, config=run_config(clips=CLIPS, seconds=1.0, **changes))
    assert np.all(tank[:, 1] == 1.0)
    assert tank[:, 0].min() > 0.5 * tank[0, 0] > 0.0
    assert session.servo.field.tank[TANK_ENERGY] == tank[-1, 0]


def test_unneeded_tank_leaves_forces_bit_for_bit():
    config = run_config(clips=CLIPS, seconds=1.0, user="push", pushes=lap_pushes(0.0, 1.0))
    session, p, force, _ = run(None, config=config, seconds=0.5)
    _, other_p, other_force, _ = run(session.field.program(), UNLIMITED_TANK, 0.5, config)
    np.testing.assert_array_equal(force, other_force)
    np.testing.assert_array_equal(p, other_p)


def test_energy_stored_by_the_hand_in_a_spring_is_given_back():
    """A push of 4 N stores more energy than the tank held initially; the return is not limited."""
    config = run_config(clips=CLIPS, seconds=1.0, user="push", pushes=lap_pushes(0.0, 1.0, 4.0)[:1])
    tank = EnergyTank(1e-3, power=0.012, capacity=2.0, initial=2e-3)
    _, p, force, tank_log = run(wire(config, load_clips(CLIPS)[0]).field.program(), tank, 1.0, config)
    work = work_on_hand(p, force)
    stored = -work.min()
    given_back = work[-1] - work.min()
    assert stored > 10e-3
    assert given_back > 5e-3
    assert np.all(tank_log[:, 1] == 1.0)


def negative_damper(hand):
    """A damper with the wrong sign [N]."""
    return 6.0 * hand.v


def delayed_spring(ticks):
    """A spring and a damper delayed by some ticks [N]."""
    past = deque(maxlen=ticks)

    def force(hand):
        past.append((hand.p, hand.v))
        p, v = past[0]
        return -400.0 * (p - [CONFIG.map.around.radius, 0.0, 0.0]) - 4.0 * v

    return force


@pytest.mark.parametrize("make_law", [lambda: negative_damper, lambda: delayed_spring(25)], ids=["wrong sign", "late"])
@pytest.mark.slow
def test_active_law_injects_no_more_than_its_budget(make_law):
    tank = EnergyTank(1e-3, power=0.02, capacity=0.5, initial=0.02)
    config = run_config(clips=CLIPS, seconds=1.0, user="push", pushes=(Push(0.0, 0.1, 2.0),))
    _, p, force, tank_log = run(PythonLaw(make_law()).program(), tank, 1.5, config)
    _, free_p, free_force, _ = run(PythonLaw(make_law()).program(), UNLIMITED_TANK, 1.5, config)
    time = 1e-3 * np.arange(1, len(p))
    work, free = work_on_hand(p, force), work_on_hand(free_p, free_force)
    # One period's change of speed is booked a period late.
    assert np.all(work <= 0.02 + 0.02 * (time + 0.05) + 2e-3)
    assert free.max() > 10.0 * (0.02 + 0.02 * 1.5)
    assert np.sum(tank_log[:, 1] < 1.0) > 20
    speed, free_speed = (np.linalg.norm(np.diff(x, axis=0), axis=1).max() / 1e-3 for x in (p, free_p))
    assert speed < 0.5 * free_speed
