"""Rivers have gains of their own, with which the default hand that pushes goes over from one river into another."""

from dataclasses import replace

import numpy as np
import pytest
from experiments.setups.modes import law, river_time

from controllers.curves.trajectory import Trajectory
from controllers.fields.follow import Follow
from controllers.fields.higher_order import HigherOrder
from controllers.fields.instructions import TRACE_RIVER
from controllers.fields.program import evaluate
from controllers.state import HAND_POSITION, HAND_SIZE, HAND_VELOCITY
from experiments.config.run_config import RunConfig
from experiments.config.words import run_config
from experiments.setups.hands import user_arm
from sim.users.arm import hand_force

MASS, FRICTION, PERIOD = 0.15, 0.03, 1e-3  # [kg], [N], [s] of what the hand moves, about the Phantom's
CURVE = Trajectory.circle(0.0477, 4.0)
RIVERS = run_config(mode="rivers", user="push", seconds=4.0)


def field_of(config: RunConfig) -> HigherOrder:
    field = law(config, CURVE)
    assert isinstance(field, HigherOrder)
    return field


def rivers_of_a_hand(config: RunConfig) -> np.ndarray:
    """Which river has the default hand, a mass with friction, at each tick from the beginning of the level river on."""
    program, arm = field_of(config).program(), user_arm(config, CURVE, ()).compiled()
    memory, hand, wrench, user = program.fresh_memory(), np.zeros(HAND_SIZE), np.zeros(6), np.zeros(3)
    p, v = CURVE.point(0.0), CURVE.velocity(0.0)
    rivers = np.empty(round(config.seconds / PERIOD))
    for k in range(len(rivers)):
        hand[0] = k * PERIOD
        hand[HAND_POSITION : HAND_POSITION + 3], hand[HAND_VELOCITY : HAND_VELOCITY + 3] = p, v
        evaluate(*program.compiled(), memory, hand, wrench)
        rivers[k] = memory[TRACE_RIVER]
        hand_force(arm, k * PERIOD, p, v, user)
        slowing = FRICTION * v / max(float(np.linalg.norm(v)), 1e-3)
        v = v + PERIOD / MASS * (wrench[:3] + user - slowing)
        p = p + PERIOD * v
    return rivers


def test_the_rivers_gains_are_those_of_their_own_options() -> None:
    config = replace(RIVERS, river_stiffness=120.0, river_damping=12.0, stiffness=500.0, damping=3.0)
    for river in field_of(config).bundle.rivers:
        assert (river.tau, river.drag) == (0.1, 12.0)
    alone = law(replace(config, mode="follow"), CURVE)
    assert isinstance(alone, Follow)
    assert (alone.k_r, alone.b_d) == (500.0, 3.0)


def test_rivers_of_a_map_from_a_file_have_gains_of_their_own_too() -> None:
    config = replace(RIVERS, map="any.npz", lifted_stiffness=40.0, lifted_damping=10.0)
    assert config.gains == (40.0, 10.0)
    assert river_time(config) == pytest.approx(0.25)
    assert replace(config, mode="follow").gains == (config.stiffness, config.damping)


def test_the_default_push_takes_the_hand_from_the_level_river_into_another_which_keeps_it() -> None:
    rivers = rivers_of_a_hand(RIVERS)
    assert np.all(rivers[:1900] == 0.0)
    assert np.all(rivers[2600:] > 0.0)
    assert np.sum(rivers < 0.0) < 20


def test_a_hand_that_does_not_push_stays_and_with_the_gains_of_one_curve_the_push_takes_it_nowhere() -> None:
    assert np.all(rivers_of_a_hand(replace(RIVERS, user="relaxed")) == 0.0)
    alone = run_config()
    stiff = replace(RIVERS, river_stiffness=alone.stiffness, river_damping=alone.damping)
    assert not np.all(rivers_of_a_hand(stiff)[2600:] > 0.0)
