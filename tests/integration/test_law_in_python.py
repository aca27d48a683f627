"""A law in plain Python: a tick interrupted for it equals the compiled tick exactly."""

import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from controllers.fields.follow import Follow
from controllers.fields.own.own_law import PythonLaw, law
from experiments.config.options import run_config
from experiments.setups.parts.lap import DEFAULT_LAP
from sim.errors import SimError
from sim.loop.loop import Loop
from tests.loop_with_law import loop_with

CONFIG = run_config(clips=("cheer", "angry"), seconds=0.2)
AROUND, MODE = CONFIG.map.around, CONFIG.mode
FOLLOW = Follow(Trajectory.circle(AROUND.radius, DEFAULT_LAP), MODE.stiffness, MODE.damping, MODE.tube)


def _run(program, seconds=0.2):
    logs = []

    def keep(ticks, frames, n):
        m = -(-n // session.servo.figure_ticks)
        logs.append([a[:n].copy() for a in ticks] + [a[:m].copy() for a in frames])

    session, loop = loop_with(CONFIG, program, keep)
    loop.run(seconds)
    return session, logs


def test_tick_with_python_law_equals_the_compiled_tick_exactly():
    seen = []

    def careless(hand):
        hand.p[:] = hand.v[:] = 0.0
        return hand.p

    def nothing(hand):
        seen.append((hand.t, *hand.p, *hand.v))
        return np.zeros(3)

    compiled, plain = _run(FOLLOW)
    cut, logged = _run(FOLLOW + PythonLaw(careless) + PythonLaw(nothing))
    for one, other in zip(plain, logged, strict=True):
        for a, b in zip(one, other, strict=True):
            np.testing.assert_array_equal(a, b)
    np.testing.assert_array_equal(compiled.world.data.qpos, cut.world.data.qpos)
    # It was called once a tick, with what the device measured, although the law before it changed its own hand.
    hands = np.concatenate([block[0] for block in plain])
    np.testing.assert_array_equal(np.array(seen), hands[:, [0, 1, 2, 3, 8, 9, 10]])


def test_built_in_law_called_from_python_gives_nearly_the_same_run():
    _, plain = _run(FOLLOW)
    _, logged = _run(PythonLaw(lambda hand: FOLLOW.wrench(hand).force))
    np.testing.assert_allclose(logged[-1][0][:, 1:4], plain[-1][0][:, 1:4], atol=2e-5)


def test_nan_from_a_law_latches_the_fault_and_removes_the_force():
    _, logs = _run(PythonLaw(lambda hand: [np.nan if hand.t > 0.1 else 1.0, 0.0, 0.0]))
    force = np.concatenate([block[2] for block in logs])
    assert force[90, 0] == pytest.approx(1.0)
    assert not force[105:].any()


def leaning(hand, k=40.0, turn=0.02):
    """Towards the axis, and a moment against the stylus's turning."""
    return -k * hand.p[0], -k * hand.p[1], 0.0, -turn * hand.w[0], -turn * hand.w[1], turn * hand.p[2]


def test_compiled_and_python_own_laws_give_identical_runs_with_moments():
    plain, compiled = law(leaning), law(compiled=True)(leaning)
    _, once = _run((FOLLOW + plain + compiled(k=10.0)).limited(6.0))
    _, again = _run((FOLLOW + compiled + plain(k=10.0)).limited(6.0))
    for one, other in zip(once, again, strict=True):
        for a, b in zip(one, other, strict=True):
            np.testing.assert_array_equal(a, b)
    hands, fields = (np.concatenate([block[k] for block in once]) for k in (0, 1))
    np.testing.assert_allclose(fields[:, 5], 2.0 * 0.02 * hands[:, 3], rtol=1e-12)
    assert np.abs(fields[:, 5]).max() > 0.0


def test_loop_without_the_laws_of_its_field_is_refused():
    session, _ = loop_with(CONFIG, PythonLaw(lambda hand: hand.p))
    with pytest.raises(SimError, match="1 slots for laws in Python, 0 are given"):
        Loop(session.servo, session.world)
